"""What commands print: tables as wide as the terminal, and JSON."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ethogram.cli.streams import say

_ANY_WIDTH = 100_000  # columns

if TYPE_CHECKING:
    from ethogram.campaign.launch import Prospect
    from ethogram.core.findings import Claim
    from ethogram.report import Comparison


def show_prospects(prospects: "Sequence[Prospect]", to_do: "Sequence[Prospect]", crew: int) -> None:
    """List the cases of a plan, and what those that a run would compute take together."""
    from ethogram.campaign.display import readable_seconds
    from ethogram.core.memory import available_memory, readable_bytes

    console = Console()
    table = Table("case", "state", "time", "memory", box=None)
    for prospect in prospects:
        table.add_row(
            prospect.case.name,
            "to do" if prospect in to_do else prospect.state,
            readable_seconds(prospect.cost.seconds),
            readable_bytes(prospect.cost.bytes),
        )
    unbounded = console.options.update(width=_ANY_WIDTH)
    if console.measure(table, options=unbounded).maximum <= console.width:
        console.print(table)
    else:  # names stay whole, to be searched for and copied
        for column in zip(*(column.cells for column in table.columns), strict=True):
            print("{}: {}, {}, {}".format(*column))
    seconds = sum(prospect.cost.seconds for prospect in to_do) / crew
    peak = sum(sorted(prospect.cost.bytes for prospect in to_do)[-crew:])
    print(
        f"{len(to_do)} of {len(prospects)} cases to do, {crew} at a time: about "
        f"{readable_seconds(seconds)} and {readable_bytes(peak)} of memory."
    )
    free = available_memory()
    too_large = [prospect.case.name for prospect in to_do if prospect.cost.bytes > free]
    if too_large:
        say(
            f"{len(too_large)} need more than the {readable_bytes(free)} that are free: "
            "they would fail."
        )


def show_comparison(found: "Comparison") -> None:
    """Print what differs between two runs, each line as wide as the terminal at most."""
    console = Console()
    for study in found.studies:
        settings = Table("setting that differs", "A", "B", box=None)
        for setting in study.settings:
            settings.add_row(*map(_one_line, (setting.name, setting.a, setting.b)))
        claims = Table(box=None, expand=True)
        for name in ("", "claim", "A", "B", "effect A", "effect B", "unit", ""):
            claims.add_column(
                name,
                no_wrap=name != "claim",
                ratio=1 if name == "claim" else None,
                max_width=16 if name == "unit" else None,
            )
        for claim in study.claims:
            sides = (claim.a, claim.b)
            claims.add_row(
                str(claim.number),
                _one_line(claim.statements[0]),
                *(side.verdict if side else "" for side in sides),
                *(_effect(side) if claim.alike else "other" for side in sides),
                _one_line(next((side.unit for side in sides if side), "") if claim.alike else ""),
                "*" if claim.changed else "",
            )
        print(study.a.name)
        console.print(settings if study.settings else "No setting differs.")
        console.print(claims)
        print(f"{study.tally}{' (*)' if study.changed else ''}")
        if not all(claim.alike for claim in study.claims):
            print("other: the effects are of different quantities, which the page names.")
    for side, names in (("A", found.only_a), ("B", found.only_b)):
        if names:
            print(f"Only in {side}: {', '.join(names)}")


def _one_line(text: str | None) -> Text:
    """A text as it is, cut to the room there is."""
    line = "-" if text is None else " ".join(text.split())
    return Text(line, no_wrap=True, overflow="ellipsis")


def _effect(claim: "Claim | None") -> str:
    return "" if claim is None or claim.effect is None else f"{claim.effect:.3g}"


def plain_comparison(found: "Comparison", page: Path) -> dict[str, Any]:
    """A comparison as JSON has it."""
    studies = {}
    for study in found.studies:
        studies[study.a.name] = {
            "settings": [asdict(setting) for setting in study.settings],
            "claims": [
                {
                    "number": claim.number,
                    "changed": claim.changed,
                    "alike": claim.alike,
                    "a": claim.a and finite(asdict(claim.a)),
                    "b": claim.b and finite(asdict(claim.b)),
                }
                for claim in study.claims
            ],
            "changed": study.changed,
        }
    return {
        "a": found.a,
        "b": found.b,
        "studies": studies,
        "only_a": list(found.only_a),
        "only_b": list(found.only_b),
        "page": str(page),
    }


def claim_lines(claim: "Claim") -> str:
    """A claim as text: verdict and statement, and below them the evidence and the history."""
    lines = [f"{claim.number:3}. {claim.verdict:10} {claim.statement}"]
    if claim.effect is not None:
        evidence = f"{claim.compared or 'effect'}: {claim.effect:.3g}"
        if claim.low is not None and claim.high is not None:
            evidence += f" [{claim.low:.3g}, {claim.high:.3g}]"
        evidence = f"{evidence} {claim.unit}".rstrip()
        if claim.side is not None and claim.margin is not None:
            evidence += f", claimed {claim.side} {claim.margin:.3g}"
        if claim.p_value is not None:
            evidence += f", {_p_value(claim.p_value)}"
        lines.append(evidence)
    lines.append(claim.test)
    if claim.note:
        lines.append(claim.note)
    if claim.depends_on:
        lines.append(f"another verdict under: {'; '.join(claim.depends_on)}")
    if claim.history:
        dates = ", ".join(dict.fromkeys(revision.date for revision in claim.history))
        lines.append(f"stated {claim.stated}, its test changed {dates} (--json says how and why)")
    return f"\n{'':16}".join(lines)


def _p_value(p_value: float) -> str:
    """To two digits, and never as zero."""
    return "p < 1e-15" if p_value < 1e-15 else f"p = {p_value:.2g}"


def finite(fields: Any) -> Any:
    """Fields as JSON has them, in which a number that is none is null."""
    if isinstance(fields, dict):
        return {name: finite(value) for name, value in fields.items()}
    if isinstance(fields, (list, tuple)):
        return list(map(finite, fields))
    return None if isinstance(fields, float) and not math.isfinite(fields) else fields
