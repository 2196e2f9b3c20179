"""The one training loop: chunks of updates under `jit`, and a callback between them.

Update number i of a learner (`ethogram.learners.base`) gets the key `fold_in(key, i)`, and every
chunk, however long, is the same compiled program.  So how many updates a chunk has changes no
number: it is chosen by the time that the last one took, and a run that is stopped between chunks
and taken up again goes on with the numbers it would have had.
"""

import time
import weakref
from collections.abc import Callable
from math import prod
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jaxtyping import Int, Key

from ethogram.core.errors import EthogramError
from ethogram.core.keys import fold_in, require_key
from ethogram.learners.base import Learner, Metrics, undefined_metrics

AfterChunk = Callable[[int, Any, Metrics], None]  # (updates done, state, metrics)

CHUNK_SECONDS = 1.0  # of a chunk, unless a single update takes longer
_INIT = 2**31 - 1  # the update that there never is, whose key draws the initial state
_GROWTH = 8  # how many times as long as the one before a chunk may be
_MOST_UPDATES = 1000  # of a chunk,
_METRICS_BYTES = 16_000_000  # and what their metrics may take
_LOOK_SECONDS = 0.02  # at most, between two looks at whether a chunk is done


class Diverged(EthogramError):
    """A learner's metrics are not finite; the message names which, and the update."""


class TrainingResult(NamedTuple):
    """The final state, and the metrics of every update, which are the leading axis.

    The metrics are None where a callback has had them, or where there was nothing left to do.
    """

    state: Any
    metrics: Metrics | None


def train(
    learner: Learner,
    key: Key[Array, "..."],
    updates: int,
    *,
    state: Any = None,
    start: int = 0,
    after_chunk: AfterChunk | None = None,
    seconds: float = CHUNK_SECONDS,
) -> TrainingResult:
    """Update a learner until `updates` updates are done.

    Args:
        learner: any learner.
        key: one key, or one per trial for a learner of many (`ethogram.learners.base.Trials`).
        updates: the number of the last update.
        state: the learner's state after `start` updates, to go on from; it is donated, do not use
            it again.  None is `learner.init` with a key made from this one.
        start: how many updates `state` has behind it, those of an earlier stage of the run among
            them.
        after_chunk: called with the number of updates done, the state and the chunk's metrics, as
            NumPy arrays with the updates as leading axis.  It may keep all of them; of a state that
            it keeps, the next chunk works on a copy.  Without it all metrics are kept and returned.
        seconds: about how long a chunk takes; it has one update at least.  0 calls `after_chunk`
            after every update.

    Raises:
        Diverged: some metric, or a number of the state, is not finite; the state before the chunk
            was the last sound one.  Metrics that the learner declares as `undefined_metrics` may be
            NaN.

    """
    require_key("train", key)
    if state is None:
        state = eqx.filter_jit(learner.init)(fold_in(key, _INIT))
    kept: list[Metrics] = []
    length, done = 1, start
    while done < updates:
        length = min(length, updates - done)
        began = time.monotonic()
        state, metrics = _run_chunk((learner, key, jnp.int32(done), jnp.int32(length)), state)
        _wait_for(metrics, state)
        metrics = jax.tree.map(lambda kept, length=length: np.array(kept[:length]), metrics)
        took = time.monotonic() - began
        _require_finite(metrics, undefined_metrics(learner), done)
        _require_sound(state, done)
        done += length
        if after_chunk is None:
            kept.append(metrics)
        else:
            state = _hand_out(after_chunk, done, state, metrics)
        length = _next_length(length, seconds, took, _room(metrics))
    all_metrics = jax.tree.map(lambda *parts: np.concatenate(parts), *kept) if kept else None
    return TrainingResult(state, all_metrics)


def _next_length(length: int, seconds: float, took: float, room: int) -> int:
    """How many updates to make a chunk of, after one of some length that took some time."""
    share = min(seconds / max(took, 1e-9), _GROWTH)
    return max(1, min(int(length * share), room))


def _updates(
    fixed: tuple[Learner, Key[Array, "..."], Int[Array, ""], Int[Array, ""]], state: Any
) -> tuple[Any, Any]:
    """A chunk of updates: the state after, and every update's metrics, with room for more."""
    learner, key, first, length = fixed

    @jax.jit
    def update(number: Int[Array, ""], state: Any) -> tuple[Any, Any]:
        return learner.update(fold_in(key, number), state)

    after, one = jax.eval_shape(update, first, state)
    _require_interface(learner, state, after, one)
    room = _room(jax.tree.map(lambda metric: np.empty((1, *metric.shape), metric.dtype), one))
    kept = jax.tree.map(lambda metric: jnp.zeros((room, *metric.shape), metric.dtype), one)

    def advance(place: Int[Array, ""], at: tuple[Any, Any]) -> tuple[Any, Any]:
        state, metrics = update(first + place, at[0])
        return state, jax.tree.map(
            lambda all_, now: lax.dynamic_update_index_in_dim(all_, now, place, 0), at[1], metrics
        )

    return lax.fori_loop(0, length, advance, (state, kept))


