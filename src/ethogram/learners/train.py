"""The one training loop: chunks of updates under `jit`, and a callback between them.

A learner has `update(key, learned) -> (learned, metrics)`.  Update number i gets the key
`fold_in(key, i)`, so that a run that is stopped between chunks and taken up again goes on with
the numbers it would have had.
"""

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Int, Key

from ethogram.core.errors import EthogramError
from ethogram.core.keys import fold_in

Metrics: TypeAlias = Any  # a tree; every array has the chunk's updates as its leading axis
AfterChunk = Callable[[int, Any, Metrics], None]  # (updates done, learned, metrics)


class Diverged(EthogramError):
    """A learner's metrics are not finite; the message names which, and the update."""


@runtime_checkable
class Learner(Protocol):
    """What `train` needs of a learner."""

    def update(self, key: Key[Array, "..."], learned: Any) -> tuple[Any, Any]:
        """Learn once."""


def train(
    learner: Learner,
    key: Key[Array, "..."],
    learned: Any,
    updates: int,
    *,
    chunk: int,
    after_chunk: AfterChunk,
    start: int = 0,
) -> Any:
    """Update `learned` until `updates` updates are done.

    Args:
        learner: any learner.
        key: one key, or one per trial if the learner's `update` takes that.
        learned: the learner's state after `start` updates; it is donated, do not use it again.
        updates: the number of the last update.
        chunk: updates between two callbacks; part of what fixes the numbers bit for bit.
        after_chunk: called with the number of updates done, the state (to be read at once: it
            is donated to the next chunk) and the chunk's metrics.
        start: how many updates `learned` has behind it: those of an earlier stage of the run, and
            whole chunks of this one.

    Raises:
        Diverged: some metric, or a number of the state, is not finite; the state before the chunk
            was the last sound one.

    """
    for first in range(start, updates, chunk):
        length = min(chunk, updates - first)
        learned, metrics = _run_chunk((learner, key, jnp.int32(first), length), learned)
        metrics = jax.tree.map(np.asarray, metrics)
        _require_finite(metrics, first)
        _require_sound(learned, first)
        after_chunk(first + length, learned, metrics)
    return learned


def _updates(
    fixed: tuple[Learner, Key[Array, "..."], Int[Array, ""], int], learned: Any
) -> tuple[Any, Any]:
    """A chunk of updates: the state after, and every update's metrics."""
    learner, key, first, length = fixed

    def update(learned: Any, number: Int[Array, ""]) -> tuple[Any, Any]:
        return learner.update(fold_in(key, number), learned)

    return lax.scan(update, learned, first + jnp.arange(length))


_run_chunk = eqx.filter_jit(_updates, donate="all-except-first")


def _require_finite(metrics: Metrics, first: int) -> None:
    broken: list[tuple[int, str]] = []
    for path, values in jax.tree_util.tree_leaves_with_path(metrics):
        for update, *where in np.argwhere(~np.isfinite(values))[:1].tolist():
            name = jax.tree_util.keystr(path, simple=True, separator=".")
            broken.append((first + update, f"{name}{where or ''}"))
    if broken:
        update, name = min(broken)
        raise Diverged(f"{name} is not finite at update {update}; after {first} updates all was.")


def _require_sound(learned: Any, first: int) -> None:
    """A loss is computed before the step that it leads to: the last step may be what breaks."""
    for path, finite in jax.tree_util.tree_leaves_with_path(_finite(learned)):
        if not finite:
            name = jax.tree_util.keystr(path, simple=True, separator=".")
            where = f"{name} of what is learned" if name else "what is learned"
            raise Diverged(f"{where} is not finite in the end; after {first} updates all was.")


@eqx.filter_jit
def _finite(learned: Any) -> Any:
    numbers = eqx.filter(learned, eqx.is_inexact_array)
    return jax.tree.map(lambda array: jnp.isfinite(array).all(), numbers)


def even_chunk(updates: int, most: int) -> int:
    """How long to make chunks of at most `most` updates so that, if may be, all are as long.

    Chunks of another length are another program to compile.  Those of more than half of `most`
    are tried; where none divides `updates`, the last one will be shorter.
    """
    most = max(1, min(most, updates))
    return next((size for size in range(most, most // 2, -1) if updates % size == 0), most)
