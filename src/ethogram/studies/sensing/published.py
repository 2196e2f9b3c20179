"""What the thesis prints in chapter 5.

Source: J. Talamini's doctoral thesis, tables 5.1 to 5.3.  It does not say by which
function its network's outputs come to lie between -1 and 1, so its numbers stand beside every law.
"""

# Table 5.2, even surface: fitness in mm by morphology and controller, mean and standard deviation
# over 30 runs.  The text gives the tripod's non-sensing deviation as 263.
EVEN_FITNESS: dict[tuple[str, str], tuple[float, float]] = {
    ("worm", "non-sensing"): (146, 8),
    ("worm", "sensing"): (3012, 329),
    ("biped", "non-sensing"): (69, 19),
    ("biped", "sensing"): (931, 74),
    ("tripod", "non-sensing"): (550, 26),
    ("tripod", "sensing"): (636, 76),
}

# Table 5.2: p of the Mann-Whitney U test, by morphology.  Between 30 runs and 30 others that do
# not overlap it is 3e-11; the worm's 2e-6 is what Wilcoxon's signed-rank test gives for 30 pairs.
EVEN_P: dict[str, float] = {"worm": 2e-6, "biped": 6e-6, "tripod": 2.4e-5}

# Table 5.3, uneven surface: distance in mm by scenario, morphology and controller, mean and
# standard deviation over 30 runs; "fitness" is the scenario of evolution.
UNEVEN_DISTANCE: dict[tuple[str, str, str], tuple[float, float]] = {
    ("fitness", "worm", "non-sensing"): (120, 8),
    ("fitness", "worm", "sensing"): (3050, 358),
    ("fitness", "biped", "non-sensing"): (78, 19),
    ("fitness", "biped", "sensing"): (873, 180),
    ("fitness", "tripod", "non-sensing"): (556, 60),
    ("fitness", "tripod", "sensing"): (620, 378),
    ("flat", "worm", "non-sensing"): (138, 5),
    ("flat", "worm", "sensing"): (3132, 498),
    ("flat", "biped", "non-sensing"): (73, 30),
    ("flat", "biped", "sensing"): (2228, 187),
    ("flat", "tripod", "non-sensing"): (528, 43),
    ("flat", "tripod", "sensing"): (727, 100),
    ("step", "worm", "non-sensing"): (111, 56),
    ("step", "worm", "sensing"): (3543, 412),
    ("step", "biped", "non-sensing"): (69, 20),
    ("step", "biped", "sensing"): (1010, 226),
    ("step", "tripod", "non-sensing"): (539, 160),
    ("step", "tripod", "sensing"): (870, 213),
    ("sin", "worm", "non-sensing"): (104, 7),
    ("sin", "worm", "sensing"): (3194, 281),
    ("sin", "biped", "non-sensing"): (77, 17),
    ("sin", "biped", "sensing"): (446, 151),
    ("sin", "tripod", "non-sensing"): (505, 48),
    ("sin", "tripod", "sensing"): (512, 175),
}

# Table 5.3: rho, the distance in a validation scenario over the fitness.
UNEVEN_RATIO: dict[tuple[str, str, str], float] = {
    ("flat", "worm", "non-sensing"): 1.15,
    ("flat", "worm", "sensing"): 1.02,
    ("flat", "biped", "non-sensing"): 0.93,
    ("flat", "biped", "sensing"): 2.55,
    ("flat", "tripod", "non-sensing"): 0.95,
    ("flat", "tripod", "sensing"): 1.17,
    ("step", "worm", "non-sensing"): 0.92,
    ("step", "worm", "sensing"): 1.16,
    ("step", "biped", "non-sensing"): 0.88,
    ("step", "biped", "sensing"): 1.15,
    ("step", "tripod", "non-sensing"): 0.96,
    ("step", "tripod", "sensing"): 1.4,
    ("sin", "worm", "non-sensing"): 0.86,
    ("sin", "worm", "sensing"): 1.04,
    ("sin", "biped", "non-sensing"): 0.99,
    ("sin", "biped", "sensing"): 0.51,
    ("sin", "tripod", "non-sensing"): 0.91,
    ("sin", "tripod", "sensing"): 0.82,
}

# Table 5.1: symbol, what it is, the value as printed, and how it is read here by default.
PARAMETERS: tuple[tuple[str, str, str, str], ...] = (
    (
        "Δt",
        "step of time",
        "0.14 ms",
        "0.1424 ms: a fifth of 1 / ω of the stiffest spring, as in the simulator",
    ),
    ("a", "amplitude", "0.001 m³", "1 mm of a voxel's edge: a tenth of it, linear"),
    ("f", "frequency", "40 Hz", "as printed; also the signal that sensing networks are fed"),
    ("s⁰", "resting scale", "0.01 m³", "an edge of 10 mm"),
    ("Δs", "range of scales", "0.001 m³", "1 mm of a voxel's edge"),
    ("n_pop", "individuals", "30", "as printed; a generation adds 30 mutants and a newcomer"),
    ("n_gen", "generations", "200", "as printed, after the first population"),
    ("p_mut", "mutation probability", "1 / |θ|", "per parameter"),
    (
        "σ_mut",  # noqa: RUF001
        "deviation of a mutation",
        "1",
        "of sizes that are scaled to [-1, 1] and limited to it, phases in radians, weights",
    ),
    ("n_sim", "steps of a simulation", "10 000", "as printed, with no time to settle"),
)
