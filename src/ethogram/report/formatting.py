"""Numbers, intervals and durations as a careful author writes them."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Any, NamedTuple

from ethogram.core.findings import Claim, ClaimPart, Revision

ALL_CLAIMS = "all claims"
MINUS = "\N{MINUS SIGN}"
THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"
TIMES = "\N{MULTIPLICATION SIGN}"

MOST_DECIMALS = 6
MORE_DECIMALS = 3  # at most, where an interval ends next to the margin
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


class ClaimDecimals(NamedTuple):
    """How many decimals are shown of a claim's numbers."""

    effect: int
    interval: int
    margin: int


def effect(claim: Claim | ClaimPart) -> tuple[str, str]:
    """A claim's effect with its unit, and its interval, to the digits that the interval bears."""
    if claim.effect is None:
        return "", ""
    decimals = claim_decimals(claim)
    amount = f"{number(claim.effect, decimals.effect)} {claim.unit}".rstrip()
    return amount, interval(claim.low, claim.high, decimals.interval)


def claim_decimals(claim: Claim | ClaimPart) -> ClaimDecimals:
    """As many as the interval bears, and a few more where it ends next to the margin.

    An end of the interval is to be read on the side of the margin where it is: the verdict rests on
    that.  An effect far smaller than its interval still shows its first digit: it is not zero.
    """
    value = claim.effect or 0.0
    decimals = borne = decimals_for([value])
    if claim.low is not None and claim.high is not None:
        width = claim.high - claim.low
        if 0 < width < math.inf:
            borne = decimals_for([width], digits=2)
            decimals = max(borne, decimals_for([value], digits=1))
    bounds = margin_bounds(claim)
    plain = ClaimDecimals(decimals, borne, decimals_for(bounds, digits=2))
    ends = [end for end in (claim.low, claim.high) if end is not None and math.isfinite(end)]
    shown = plain
    for more in range(1, MORE_DECIMALS + 2):
        if all(_reads_as_it_is(end, bound, shown) for end in ends for bound in bounds):
            return shown
        of_effect, of_ends = (min(MOST_DECIMALS, each + more) for each in (decimals, borne))
        shown = ClaimDecimals(of_effect, of_ends, max(plain.margin, of_ends))
    return plain


def _reads_as_it_is(end: float, bound: float, shown: ClaimDecimals) -> bool:
    """Whether rounded numbers are in the order of the exact ones."""
    one, other = round(end, shown.interval), round(bound, shown.margin)
    return (one < other, one > other) == (end < bound, end > bound)


def margin_bounds(claim: Claim | ClaimPart) -> tuple[float, ...]:
    """Where the margin is: a claim to be within it has two."""
    if claim.margin is None:
        return ()
    return (-claim.margin, claim.margin) if claim.side == "within" else (claim.margin,)


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


def shared_revisions(claims: Sequence[Claim]) -> dict[Revision, str]:
    """Changes that several claims have in common, which are said once, and which claims these are.

    Those of all claims come first.
    """
    found: dict[Revision, list[int]] = {}
    for claim in claims:
        for change in claim.history:
            found.setdefault(change, []).append(claim.number)
    shared = [(change, numbers) for change, numbers in found.items() if len(numbers) > 1]
    shared.sort(key=lambda each: len(each[1]) < len(claims))
    return {
        change: ALL_CLAIMS if len(numbers) == len(claims) else _numbers(numbers).lower()
        for change, numbers in shared
    }


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
