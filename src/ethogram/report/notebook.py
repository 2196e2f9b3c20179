"""Scenes in notebooks: a replay in a frame, as the output of a cell."""

from html import escape

from ethogram.core.scene import Scene
from ethogram.report.replay import Replay
from ethogram.report.site import replay_page

HEIGHT = "47rem"  # the whole player of most scenes; a higher one scrolls


def as_html(scene: Scene) -> str:
    """The page of one replay in a frame: `Scene._repr_html_` finds this function by its name.

    The page may run scripts and do nothing else to the page around it, to which it is a stranger
    (`sandbox`).  By its own Content-Security-Policy only the player's script runs, known by its
    hash.  A frame made from `srcdoc` is under the policy of the page around it in addition: where
    that one forbids scripts written into the page, the frame shows a title and no player.

    Raises:
        EthogramError: the scene cannot be shown.

    """
    page = replay_page(None, [Replay(name=scene.title, scene=scene)])
    frame = (
        f'<iframe srcdoc="{escape(page)}" title="Replay: {escape(scene.title)}" '
        'sandbox="allow-scripts" '
        f'style="display: block; width: 100%; height: {HEIGHT}; border: 0"></iframe>'
    )
    return frame.encode(errors="replace").decode()  # what is no text, as in pages that are written
