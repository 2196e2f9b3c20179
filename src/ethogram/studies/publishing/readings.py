"""Other readings of the thesis' text, by name: which settings each of them changes.

The claims are tested under each of them as well, those about static policies under `READINGS`, and
those about what is learned under `OF_LEARNED`: the robustness table.  The default reading, and why,
stands with the settings (`worlds.publishing.world`).
"""

from ethogram.studies.readings import DEFAULT, Scalar

_LITERAL: dict[str, Scalar] = {
    "world.if_timing": "running",
    "world.undefined_if": 0.0,
    "world.quality_scale": "none",
    "world.init_assignment": "online",
    "world.update": "sequential",
    "bin_rule": "literal_clamped",
    "bin_remainder": "drop",
}

READINGS: dict[str, dict[str, Scalar]] = {
    DEFAULT: {},
    "undefined_if_zero": {"world.undefined_if": 0.0},
    "running_if": {"world.if_timing": "running"},
    "literal_bins": {"bin_rule": "literal_clamped"},
    "bins_dropped": {"bin_remainder": "drop"},
    "rejects_10": {"minded_max_rejections": 10},
    "unscaled_quality": {"world.quality_scale": "none"},
    "truncated_quality": {"world.quality_bounds": "truncated"},
    "online_journals": {"world.init_assignment": "online"},
    "random_journals": {"world.init_assignment": "random"},
    "all_sources": {"world.init_sources": "all"},
    "sequential": {"world.update": "sequential"},
    "if_intersection": {"world.if_window": "intersection"},
    "literal_bins_zero": {"bin_rule": "literal_clamped", "world.undefined_if": 0.0},
    "literal_but_union": _LITERAL,
    "literal": {**_LITERAL, "world.if_window": "intersection"},
}

OF_LEARNED: dict[str, dict[str, Scalar]] = {
    "reward_level": {"reward": "level"},
    "table_own": {"table": "own"},
}

WORDS = {
    DEFAULT: "default",
    "undefined_if_zero": "impact factor without papers is 0",
    "running_if": "impact factor of the running year",
    "literal_bins": "minded authors' bin as printed, min(1, ...)",
    "bins_dropped": "what bins cannot divide is dropped (here all is divided)",
    "rejects_10": "minded authors write anew after 10 rejections",
    "unscaled_quality": "initial qualities and authors' from 1 to 5",
    "truncated_quality": "papers' qualities truncated, not clipped",
    "online_journals": "initial journals assigned as papers are drawn",
    "random_journals": "initial journals at random",
    "all_sources": "initial impact factors as of all sources",
    "sequential": "authors act one after the other",
    "if_intersection": "impact factor of the intersection, as printed",
    "literal_bins_zero": "bin as printed, and impact factor without papers is 0",
    "literal_but_union": "all as printed, but the union of two years",
    "literal": "all as printed",
    "reward_level": "rewards of those who learn are the indices, not their changes",
    "table_own": "each who learns has a table of its own",
}

KNOWN = READINGS | OF_LEARNED


def words_of(reading: str) -> str:
    """A reading in words."""
    return WORDS.get(reading, reading.replace("_", " "))
