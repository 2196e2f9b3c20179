"""The site: MyST pages (notebooks among them), read offline."""

import ethogram

project = "Ethogram"
author = "The Ethogram developers"
copyright = f"{author}, Apache-2.0"
release = ethogram.__version__

extensions = ["myst_nb", "sphinx.ext.mathjax"]
exclude_patterns = ["_build", "_vendor", "results/records", "results/tuned/records"]

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_raise_on_error = True  # a page's code is run, so it cannot go stale unnoticed
nb_execution_timeout = 120

html_theme = "furo"
html_title = "Ethogram"
html_static_path = ["_vendor"]
html_copy_source = False
mathjax_path = "mathjax/tex-chtml.js"  # MathJax 3.2.2 and its fonts, from the npm package mathjax
