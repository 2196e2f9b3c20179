"""From study pages to the files of a report."""

import base64
import hashlib
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import resources
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from ethogram.core.errors import EthogramError
from ethogram.report import formatting, margins, svg, tables
from ethogram.report.compare.comparison import Comparison
from ethogram.report.files import MARK, publish, publish_one
from ethogram.report.page import StudyPage
from ethogram.report.render.frames import render_svg
from ethogram.report.replay import Replay, encode_replays

INDEX = "index.html"
OPENING = "opening"  # the frame that a study's page opens with
SCENES = Markup("<scenes/>")  # stands for them until it is known how much room they have
MOST_REPLAYS = 10  # of a page; all others are a command away
PAGE_BYTES = 10_000_000  # of a page, unless asked otherwise: replays have what the rest leaves
PAGES = "report"  # apart from the store's folders, which may stand beside it


def page_bytes(megabytes: float) -> int:
    """How many bytes a page may take.

    Raises:
        EthogramError: not a number above 0.

    """
    if not 0 < megabytes < math.inf:
        raise EthogramError(f"A page cannot take {megabytes} MB; allowed: a number above 0.")
    return round(1_000_000 * megabytes)


def write(folder: Path, pages: Sequence[StudyPage], *, page_bytes: int = PAGE_BYTES) -> Path:
    """Write the report on `pages` into `folder`, in place of an earlier one; returns its index.

    Where a page would be larger than `page_bytes`, its replays lose frames and say so.
    """
    _refuse_twins("studies", [page.name for page in pages])
    files: dict[str, str] = {}
    for page in pages:
        files |= dict(_study_files(page, page_bytes))
    files[INDEX] = _render("index.html", pages=pages, root="")
    publish(folder, files)
    return folder / INDEX


def _study_files(page: StudyPage, page_bytes: int) -> Iterator[tuple[str, str]]:
    """The data of the page, then the page, so that its links always lead somewhere."""
    _refuse_twins(
        f"tables and figures of study {page.name!r}",
        [
            *(table.name for table in page.tables),
            *(figure.name for figure in page.figures),
            *([OPENING] if page.opening else []),
        ],
    )
    data = f"{PAGES}/{slug(page.name)}"
    opening = _opening(page)
    if opening:
        alone = svg.standalone(opening["svg"], name=OPENING, alt=opening["caption"])
        yield f"{data}/{OPENING}.svg", alone
    for table in page.tables:
        yield f"{data}/{slug(table.name)}.csv", tables.as_csv(table)
    for figure in page.figures:
        yield f"{data}/{slug(figure.name)}.csv", tables.as_csv(figure.data)
        alone = svg.standalone(figure.svg, name=slug(figure.name), alt=figure.alt)
        yield f"{data}/{slug(figure.name)}.svg", alone
    shared = {"page": page, "data": slug(page.name), "root": "../", "opening": opening}
    yield f"{data}.md", _render("study.md", **shared)
    yield f"{data}.html", _played("study.html", page.replays, page_bytes, **shared)


def _opening(page: StudyPage) -> dict[str, str]:
    """The frame that a page opens with, drawn, and what is to be seen."""
    found = page.opening
    return {"svg": render_svg(found.scene, found.frame), "caption": found.caption} if found else {}


def write_replay(
    file: Path, study: str, replays: Sequence[Replay], *, page_bytes: int = PAGE_BYTES
) -> None:
    """Write a page of replays, which can be sent to others as it is.

    Where it would be larger than `page_bytes`, they lose frames and say so.

    Raises:
        EthogramError: the file cannot be written, or is there and is no page of ours.

    """
    publish_one(file, replay_page(study, replays, page_bytes))


def replay_page(study: str | None, replays: Sequence[Replay], page_bytes: int = PAGE_BYTES) -> str:
    """A page of its own, on which replays can be played; the first one gives it its title.

    Replays that are of no study stand alone on it, for a frame in another page.
    """
    first = replays[0]
    title = first.name if first.scene is None else first.scene.title
    template = "notebook.html" if study is None else "replay.html"
    return _played(template, replays, page_bytes, study=study, title=title, root="../")


