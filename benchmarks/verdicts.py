"""How often verdicts are wrong, how often intervals cover, and what can still be decided.

    python benchmarks/verdicts.py [--studies 1000] [--seed 0] [--json FILE]

Everything goes through `ethogram.studies.statistics` as a study's claims do; only the table of
candidates computes tests of its own.  Trials are drawn from `SHAPES`, moved to have the mean that a
truth asks for; "correlated" shapes share half of their (latent) variance between the conditions, as
trials with common random numbers do.

Family error: the share of studies with one wrong verdict or more, where every truth lies at its
margin, the worst place.  A study has six claims with ten parts: one mean above and one below its
margin (false), three means "at least" and three "at most" (true), a difference of equal spreads
"more than" (false) and one of spreads as 1 to 3, "at most" (true).

Power: the share of those six claims decided as they should be when every truth lies some standard
deviations of a trial on one side of its margin.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from ethogram.studies.statistics import (
    ClaimSpec,
    Part,
    Support,
    Terms,
    Trials,
    interval_of_mean,
    judge,
)
from ethogram.studies.statistics.effects import estimate

SIZES = (5, 6, 8, 20)  # trials
EFFECTS = (1.0, 2.0, 5.0, 10.0)  # distances from the margin in the table of power
SHARED = 0.5  # of the variance of correlated conditions
PARTS = 8  # of a claim whose interval is looked at
COMMON, RARE = 99.0, 50.0  # what a trial earns nearly always, and else
CHANCE = 0.05  # of the rare outcome
Draw = np.ndarray


class Shape(NamedTuple):
    """A distribution by its quantile function of a standard normal number; mean and deviation."""

    of: Callable[[Draw], Draw]
    mean: float
    deviation: float
    support: Support = Support()
    shared: float = 0.0


def lognormal(sigma: float, shared: float = 0.0) -> Shape:
    """Exponential of a normal number: skewness 1.75 for sigma 0.5, 6.2 for sigma 1."""
    mean = math.exp(sigma**2 / 2)
    return Shape(
        lambda z: np.exp(sigma * z), mean, mean * math.sqrt(math.expm1(sigma**2)), shared=shared
    )


SHAPES = {
    "normal": Shape(lambda z: z, 0.0, 1.0),
    "lognormal, sigma 0.5": lognormal(0.5),
    "lognormal, sigma 1": lognormal(1.0),
    "bounded, skewed": Shape(  # the fourth power of a uniform number
        lambda z: norm.cdf(z) ** 4, 1 / 5, math.sqrt(1 / 9 - 1 / 25), Support(low=0.0, high=1.0)
    ),
    "bounded, 99 or rarely 50": Shape(
        lambda z: np.where(norm.cdf(z) < CHANCE, RARE, COMMON),
        COMMON - CHANCE * (COMMON - RARE),
        (COMMON - RARE) * math.sqrt(CHANCE * (1 - CHANCE)),
        Support(low=0.0, high=COMMON),
    ),
    "normal, correlated": Shape(lambda z: z, 0.0, 1.0, shared=SHARED),
    "lognormal, sigma 0.5, correlated": lognormal(0.5, SHARED),
    "lognormal, sigma 1, correlated": lognormal(1.0, SHARED),
}


def conditions(rng: np.random.Generator, shape: Shape, size: int) -> Iterator[Trials]:
    """Conditions with one and the same distribution, one after the other."""
    common = rng.standard_normal(size)
    while True:
        own = rng.standard_normal(size)
        latent = math.sqrt(shape.shared) * common + math.sqrt(1 - shape.shared) * own
        yield Trials("trials", shape.of(latent), shape.support)


def study(rng: np.random.Generator, shape: Shape, size: int, off: float) -> list[ClaimSpec]:
    """Six claims whose truths lie `off` above their margins, in deviations of a trial."""
    draw = conditions(rng, shape, size)
    low = shape.mean - off * shape.deviation
    high = shape.mean + off * shape.deviation

    def mean(side: Any, margin: float) -> Part:
        return part(((1.0, next(draw)),), side, margin)

    def contrast(weight: float, side: Any, sign: float) -> Part:
        terms = ((1.0, next(draw)), (-weight, next(draw)))
        truth = (1.0 - weight) * shape.mean
        return part(terms, side, truth + sign * off * shape.deviation * math.hypot(1.0, weight))

    return [
        claim(1, mean("more than", low)),
        claim(2, mean("less than", high)),
        claim(3, *(mean("at least", low) for _ in range(3))),
        claim(4, *(mean("at most", high) for _ in range(3))),
        claim(5, contrast(1.0, "more than", -1.0)),
        claim(6, contrast(1 / 3, "at most", 1.0)),
    ]


WRONG = ("confirmed", "confirmed", "refuted", "refuted", "confirmed", "refuted")


def part(terms: Terms, side: Any, margin: float) -> Part:
    """A part with nothing but its numbers."""
    return Part(label="", terms=terms, side=side, margin=margin, unit="")


def claim(number: int, *parts: Part) -> ClaimSpec:
    """A claim with nothing but its parts."""
    return ClaimSpec(number=number, statement="", source="", test="", parts=parts)


def family_error(shape: str, size: int, studies: int, seed: int) -> float:
    """Share of studies with a wrong verdict, every truth at its margin."""
    rng = np.random.default_rng([seed, size, list(SHAPES).index(shape)])
    wrong = 0
    for _ in range(studies):
        found = judge(study(rng, SHAPES[shape], size, 0.0))
        wrong += any(one.verdict == error for one, error in zip(found, WRONG, strict=True))
    return wrong / studies


def power(shape: str, size: int, off: float, studies: int, seed: int) -> float:
    """Share of true claims that are confirmed, the truth being that far from its margin."""
    rng = np.random.default_rng([seed, size, list(SHAPES).index(shape), round(10 * off)])
    right = [
        one.verdict == "confirmed"
        for _ in range(studies)
        for one in judge(study(rng, SHAPES[shape], size, off))
    ]
    return float(np.mean(right))


def unseen(size: int, studies: int, seed: int) -> tuple[float, float]:
    """Of trials that earn 99, rarely 50 (mean 96.55): how often "more than 97.02" is confirmed.

    And how often, of trials that cost 0, rarely 49, the true "at least 1.98" is refuted.
    """
    rng, wrong = np.random.default_rng([seed, size]), np.zeros(2)
    for _ in range(studies):
        rare = rng.random(size) < CHANCE
        earned = Trials("", np.where(rare, RARE, COMMON), Support(low=0.0, high=COMMON))
        paid = Trials("", np.where(rare, COMMON - RARE, 0.0), Support(low=0.0, high=COMMON))
        (one,) = judge([claim(1, part(((1.0, earned),), "more than", 97.02))])
        (other,) = judge([claim(1, part(((1.0, paid),), "at least", 1.98))])
        wrong += one.verdict == "confirmed", other.verdict == "refuted"
    low, high = (wrong / studies).tolist()
    return low, high


def interval_coverage(shape: str, size: int, studies: int, seed: int) -> dict[str, float]:
    """How often 95% intervals of a mean hold it, ours beside t and a bootstrap of percentiles."""
    rng = np.random.default_rng([seed, size, list(SHAPES).index(shape)])
    one = SHAPES[shape]
    samples = one.of(rng.standard_normal((size, studies)))
    mean, error = samples.mean(0), samples.std(0, ddof=1) / math.sqrt(size)
    reach = student.isf(0.025, size - 1) * error
    picks = rng.integers(size, size=(1000, size))
    replicas = np.stack([samples[pick].mean(0) for pick in picks])
    found = {
        "ours": interval_of_mean(samples),
        "Student's t": (mean - reach, mean + reach),
        "percentiles": tuple(np.quantile(replicas, [0.025, 0.975], axis=0)),
    }
    return {
        name: float(np.mean((low <= one.mean) & (one.mean <= high)))
        for name, (low, high) in found.items()
    }


def claim_coverage(shape: str, size: int, studies: int, seed: int) -> float:
    """How often the interval of a confirmed claim holds the truth of the part that it rests on.

    Of `PARTS` parts with effects of 20 to 22 deviations, at the level of a study of one claim.
    """
    rng = np.random.default_rng([seed, size, list(SHAPES).index(shape)])
    one, held, confirmed = SHAPES[shape], 0, 0
    for _ in range(studies):
        draw = conditions(rng, one, size)
        parts = []
        for number in range(PARTS):
            margin = one.mean - (20 + 2 * number / PARTS) * one.deviation
            parts.append(part(((1.0, next(draw)),), "more than", margin))
        (found,) = judge([claim(1, *parts)])
        if found.verdict == "confirmed":
            confirmed += 1
            held += found.low <= one.mean <= found.high
    return held / confirmed if confirmed else math.nan


def candidates(size: int, shape: str, alphas: tuple[float, ...], draws: int, seed: int) -> Any:
    """Error of one-sided tests of a mean, over the error that they promise."""
    rng = np.random.default_rng([seed, size, list(SHAPES).index(shape)])
    one = SHAPES[shape]
    values = one.of(rng.standard_normal((draws, size))) - one.mean
    centre = values.mean(1)
    away = values - centre[:, None]
    second, third = (away**2).mean(1), (away**3).mean(1)
    t = centre / np.sqrt(second / (size - 1))
    b = np.where(second > 0, third / second**1.5, 0.0) / math.sqrt(size)
    statistics = {
        "Student's t": t,
        "Johnson's t": t + b * t**2 / 3 + b / 6,
        "Hall's t": t + b * t**2 / 3 + b**2 * t**3 / 27 + b / 6,
    }
    found = {
        name: [np.mean(student.cdf(value, size - 1) < alpha) / alpha for alpha in alphas]
        for name, value in statistics.items()
    }
    few = values[: draws // 20]
    p_values = [estimate(((1.0, Trials("", each, Support())),)).below(0.0) for each in few]
    found["this"] = [np.mean(np.array(p_values) < alpha) / alpha for alpha in alphas]
    return found


def run(studies: int, seed: int) -> dict[str, Any]:
    """All tables, as plain numbers."""
    alphas = (0.025, 0.005, 0.001)
    own = [name for name in SHAPES if not SHAPES[name].shared]
    smooth = [name for name in own if "rarely" not in name]
    few = max(50, studies // 10)
    tables: dict[str, Callable[[str, int], Any]] = {
        "family error": lambda shape, size: family_error(shape, size, studies, seed),
        "power": lambda shape, size: [power(shape, size, off, few, seed) for off in EFFECTS],
        "intervals of a mean": lambda shape, size: interval_coverage(shape, size, 2000, seed),
        "intervals of a claim": lambda shape, size: claim_coverage(shape, size, studies, seed),
        "candidates": lambda shape, size: candidates(size, shape, alphas, 40_000, seed),
    }
    shapes = {"family error": list(SHAPES), "candidates": smooth, "power": smooth}
    found: dict[str, Any] = {}
    for name, table in tables.items():
        start = time.perf_counter()
        rows = {
            shape: {size: table(shape, size) for size in SIZES}
            for shape in shapes.get(name, smooth)
        }
        found[name] = {"rows": rows, "seconds": time.perf_counter() - start}
        print(f"{name}: {found[name]['seconds']:.0f} s", flush=True)
        for shape, row in rows.items():
            print(f"  {shape:34}", *(f"{size}: {_short(value)}" for size, value in row.items()))
    start = time.perf_counter()
    found["unseen"] = {size: unseen(size, studies, seed) for size in SIZES}
    print(f"unseen: {time.perf_counter() - start:.0f} s", found["unseen"], flush=True)
    return found


def _short(value: Any) -> str:
    if isinstance(value, dict):
        return " ".join(f"{name} {_short(each)}" for name, each in value.items())
    if isinstance(value, list):
        return "/".join(_short(each) for each in value)
    return f"{value:.3f}"


def main() -> None:
    """Print all tables, and keep them where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--studies", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    start = time.perf_counter()
    found = run(given.studies, given.seed)
    seconds = time.perf_counter() - start
    plan = {"studies": given.studies, "seed": given.seed, "date": str(date.today())}
    print(f"{given.studies} studies each, seed {given.seed}, {date.today()}, {seconds:.0f} s")
    if given.json:
        given.json.write_text(json.dumps({**plan, "seconds": seconds, **found}, indent=2))


if __name__ == "__main__":
    main()
