"""The code of pages that `make docs` does not run."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_the_code_of_the_readme_runs_and_all_earn_the_most_that_there_is(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out == "[99. 99. 99. 99.]\n"
    assert "<!doctype html>" in (tmp_path / "episode.html").read_text()
