"""A publishing system as a scene: who sends what where, and what becomes of it.

Authors stand in a row below, the better the further to the right; journals in a row above, in the
order of their impact factors, the highest to the right, and as large as they have papers.  Every
step is two frames: drafts with their authors, then where they were sent, accepted or rejected.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Bool, Float, Int

from ethogram.core.scene import Scene, Shape, tints
from ethogram.core.world import Outcome
from ethogram.worlds.publishing.state import State

SHOWN = 30  # authors at most, evenly chosen by quality
FRAME_SECONDS = 0.25
AUTHOR, DRAFT, JOURNAL = 0.3, 0.2, 0.9  # radius, radius, half an edge of the largest
HEIGHT = 8.0  # of the journals above the authors
WIDTH = 40.0
PALETTE = tints("an author", "a draft", "accepted", "rejected", "a journal")
DRAFTED, ACCEPTED, REJECTED = 1, 2, 3


class Glimpse(eqx.Module):
    """What is seen of a step; with leading axes, of all steps of all years."""

    choice: Int[Array, "*time shown"]  # 0, or the journal that got the draft, from 1
    accepted: Bool[Array, "*time shown"]
    papers: Int[Array, "*time journal"]  # published so far


def glimpse(outcome: Outcome, after: State) -> Glimpse:
    """What the authors that are shown did in a step of the world."""
    shown = chosen(after.quality)
    metrics = outcome.metrics
    return Glimpse(metrics["choice"][shown], metrics["accepted"][shown], after.qualities.papers)


def chosen(quality: Float[Array, "author"]) -> Int[Array, "shown"]:
    """The authors that are shown, from the worst to the best."""
    count = min(len(quality), SHOWN)
    rank = jnp.round(jnp.linspace(0, len(quality) - 1, count)).astype(int)
    return jnp.argsort(quality)[rank]


def record(
    words: str,
    quality: Float[np.ndarray, "author"],
    impact: Float[np.ndarray, "year journal"],
    steps: Glimpse,
) -> Scene:
    """Draw up a trial of whole years.

    Args:
        words: what it shows.
        quality: of all authors.
        impact: factors that are known in each year, not a number where undefined.
        steps: arrays with years and steps as leading axes.

    """
    years, per_year, _ = steps.choice.shape
    flat = jax.tree.map(lambda part: np.asarray(part).reshape(-1, part.shape[-1]), steps)
    known = np.repeat(impact, per_year, 0)
    return record_steps(words, quality, known, flat, np.arange(years * per_year), per_year)


def record_steps(
    words: str,
    quality: Float[np.ndarray, "author"],
    impact: Float[np.ndarray, "step journal"],
    steps: Glimpse,
    time: Int[np.ndarray, "step"],
    per_year: int,
) -> Scene:
    """Draw up steps, of any part of a trial.

    Args:
        words: what they show.
        quality: of all authors.
        impact: factors that are known in each step, not a number where undefined.
        steps: arrays with the steps as leading axis.
        time: steps that were taken before each of them.
        per_year: how many steps make a year.

    """
    choice, accepted, papers = map(np.asarray, (steps.choice, steps.accepted, steps.papers))
    count, journals = impact.shape
    shown = len(np.asarray(chosen(jnp.asarray(quality))))
    frames = 2 * count
    sites = _sites(impact)
    homes = np.stack([_spread(shown), np.zeros(shown)], -1)
    drafts, tint = _drafts(homes, sites, choice, accepted)
    size = np.repeat(np.sqrt(papers / max(1, papers.max())), 2, 0)  # areas tell numbers
    total = papers.sum(1)
    published = np.diff(total, prepend=total[0])  # in each step; of the first it is not known
    fixed = np.ones((frames, shown))
    standing = np.broadcast_to(homes, (frames, shown, 2))
    return Scene(
        title=f"Publishing: {words}",
        bounds=(-WIDTH / 2 - 1.5, -1.0, WIDTH / 2 + 1.5, HEIGHT + 2.0),
        frame_seconds=FRAME_SECONDS,
        palette=PALETTE,
        shapes=(
            *(Shape("square", JOURNAL) for _ in range(journals)),
            *(Shape("circle", AUTHOR) for _ in range(shown)),
            *(Shape("circle", DRAFT) for _ in range(shown)),
        ),
        position=np.concatenate([np.repeat(sites, 2, 0), standing, drafts], 1),
        tint=np.concatenate(
            [np.full((frames, journals), len(PALETTE) - 1), np.zeros((frames, shown), int), tint], 1
        ),
        scale=np.concatenate([np.maximum(size, 0.15), fixed, fixed], 1),
        fresh=np.concatenate([np.zeros((frames, journals + shown), bool), _begun(tint)], 1),
        captions=tuple(
            f"year {1 + step // per_year}, step {1 + step % per_year}"
            for step in time.tolist()
            for _ in range(2)
        ),
        chapters=tuple(f"year {1 + step // per_year}" for step in time.tolist() for _ in range(2)),
        series={"papers published": np.repeat(published, 2)[:, None].astype(float)},
    )


def _sites(impact: Float[np.ndarray, "step journal"]) -> Float[np.ndarray, "step journal axis"]:
    """Where journals stand, in the order of their impact factors, those without one first."""
    rank = np.argsort(np.argsort(np.where(np.isnan(impact), -np.inf, impact), 1, "stable"), 1)
    across = _spread(impact.shape[1])[rank]
    return np.stack([across, np.full_like(across, HEIGHT)], -1)


def _drafts(
    homes: Float[np.ndarray, "shown axis"],
    sites: Float[np.ndarray, "step journal axis"],
    choice: Int[np.ndarray, "step shown"],
    accepted: Bool[np.ndarray, "step shown"],
) -> tuple[Float[np.ndarray, "frame shown axis"], Int[np.ndarray, "frame shown"]]:
    """Where drafts are, with their authors and then where they were sent, and their tints."""
    sent = choice > 0
    drafts = np.empty((2 * len(choice), *homes.shape))
    drafts[0::2] = homes + np.array([0.0, AUTHOR + 2 * DRAFT])
    goal = np.take_along_axis(sites, np.maximum(choice - 1, 0)[..., None], 1)
    drafts[1::2] = np.where(sent[..., None], goal + _around(len(homes)), drafts[0::2])
    tint = np.empty(drafts.shape[:2], int)
    tint[0::2] = DRAFTED
    tint[1::2] = np.where(accepted, ACCEPTED, np.where(sent, REJECTED, DRAFTED))
    return drafts, tint


def _begun(tint: Int[np.ndarray, "frame shown"]) -> Bool[np.ndarray, "frame shown"]:
    """Whether a draft is a new one: those that were rejected go back to their authors."""
    begun = np.zeros(tint.shape, bool)
    begun[2::2] = tint[1:-1:2] != REJECTED
    return begun


def _spread(count: int) -> Float[np.ndarray, "place"]:
    """Places along a row."""
    return np.linspace(-1, 1, count) * WIDTH / 2 if count > 1 else np.zeros(1)


def _around(count: int) -> Float[np.ndarray, "shown axis"]:
    """Where drafts lie on a journal, so that they do not hide each other."""
    turn = np.arange(count) * 2.4  # the golden angle, nearly
    return 0.6 * np.stack([np.cos(turn), np.sin(turn)], -1)
