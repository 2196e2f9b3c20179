"""Numbers, intervals and durations as a careful author writes them."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any

from ethogram.core.findings import Claim, Revision

MINUS = "\N{MINUS SIGN}"
THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"
TIMES = "\N{MULTIPLICATION SIGN}"

MOST_DECIMALS = 6
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def decimals_for(values: Iterable[float], *, digits: int = 3) -> int:
    """The decimals that give a typical one of `values` this many significant digits."""
    sizes = sorted(abs(value) for value in values if value and math.isfinite(value))
    if not sizes:
        return 0
    typical = sizes[len(sizes) // 2]
    return min(MOST_DECIMALS, max(0, digits - 1 - math.floor(math.log10(typical))))


def decimals_printed(value: float) -> int:
    """The decimals that a published number was printed with, as far as its float still tells."""
    exponent = Decimal(repr(value)).as_tuple().exponent
    return min(MOST_DECIMALS, max(0, -exponent)) if isinstance(exponent, int) else 0


def number(value: float, decimals: int, *, signed: bool = False) -> str:
    """The value rounded to `decimals`; powers of ten where these would say nothing."""
    if math.isnan(value):
        return "undefined"
    if math.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    vanishes = value and decimals == MOST_DECIMALS and not round(value, decimals)
    if vanishes or abs(value) >= 1e9:
        mantissa, exponent = f"{value:.2e}".split("e")
        power = str(int(exponent)).translate(_SUPERSCRIPT)
        return f"{mantissa} {TIMES} 10{power}".replace("-", MINUS)
    rounded = round(value, decimals) or 0.0  # no minus before a zero
    text = f"{rounded:{'+' if signed and rounded else ''},.{decimals}f}"
    return text.replace(",", THIN_SPACE if abs(rounded) >= 10_000 else "").replace("-", MINUS)


def interval(low: float | None, high: float | None, decimals: int) -> str:
    """The interval in brackets, open where a bound is missing; nothing where both are."""
    if low is None and high is None:
        return ""
    below = f"{MINUS}∞" if low is None else number(low, decimals)
    above = "∞" if high is None else number(high, decimals)
    return f"[{below}, {above}]"


def effect(claim: Claim) -> tuple[str, str]:
    """A claim's effect with its unit, and its interval, to the digits that the interval bears.

    An effect far smaller than its interval still shows its first digit: it is not zero.
    """
    if claim.effect is None:
        return "", ""
    decimals = borne = decimals_for([claim.effect])
    if claim.low is not None and claim.high is not None:
        width = claim.high - claim.low
        if 0 < width < math.inf:
            borne = decimals_for([width], digits=2)
            decimals = max(borne, decimals_for([claim.effect], digits=1))
    amount = f"{number(claim.effect, decimals)} {claim.unit}".rstrip()
    return amount, interval(claim.low, claim.high, borne)


def stated(claims: Sequence[Claim], date: str) -> str:
    """When the claims of a run of that date were stated, as far as they say it themselves."""
    undated = [claim.number for claim in claims if not claim.stated]
    late = [claim.number for claim in claims if claim.stated > date]
    changed = [claim.number for claim in claims if claim.history]
    sentences = []
    if not undated and not late:
        first = "first " if changed else ""
        sentences.append(f"Each was {first}stated before the run, with its test and margin.")
    else:
        sentences.append("Each has its test and margin.")
    if late:
        sentences.append(f"{_claims(late)} stated after the run.")
    if undated and len(undated) < len(claims):
        sentences.append(f"It is not recorded when {_claims(undated).lower()} stated.")
    elif undated:
        sentences.append("It is not recorded when they were stated.")
    if len(changed) == len(claims) > 1:
        sentences.append("The tests of all have changed since, as is said below.")
    elif changed:
        was = "its test has" if len(changed) == 1 else "their tests have"
        sentences.append(f"{_numbers(changed)}: {was} changed since, as is said there.")
    return " ".join(sentences)


def shared_history(claims: Sequence[Claim]) -> tuple[Revision, ...]:
    """The changes that all claims have in common, where there are several: said once for all."""
    if len(claims) < 2:
        return ()
    first, *others = (claim.history for claim in claims)
    return tuple(one for one in first if all(one in history for history in others))


def note(claim: Claim) -> str:
    """A claim's note, without the comparison that decided where that is told apart."""
    told = f"rests on: {claim.compared}"
    return "; ".join(part for part in claim.note.split("; ") if part != told)


def _claims(numbers: Sequence[int]) -> str:
    return f"{_numbers(numbers)} {'was' if len(numbers) == 1 else 'were'}"


def _numbers(numbers: Sequence[int]) -> str:
    """Claims by their numbers: "Claim 1", "Claims 1, 2 and 6"."""
    *first, last = map(str, numbers)
    return f"Claims {', '.join(first)} and {last}" if first else f"Claim {last}"


def p_value(value: float | None) -> str:
    """To three decimals, never as zero."""
    if value is None:
        return ""
    return "< 0.001" if value < 0.001 else f"= {number(value, 3)}"


def duration(seconds: float) -> str:
    """In the two largest units that matter."""
    whole = round(seconds)
    if whole < 60:
        return f"{number(seconds, 1 if 0 < seconds < 10 else 0)} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min"


def dotted(settings: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Nested settings as the dotted keys of `--set`, each with its value."""
    for key, value in settings.items():
        if isinstance(value, Mapping) and value:
            yield from dotted(value, f"{prefix}{key}.")
        else:
            text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            yield f"{prefix}{key}", text
