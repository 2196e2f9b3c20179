"""What the study's page opens with."""

from ethogram.core.introduction import Introduction
from ethogram.studies.thesis import chapter

INTRODUCTION = Introduction(
    text="Forty cars drive on a grid of one-way roads with crossings. Each has a driver, who sees "
    "the nearest cars ahead, accelerates, brakes and changes lanes, and earns its speed. With "
    "rules a driver is fined for being fast at an intersection, for keeping less distance "
    "than it needs to stop, and for leaving the right lane while that is free; no action is "
    "forbidden. Cars that come too close to each other collide: they stand for 20 steps, "
    "obstacles to all, and are then restored, or removed. All drivers share one policy, which "
    "they learn by proximal policy optimisation (PPO) in 500 episodes of 500 steps of 0.2 s. "
    "What they have learned is then watched in traffic of 10 to 80 cars, among drivers of "
    "other kinds, and before a stopped car.",
    source=chapter(4),
    symbols={
        "R": "what a driver earns in an episode, mean over drivers (eq. 4.15)",
        "E": "efficiency: a car\u2019s speed, summed over the steps of an episode, mean over cars "
        "(eq. 4.16); times the 0.2 s of a step it is the distance driven",
        "sd of E": "standard deviation of E among the cars of an episode",
        "C": "collisions of a car in an episode, mean over cars (eq. 4.17)",
        "0.9 C(a) - C(b)": "above zero: C of b is lower than that of a by more than 10%",
        "restored, removed": "what becomes of cars that collided, after they were dead for 4 s",
    },
    case="no-rules-restored",
    frame=60,
    caption="Cars on the roads of the grid, of drivers trained without rules. Boxes drive, arrows "
    "would be fined, crosses are dead, and a ring marks a collision.",
)
