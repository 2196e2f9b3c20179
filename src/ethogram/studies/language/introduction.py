"""What the study's page opens with."""

from ethogram.core.introduction import Introduction
from ethogram.studies.thesis import chapter

INTRODUCTION = Introduction(
    text="Two to four robots stand in a square with two to four targets. Each is to go to a target "
    "of its own and does not know which one that is; another robot does, and can say one word in "
    "every step, which all hear. The words mean nothing at first: speakers and listeners learn "
    "them together, by MADDPG, from the distance that is left to the targets. Varied is how many "
    "different words there are to use. With fewer than there are things to say, not all can be "
    "told; with many more, there is more to agree on. Learned languages are compared with no "
    "communication (NoComm) and with a hand-made language that names every robot and target "
    "(Opt), both with movers that learn in the same way. An episode has 25 steps.",
    source=chapter(2),
    symbols={
        "n_r": "number of robots",
        "n_t": "number of targets",
        "|W|": "number of words that a robot may use, W being the alphabet",
        "e": "expressiveness: words per association of a robot with a target, |W| / (n_r n_t); "
        "at 1 there is one word for every one",
        "R_val": "validation reward: the sum of all agents\u2019 rewards over an episode, which is "
        "minus the distance to their targets, mean over 1000 validation episodes; 0 would be best",
        "normalised R_val": "R_val of all alphabets of one setting (n_r, n_t), scaled to mean 0 "
        "and standard deviation 1, so that settings can be averaged; its unit is that deviation",
        "Opt, NoComm": "the hand-made language, and none at all",
        "NxM": "a setting: N robots and M targets",
    },
    case="3x3-learned-9",
    frame=7,
    caption="Three robots (circles) and three targets (squares), in an episode after learning with "
    "nine words; a robot has the colour of the target that it is to reach. Lines join each robot "
    "to the one it guides and to that one\u2019s target; beside robots stand the words that they "
    "just said.",
)
