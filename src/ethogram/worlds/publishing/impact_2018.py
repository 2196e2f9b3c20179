"""How impact factors were distributed in 2018: the aim of the initial state (thesis, figure 7.1).

Cites per document over two years of the 24 620 journals that SCImago lists for 2018, rounded; the
last count is of 20 and more.  Aggregate counts after SCImago Journal & Country Rank.
"""

IMPACT_2018 = (
    9102,
    7290,
    3884,
    1973,
    1034,
    459,
    270,
    146,
    110,
    62,
    58,
    48,
    32,
    22,
    14,
    21,
    12,
    8,
    8,
    4,
    63,
)
