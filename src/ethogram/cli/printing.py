"""What commands print: tables as wide as the terminal, and JSON."""

import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from ethogram.campaign.launch import Prospect
    from ethogram.core.findings import Claim
    from ethogram.report import Comparison


def say(text: str) -> None:
    """Print for the person at the terminal, apart from what a command gives out."""
    print(text, file=sys.stderr)


def show_prospects(prospects: "Sequence[Prospect]", to_do: "Sequence[Prospect]", crew: int) -> None:
    """List the cases of a plan, and what those that a run would compute take together."""
    from ethogram.campaign.display import readable_seconds
    from ethogram.core.memory import available_memory, readable_bytes

    table = Table("case", "state", "time", "memory", box=None)
    for prospect in prospects:
        table.add_row(
            prospect.case.name,
            "to do" if prospect in to_do else prospect.state,
            readable_seconds(prospect.cost.seconds),
            readable_bytes(prospect.cost.bytes),
        )
    Console().print(table)
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
    """A claim as text: the verdict and the statement, and below them the evidence."""
    lines = [f"{claim.number:3}. {claim.verdict:10} {claim.statement}"]
    if claim.effect is not None:
        evidence = f"effect {claim.effect:.3g}"
        if claim.low is not None and claim.high is not None:
            evidence += f" [{claim.low:.3g}, {claim.high:.3g}]"
        evidence += f" {claim.unit}"
        if claim.p_value is not None:
            evidence += f", p = {claim.p_value:.2g}"
        lines.append(f"{'':16}{evidence}; {claim.test}")
    if claim.note:
        lines.append(f"{'':16}{claim.note}")
    return "\n".join(lines)


def finite(fields: dict[str, Any]) -> dict[str, Any]:
    """Fields as JSON has them, in which a number that is none is null."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in fields.items()
    }
