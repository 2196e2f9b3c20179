"""How impact factors were distributed in 2018: the aim of the initial state (thesis, figure 7.1).

Cites per document over two years, rounded, of what SCImago lists for 2018; the last count is of 20
and more.  Aggregate counts after SCImago Journal & Country Rank: of its 24 620 journals, and of all
31 887 sources, with book series and proceedings.
"""

from typing import Literal

Sources = Literal["journals", "all"]

# fmt: off
IMPACT_2018: dict[Sources, tuple[int, ...]] = {
    "journals": (
        9102, 7290, 3884, 1973, 1034, 459, 270, 146, 110, 62, 58, 48, 32, 22, 14, 21, 12, 8, 8, 4,
        63,
    ),
    "all": (
        13835, 9145, 4254, 2107, 1079, 489, 286, 158, 118, 72, 67, 54, 37, 28, 15, 22, 14, 9, 8, 5,
        85,
    ),
}
# fmt: on
