"""Pages that show what the studies found: one folder that needs no network and no server.

`index.html` has a row per study; `report/` holds each study's page, and beside it the data behind
its tables and figures.  Nothing here computes or reads records: the caller brings `StudyPage`s.
"""

from ethogram.report.compare.comparison import Comparison, compare_pages
from ethogram.report.page import StudyPage
from ethogram.report.replay import Replay
from ethogram.report.site import page_bytes, write, write_comparison, write_replay

__all__ = [
    "Comparison",
    "Replay",
    "StudyPage",
    "compare_pages",
    "page_bytes",
    "write",
    "write_comparison",
    "write_replay",
]
