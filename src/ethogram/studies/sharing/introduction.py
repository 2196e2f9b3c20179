"""What the study's page opens with."""

from ethogram.core.introduction import Introduction
from ethogram.studies.thesis import chapter

INTRODUCTION = Introduction(
    text="Ten agents live beside two resources. In every step each agent names the resource that "
    "it prefers, and moves there once it has named it twice in a row; on a resource it earns a "
    "reward that depends on how many others are there. In the cooperative scenario a crowd pays "
    "everybody more, in the competitive one it pays less, and in the mixed one half of the agents "
    "on either resource is best. What an agent says aloud all others hear: where it is and where "
    "it wants to go. Each agent learns for itself, by Q-learning, in episodes of 100 steps, and "
    "four strategies are compared: agents that always speak, that never speak (none), that learn "
    "when to speak (optional), and that do anything at random (random). The filling, how many "
    "agents are on each resource, can be seen (observed) or not (hidden). Nobody can be on a "
    "resource in the first step, so at most 99 can be earned.",
    source=chapter(3),
    symbols={
        "J": "overall return: what an agent earns in an episode, mean over the agents (eq. 3.10); "
        "J(always) is that of agents that always speak",
        "I": "inequality: how unequal the agents\u2019 returns are, as their sample standard "
        "deviation (eq. 3.11); so its unit is written \u201creturn (standard deviation)\u201d",
        "lead": "what agents that always speak have more than those that never do: "
        "J(always) - J(none), and for inequality I(none) - I(always)",
        "filling": "how many agents are on each resource, which they see (observed) or do not "
        "(hidden)",
        "displacement": "how far the agents are from an even split over the resources: the sum of "
        "the differences (eq. 3.14); 0 if even, 10 if all are on one",
        "0.9 I(a) - I(b)": "below zero: the inequality of a is not higher than that of b by more "
        "than 10% of the larger of the two; above zero: it is",
    },
    case="mixed-optional-observed",
    frame=8,
    caption="Agents (circles, numbered) on two resources (squares) or waiting below, in an episode "
    "of the mixed scenario; their colours say which resource they prefer, and the words beside "
    "them what they just said aloud.",
)
