"""Numbers that the thesis prints: scores (f_adapt) and fitness (tables 6.2 and 6.3).

Bodies that were drawn or evolved there are not those of here: only means can be compared.
"""

SCORES: dict[str, tuple[float, ...]] = {  # by condition, in the order of the bodies
    "hand_made": (0.17, 0.21, 0.26, 0.28),
    "psrnd": (0.27, 0.26, 0.19, 0.22, 0.25, 0.28, 0.26, 0.13, 0.29, 0.45),
    "rnd": (0.28, 0.34, 0.35, 0.30, 0.35, 0.34, 0.38, 0.26, 0.34, 0.31),
    "evolved": (0.78, 0.78, 0.77, 0.79, 0.77, 0.78, 0.76, 0.77, 0.77, 0.75),
}

PENALISED: dict[str, dict[str, float]] = {  # table 6.2, in thousandths
    "box": {"locomotion": 4.41, "jump": 2.50, "escape": 0.04},
    "worm": {"locomotion": 6.31, "jump": 2.40, "escape": 0.04},
    "biped": {"locomotion": 5.96, "jump": 2.85, "escape": 0.08},
    "revT": {"locomotion": 4.44, "jump": 2.23, "escape": 0.34},
}


def mean_score(bodies: str) -> float | None:
    """The mean over the bodies of a condition, if the thesis prints them."""
    scores = SCORES.get(bodies)
    return None if scores is None else sum(scores) / len(scores)
