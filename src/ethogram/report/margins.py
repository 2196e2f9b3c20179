"""A claim's margin, effect and interval: in words, and on a small line drawn to scale."""

import math
import sys
from collections.abc import Iterator, Sequence

from markupsafe import Markup, escape

from ethogram.core.findings import Claim, ClaimPart
from ethogram.report import formatting

WIDTH, HEIGHT = 240, 46  # of a line, in its own units
EDGE = 10  # left and right of what is drawn
AXIS = 18  # y of the line
TALL, THICK, DOT = 8, 4, 4.5  # of a margin's mark, of the interval, radius of the effect
ROOM = 0.06  # of what is drawn, left and right of it


def claimed(claim: Claim | ClaimPart) -> str:
    """Where the claim puts the effect; nothing where that is not known."""
    if claim.side is None or claim.margin is None:
        return ""
    amounts = [_amount(claim, bound) for bound in formatting.margin_bounds(claim)]
    where = f"between {' and '.join(amounts)}" if claim.side == "within" else amounts[0]
    side = "" if claim.side == "within" else f"{claim.side} "
    return f"{side}{where} {claim.unit}".rstrip()


def margin_plot(claim: Claim) -> Markup:
    """The claimed side of the margin, the interval and the effect, as an SVG element of a page.

    Everything is at its place on one scale; a bound that is missing or infinite ends at the edge.
    Nothing is drawn for a claim without an effect, or of which margin or side are not known.
    """
    if claim.side is None or claim.margin is None or claim.effect is None:
        return Markup("")
    bounds = formatting.margin_bounds(claim)
    places = [*bounds, claim.effect, claim.low, claim.high]
    finite = [place for place in places if place is not None and math.isfinite(place)]
    if not math.isfinite(claim.effect) or not math.isfinite(claim.margin):
        return Markup("")
    drawn = "".join(_parts(claim, bounds, min(finite), max(finite)))
    return Markup(
        f'<svg class="margin" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(_words(claim))}">{drawn}</svg>'
    )


def _parts(claim: Claim, bounds: Sequence[float], low: float, high: float) -> Iterator[str]:
    """The SVG elements, from the back to the front."""
    wide = high - low
    if wide < sys.float_info.min:  # all is in one place, as far as numbers tell
        wide = max(abs(high), 1.0)

    def x(value: float | None, missing: float) -> float:
        shown = missing if value is None or math.isinf(value) else value
        share = (shown - low + ROOM * wide) / (wide * (1 + 2 * ROOM))
        return round(EDGE + (WIDTH - 2 * EDGE) * min(max(share, 0.0), 1.0), 2)

    left, right = low - wide, high + wide  # beyond the edges
    ends = (
        (bounds[0], bounds[-1])
        if claim.side == "within"
        else ((bounds[0], right) if claim.side in ("at least", "more than") else (left, bounds[0]))
    )
    start, end = x(ends[0], left), x(ends[1], right)
    yield (
        f'<rect class="side" x="{start}" y="{AXIS - TALL}" width="{round(end - start, 2)}" '
        f'height="{2 * TALL}"/>'
    )
    yield f'<path class="axis" d="M{EDGE} {AXIS}H{WIDTH - EDGE}"/>'
    for bound in bounds:
        at = x(bound, bound)
        yield f'<path class="bound" d="M{at} {AXIS - TALL}V{AXIS + TALL}"/>'
    for bound in dict.fromkeys((bounds[0], bounds[-1])):
        yield _label(x(bound, bound), _amount(claim, bound))
    if claim.low is not None or claim.high is not None:
        start, end = x(claim.low, left), x(claim.high, right)
        yield f'<path class="interval" stroke-width="{THICK}" d="M{start} {AXIS}H{end}"/>'
    yield f'<circle class="effect" cx="{x(claim.effect, 0)}" cy="{AXIS}" r="{DOT}"/>'


def _label(at: float, words: str) -> str:
    """The number of a margin below its mark, within the edges."""
    anchor = "start" if at < WIDTH / 4 else "end" if at > 3 * WIDTH / 4 else "middle"
    return f'<text x="{at}" y="{HEIGHT - 5}" text-anchor="{anchor}">{escape(words)}</text>'


def _words(claim: Claim) -> str:
    amount, span = formatting.effect(claim)
    return f"Claimed: {claimed(claim)}. Effect: {amount} {span}".rstrip() + "."


def _amount(claim: Claim | ClaimPart, bound: float) -> str:
    decimals = formatting.claim_decimals(claim).margin
    return formatting.number(bound, decimals) if bound else "0"
