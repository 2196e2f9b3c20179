"""What the chapter's numbers are held against.

Source of the published ones: J. Talamini's doctoral thesis, chapter 2.
"""

# Table 2.2: R_val of learned policies, by n_r, n_t and e: mean, and a standard deviation of which
# the thesis does not say across what it was taken.
VALIDATION_REWARD: dict[tuple[int, int, float], tuple[float, float]] = {
    (2, 2, 0.25): (-37.84, 0.10),
    (2, 2, 1.0): (-13.80, 0.02),
    (2, 2, 3.0): (-13.03, 0.02),
    (2, 3, 0.25): (-40.89, 0.12),
    (2, 3, 1.0): (-15.48, 0.03),
    (2, 3, 3.0): (-14.78, 0.03),
    (2, 4, 0.25): (-28.80, 0.03),
    (2, 4, 1.0): (-16.02, 0.02),
    (2, 4, 3.0): (-15.47, 0.02),
    (3, 2, 0.25): (-53.87, 0.17),
    (3, 2, 1.0): (-24.92, 0.08),
    (3, 2, 3.0): (-26.84, 0.04),
    (3, 3, 0.25): (-36.75, 0.12),
    (3, 3, 1.0): (-30.32, 0.05),
    (3, 3, 3.0): (-32.48, 0.23),
    (3, 4, 0.25): (-47.66, 0.10),
    (3, 4, 1.0): (-41.72, 0.10),
    (3, 4, 3.0): (-45.34, 0.15),
    (4, 2, 0.25): (-51.85, 0.08),
    (4, 2, 1.0): (-47.31, 0.12),
    (4, 2, 3.0): (-53.56, 0.12),
    (4, 3, 0.25): (-65.58, 0.08),
    (4, 3, 1.0): (-63.20, 0.08),
    (4, 3, 3.0): (-72.10, 0.20),
    (4, 4, 0.25): (-74.47, 0.39),
    (4, 4, 1.0): (-82.20, 0.20),
    (4, 4, 3.0): (-88.40, 0.09),
}

# Table 2.3: thousands of episodes to 95% of the final learning reward, by n_r and n_t: without
# communication, with the optimal one, and learned at e = 0.25, 1, 3.
THOUSAND_EPISODES: dict[tuple[int, int], tuple[int, int, int, int, int]] = {
    (2, 2): (2, 3, 2, 3, 4),
    (2, 3): (3, 3, 16, 6, 8),
    (2, 4): (3, 5, 13, 6, 8),
    (3, 2): (2, 3, 6, 6, 6),
    (3, 3): (3, 4, 12, 9, 9),
    (3, 4): (3, 8, 11, 13, 15),
    (4, 2): (3, 3, 5, 10, 9),
    (4, 3): (3, 10, 10, 9, 13),
    (4, 4): (3, 14, 12, 16, 3),
}

# Not the thesis': R_val of our hand-made reference controllers, per robot (both of its agents),
# by n_t.  Means of 20 000 episodes; standard errors 0.012 (informed) and 0.035 (uninformed).
REFERENCE_REWARD: dict[str, dict[int, float]] = {
    "informed": {2: -6.586, 3: -6.648, 4: -6.698},
    "uninformed": {2: -18.616, 3: -19.184, 4: -21.496},
}