def write_comparison(file: Path, comparison: Comparison) -> None:
    """Write a page with two runs side by side, which can be sent to others as it is.

    Raises:
        EthogramError: the file cannot be written, or is there and is no page of ours.

    """
    publish_one(file, _render("compare.html", comparison=comparison, root=""))


def _played(template: str, replays: Sequence[Replay], page_bytes: int, **values: object) -> str:
    """A page with replays and what plays them; one without any has no script at all."""
    shown = _shown_replays(replays)
    script = _script(in_space=any(replay.in_space for replay in shown)) if shown else ""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    page = _render(
        template,
        replays=SCENES if shown else "",
        left_out=len(replays) - len(shown),
        player=Markup(script),
        player_hash=f"sha256-{digest}",
        **values,
    )
    room = page_bytes - len(page.encode(errors="replace"))
    return page.replace(SCENES, encode_replays(shown, room)) if shown else page


def _shown_replays(replays: Sequence[Replay]) -> list[Replay]:
    """As many as a page can have: first trials before others, evenly from the first to the last."""
    ranked = sorted(replays, key=lambda replay: replay.trial)  # stable: else in their order
    firsts = [replay for replay in ranked if replay.trial == ranked[0].trial]
    if len(firsts) <= MOST_REPLAYS:
        return ranked[:MOST_REPLAYS]
    last = len(firsts) - 1
    return [firsts[round(at * last / (MOST_REPLAYS - 1))] for at in range(MOST_REPLAYS)]


@cache
def _script(*, in_space: bool) -> str:
    """The player, with the library that draws in space, and its licence, where it is needed."""
    licence = f"/*!\n{_part('vendor/three.LICENSE')}*/" if in_space else ""
    files = ("vendor/three.js", "templates/space.js") if in_space else ()
    ours = ("templates/plane.js", "templates/chart.js", "templates/replay.js")
    return "\n".join(['"use strict";', licence, *map(_part, (*files, *ours))])


def _part(file: str) -> str:
    return resources.files("ethogram.report").joinpath(file).read_text(encoding="utf-8")


def slug(name: str) -> str:
    """A name as a file name and an anchor: itself where it is plain, else told apart by a hash."""
    plain = re.sub(r"[^a-z0-9_-]+", "-", name.lower())[:60]
    if name and plain == name:
        return name
    return f"{plain.strip('-')}-{hashlib.sha256(name.encode(errors='replace')).hexdigest()[:8]}"


def markdown(text: object) -> Markup:
    """Text that Markdown shows as it is, on one line."""
    line = " ".join(str(text).split())
    return Markup(re.sub(r"([\\`*_{}\[\]<>#|$~^!&])", r"\\\1", line))


def code(text: object) -> Markup:
    """Text between backticks in a Markdown table, in which neither a backtick nor a bar can be."""
    line = " ".join(str(text).split())
    return Markup(line.replace("`", "'").replace("|", "\\|"))


def _refuse_twins(what: str, names: Sequence[str]) -> None:
    twins = [name for name, count in Counter(names).items() if count > 1]
    if twins:
        raise EthogramError(f"Two {what} have the name {', '.join(map(repr, twins))}.")


def _inlined(drawing: str, name: str, alt: str) -> Markup:
    """The one text that goes onto a page as markup: a drawing, parsed and written anew."""
    return Markup(svg.inline(drawing, name=slug(name), alt=alt))


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("ethogram.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {
        "mark": Markup(MARK),
        "lay_out": tables.lay_out,
        "inlined": _inlined,
        "effect": formatting.effect,
        "claimed": margins.claimed,
        "margin_plot": margins.margin_plot,
        "note": formatting.note,
        "shared_revisions": formatting.shared_revisions,
        "stated": formatting.stated,
        "dotted": formatting.dotted,
        "pages_folder": PAGES,
    }
    environment.filters |= {
        "slug": slug,
        "duration": formatting.duration,
        "markdown": markdown,
        "code": code,
        "p_value": formatting.p_value,
    }
    return environment


def _render(template: str, **values: object) -> str:
    return _environment().get_template(template).render(values)
