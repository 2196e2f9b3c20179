"""The arguments and options of the commands: their types, and what `--help` says of them."""

import errno
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

from ethogram.cli.new import Kind


def _possible(kind: Any, path: Path | None) -> None:
    """Refuse a path at which no file system could hold our files, before anything is done."""
    del kind
    if path is None:
        return
    try:
        os.lstat(path / _LONGEST_NAME)
    except OSError as error:
        if error.errno in (errno.ENAMETOOLONG, errno.ELOOP):
            raise ValueError(f"{error.strerror}.") from error


def _file(kind: Any, path: Path | None) -> None:
    """Refuse, where a file is to be written, what can only be a folder."""
    _possible(kind, path)
    if path is not None and not path.name:
        raise ValueError("It is a folder; name a file.")


_LONGEST_NAME = f"{'x' * 64}.{'x' * 64}.safetensors"  # of a file in a store
_PATH = Parameter(validator=_possible)
_FILE = Parameter(validator=_file)

NewKind = Annotated[
    Kind, Parameter(help="What the package adds; a study comes with a world and a learner.")
]
NewFolder = Annotated[
    Path, _PATH, Parameter(help="Folder to write, new or empty; its name becomes the package's.")
]
Name = Annotated[str, Parameter(help="Name of the study; `ethogram list` shows them.")]
PlanName = Annotated[
    str,
    Parameter(name="--plan", help="Name of the plan; `ethogram list` shows those of each study."),
]
Folder = Annotated[
    Path, _PATH, Parameter(help="Folder of the results, where `ethogram run` put them.")
]
Out = Annotated[
    Path, _PATH, Parameter(help="Folder of the results; a run continues from what is there.")
]
EngineName = Annotated[
    str, Parameter(name="--engine", help="pool (several processes) or inline (this one).")
]
Workers = Annotated[
    int | None,
    Parameter(
        validator=Number(gte=1),
        help="Cases to compute at once; by default as many as cores and memory admit.",
    ),
]
Changes = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative=(),
        consume_multiple=True,
        show_default=False,
        help="key=value, any number of them: change a setting of the plan, or restrict an axis to "
        "one value or a list (strategy=always,none).",
    ),
]
Retry = Annotated[bool, Parameter(negative=(), help="Try cases again that failed before.")]
Force = Annotated[
    bool, Parameter(negative=(), help="Compute the cases that are stored anew, and replace them.")
]
DryRun = Annotated[bool, Parameter(negative=(), help="List the cases, with time and memory.")]
CaseName = Annotated[str, Parameter(help="Name of the case; `ethogram run --dry-run` shows them.")]
ReplayOut = Annotated[
    Path | None, _FILE, Parameter(name="--out", help="File to write; by default one in the report.")
]
Format = Literal["html", "gif", "webp", "mp4"]
ReplayFormat = Annotated[
    Format | None,
    Parameter(
        name="--format",
        help="What to write: a page with a player (html), or a video (mp4 needs "
        "`ethogram[video]`); by default what the name of --out ends in, else html.",
    ),
]
ReplayTrial = Annotated[
    int | None,
    Parameter(
        help="Trial to show, from 1; by default all that were recorded, in a video the first."
    ),
]
PageSize = Annotated[
    float,
    Parameter(
        name="--page-size",
        help="Megabytes that a page takes at most; where there is more to replay, frames are left "
        "out, and the page says so.",
    ),
]
FolderA = Annotated[Path, _PATH, Parameter(help="Folder of the one run's results.")]
FolderB = Annotated[Path, _PATH, Parameter(help="Folder of the other run's results.")]
ReportOut = Annotated[
    Path | None,
    _PATH,
    Parameter(name="--out", help="Folder to write to; by default that of the results."),
]
CompareOut = Annotated[
    Path | None,
    _FILE,
    Parameter(name="--out", help="File to write; by default compare.html in DIR_B."),
]
Show = Annotated[bool, Parameter(name="--show", negative="--no-show", help="Open it in a browser.")]
AsJson = Annotated[bool, Parameter(name="--json", negative=(), help="Print JSON, not text.")]
