"""What the thesis prints in chapter 3.

Source: J. Talamini's doctoral thesis, Table 3.2, "Max validation return": the maximum over
trials, validation episodes and agents of the individual return over 100 steps.
"""

from ethogram.studies.sharing.plan import Condition

MAX_VALIDATION_RETURN = {
    Condition("cooperative", "always", False): 99.0,
    Condition("cooperative", "always", True): 99.0,
    Condition("cooperative", "none", False): 79.3,
    Condition("cooperative", "none", True): 99.0,
    Condition("cooperative", "optional", False): 98.8,
    Condition("cooperative", "optional", True): 99.0,
    Condition("mixed", "always", False): 99.0,
    Condition("mixed", "always", True): 99.0,
    Condition("mixed", "none", False): 89.0,
    Condition("mixed", "none", True): 99.0,
    Condition("mixed", "optional", False): 93.6,
    Condition("mixed", "optional", True): 95.0,
    Condition("competitive", "always", False): 25.4,
    Condition("competitive", "always", True): 21.6,
    Condition("competitive", "none", False): 69.4,
    Condition("competitive", "none", True): 21.4,
    Condition("competitive", "optional", False): 49.8,
    Condition("competitive", "optional", True): 59.4,
}
