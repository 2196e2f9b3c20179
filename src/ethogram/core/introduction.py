"""What a study's page opens with, as plain data: for a reader who knows nothing of it yet."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Introduction:
    """A paragraph on the study's world, its source, its symbols, and which scene to picture.

    Pictured is a frame of the named case's first recorded scene; of the first case that has one
    where that case was not run, and nothing where there is no scene.
    """

    text: str = ""  # who acts in what, what they want, what is varied
    source: str = ""  # author, title, year; what "section 3.4" in claims and tables is part of
    symbols: Mapping[str, str] = field(default_factory=dict)  # as texts write them, and meanings
    case: str = ""  # of the picture
    frame: int = 0  # of its scene, from 0; the last one where there are fewer
    caption: str = ""  # what is to be seen
