"""What the study's page opens with."""

from ethogram.core.introduction import Introduction
from ethogram.studies.thesis import chapter

INTRODUCTION = Introduction(
    text="Authors write papers and send them to journals, editors accept or reject them, and "
    "papers cite earlier papers, the better and newer ones more. Every author has a quality that "
    "cannot be seen, a number from 0 to q_max, and papers vary about that of their author. What "
    "can be seen are indicators: the h-index of an author and the impact factor of a journal. Do "
    "these tell the quality? That depends on what everybody does: authors send their papers "
    "anywhere (random), to a journal that fits the paper (minded), or learn where to (learned); "
    "editors reject the worst quarter (mild scrutiny), accept only what is better than half of all "
    "they have published (improve only), or learn how strict to be (learned). A simulation lasts "
    "20 years of ten steps. Where the text of the thesis can be read in several ways, the claims "
    "are judged again under each reading.",
    source=chapter(7),
    symbols={
        "q_max": "the highest quality there can be",
        "h-index": "of an author: the largest number i of papers with i citations each (eq. 7.1)",
        "impact factor": "of a journal: citations in a year to its papers of the two years before, "
        "per such paper (eq. 7.3)",
        "acceptance rate": "of a journal: the share of the drafts sent to it that it publishes",
        "correlation": "Pearson\u2019s where nothing else is said: 1 if one number grows exactly "
        "with the other, 0 if it does not tell, -1 if it falls; Spearman\u2019s is that of ranks",
        "share": "of all papers of the simulated years, in the fourth of the journals that has "
        "most",
        "centre": "mean quality less q_max / 2, over q_max: 0 in the middle of the range",
        "skewness": "how lopsided the qualities are: 0 for a bell, above 0 if few are far better",
        "runs": "simulations of a scenario, each with random numbers of its own",
    },
    case="minded-mild_scrutiny-100-20-1000",
    frame=41,
    caption="Authors (below, the better the further to the right) and journals (above, in the "
    "order of their impact factors, the larger the more papers they have), after drafts were sent.",
)
