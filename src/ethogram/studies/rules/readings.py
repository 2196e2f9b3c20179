"""The readings of the thesis' text, by name: which settings each of them changes.

The default reading, and why, stands with the settings (`worlds.traffic.world`).
"""

from ethogram.studies.readings import DEFAULT, Scalar

_LITERAL: dict[str, Scalar] = {
    "world.transition": "literal",
    "world.collision": "literal",
    "world.revive": "literal",
    "world.braking": "literal",
    "world.fine_dead": True,
}

READINGS: dict[str, dict[str, Scalar]] = {
    DEFAULT: {},
    "km_h": {"world.speed_unit": "km/h"},
    "literal_transition": {"world.transition": "literal"},
    "literal_collision": {"world.collision": "literal"},
    "no_impact": {"world.impact": False},
    "literal_revive": {"world.revive": "literal"},
    "literal_braking": {"world.braking": "literal"},
    "fine_dead": {"world.fine_dead": True},
    "joint_action": {"world.joint_action": True},
    "unscaled": {"world.scale": False},
    "grid_twoway": {"world.graph": "grid_twoway"},
    "literal": _LITERAL,
}

WORDS = {
    DEFAULT: "default",
    "km_h": "speeds in km/h: at most 50, 10 at intersections",
    "literal_transition": "the old speed decides whether a car leaves its element",
    "literal_collision": "lanes do not tell cars apart, and all next elements count",
    "no_impact": "cars that collided stand at once",
    "literal_revive": "restored cars collide again while they overlap",
    "literal_braking": "distance rule with 2 a v^2 as printed",
    "fine_dead": "the dead are fined as the living",
    "joint_action": "one choice of nine in place of two of three",
    "unscaled": "observations are not scaled",
    "grid_twoway": "two-way roads",
    "literal": "all as printed",
}


def words_of(reading: str) -> str:
    """A reading in words."""
    return WORDS.get(reading, reading.replace("_", " "))