def _require_interface(learner: Learner, state: Any, after: Any, metrics: Any) -> None:
    """Refuse a learner whose update gives something else than a state like its own, and metrics.

    Raises:
        EthogramError: naming the learner and what is wrong with it.

    """
    name = f"{type(learner).__name__}.update"
    if not isinstance(metrics, dict):
        raise EthogramError(
            f"{name}: its metrics are of type {type(metrics).__name__}; allowed: a dict of arrays."
        )
    if not eqx.tree_equal(*map(jax.tree.structure, (after, state))):
        raise EthogramError(f"{name}: the state that it gives is another tree than the one it got.")
    paths = jax.tree_util.tree_leaves_with_path(state)
    for (path, before), now in zip(paths, jax.tree.leaves(after), strict=True):
        if (before.shape, before.dtype) != (now.shape, now.dtype):
            where = jax.tree_util.keystr(path, simple=True, separator=".") or "the state"
            raise EthogramError(
                f"{name}: {where} becomes {now.dtype}{list(now.shape)}; allowed: "
                f"{before.dtype}{list(before.shape)}, as it was."
            )


_run_chunk = eqx.filter_jit(_updates, donate="all-except-first")


def _room(metrics: Metrics) -> int:
    """For how many updates' metrics there is room in a chunk."""
    bytes_ = sum(prod(kept.shape[1:]) * kept.dtype.itemsize for kept in jax.tree.leaves(metrics))
    return max(1, min(_MOST_UPDATES, _METRICS_BYTES // max(bytes_, 1)))


def _wait_for(*results: Any) -> None:
    """Wait in Python, where Ctrl-C is heard, until a program has ended."""
    computed = [leaf for leaf in jax.tree.leaves(results) if hasattr(leaf, "is_ready")]
    pause = _LOOK_SECONDS / 64
    while not all(leaf.is_ready() for leaf in computed):
        time.sleep(pause)
        pause = min(2 * pause, _LOOK_SECONDS)


def _hand_out(after_chunk: AfterChunk, done: int, state: Any, metrics: Metrics) -> Any:
    """Call back; returns the state to go on with, which shares nothing with what was kept.

    The callback gets other names for the same memory.  What it kept of them is still alive when it
    has returned; that, and only that, is copied, since the next chunk overwrites its state.
    """
    mine, structure = jax.tree.flatten(state)
    shown = [_alias(leaf) for leaf in mine]
    names = [weakref.ref(leaf) if isinstance(leaf, jax.Array) else None for leaf in shown]
    handed = [jax.tree.unflatten(structure, shown)]
    shown.clear()
    after_chunk(done, handed.pop(), metrics)
    kept = [name is not None and name() is not None for name in names]
    after = [jnp.copy(leaf) if is_kept else leaf for leaf, is_kept in zip(mine, kept, strict=True)]
    return jax.tree.unflatten(structure, after)


def _alias(leaf: Any) -> Any:
    """Another array on the same memory; of a random key, a copy."""
    if not isinstance(leaf, jax.Array):
        return leaf
    if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key):
        return jnp.copy(leaf)
    parts = [shard.data for shard in leaf.addressable_shards]
    return jax.make_array_from_single_device_arrays(leaf.shape, leaf.sharding, parts)


def _require_finite(metrics: Metrics, undefined: frozenset[str], first: int) -> None:
    diverged: list[tuple[int, str]] = []
    for name, values_of_one in metrics.items():
        is_wrong = np.isinf if name in undefined else lambda values: ~np.isfinite(values)
        for path, values in jax.tree_util.tree_leaves_with_path({name: values_of_one}):
            for update, *where in np.argwhere(is_wrong(values))[:1].tolist():
                full_name = jax.tree_util.keystr(path, simple=True, separator=".")
                diverged.append((first + update, f"{full_name}{where or ''}"))
    if diverged:
        update, name = min(diverged)
        raise Diverged(f"{name} is not finite at update {update}; after {first} updates all was.")


def _require_sound(state: Any, first: int) -> None:
    """A loss is computed before the step that it leads to: the last step may be what breaks."""
    for path, finite in jax.tree_util.tree_leaves_with_path(_finite(state)):
        if not finite:
            name = jax.tree_util.keystr(path, simple=True, separator=".")
            where = f"{name} of the learner's state" if name else "the learner's state"
            raise Diverged(f"{where} is not finite in the end; after {first} updates all was.")


@eqx.filter_jit
def _finite(state: Any) -> Any:
    numbers = eqx.filter(state, eqx.is_inexact_array)
    return jax.tree.map(lambda array: jnp.isfinite(array).all(), numbers)
