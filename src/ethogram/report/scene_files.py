"""Scenes as files: a page that plays one, or a video."""

from pathlib import Path

from ethogram.core.errors import EthogramError
from ethogram.core.scene import Scene
from ethogram.report.files import publish_one
from ethogram.report.render.video import FORMATS, write_video
from ethogram.report.replay import Replay
from ethogram.report.site import replay_page

PAGE = ".html"


def save(file: Path, scene: Scene) -> None:
    """Write a scene in the format that the file's name ends in.

    `Scene.save` finds this function by its name.

    Raises:
        EthogramError: there is no such format, the scene has nothing to show, a package is missing,
            the file cannot be written, or it is a page that is not ours.

    """
    suffix = file.suffix.lower()
    if suffix == PAGE:
        publish_one(file, replay_page(None, [Replay(name=scene.title, scene=scene)]))
    elif suffix in FORMATS:
        write_video(file, scene)
    else:
        raise EthogramError(
            f"A scene cannot be saved as {str(file)!r}; allowed: names that end in "
            f"{', '.join([PAGE, *FORMATS])}."
        )
