"""Training of a case: one loop with progress, checkpoints and learning curves.

`train_case` trains a learner, of one trial or of all trials side by side; `trials_in_turn` runs the
trials of a case one after the other, where that is faster or where the memory of all is too much.
Either goes on from the last checkpoint of the case.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jax import Array
from jaxtyping import Float, Key

from ethogram.campaign.context import Context
from ethogram.core.pytrees import from_arrays, to_arrays
from ethogram.core.world import World
from ethogram.learners.base import Learner, Metrics
from ethogram.learners.train import train
from ethogram.physics import native

Arrays = dict[str, np.ndarray]
DONE = "updates"  # done: a number in a checkpoint
CURVE, STATE, FINISHED = "curve.", "state.", "finished."  # what names in a checkpoint begin with


class Trained(NamedTuple):
    """What training leaves."""

    state: Any
    curves: Arrays  # by name, with the updates as leading axis


def use_kernels(context: Context, world: World) -> None:
    """Have the record name what does the work of a world's kernels; before any training."""
    used = {name: native.implementation(name, choice) for name, choice in world.kernels.items()}
    context.use_kernels(used)


def train_case(
    learner: Learner,
    for_init: Key[Array, "..."],
    for_updates: Key[Array, "..."],
    updates: int,
    context: Context,
    curves: Callable[[Metrics], Mapping[str, np.ndarray]],
    *,
    initial: Callable[[Any], Mapping[str, np.ndarray]] | None = None,
    pack: Callable[[Any], Arrays] = to_arrays,
    unpack: Callable[[Any, Arrays], Any] = from_arrays,
) -> Trained:
    """Train a learner to its last update, from the last checkpoint if there is one.

    Args:
        learner: any; of one trial, or of many with arrays of keys.
        for_init: consumed; draws the initial state.
        for_updates: consumed; draws the updates.
        updates: how many.
        context: of the case.
        curves: what is kept of the metrics of some updates, which are the leading axis.
        initial: what the curves begin with, of the initial state.
        pack: the state as arrays, where a checkpoint need not hold all of it.
        unpack: the state that `pack` was given, from one in its form and the arrays.

    Raises:
        Diverged: a loss or the state is not finite.

    """
    found = context.restore()
    kept: Arrays = {}
    done = 0
    if found is None:
        state = eqx.filter_jit(learner.init)(for_init)
        kept |= initial(state) if initial else {}
    else:
        done, kept = int(found[DONE]), named_so(CURVE, found)
        state = unpack(jax.eval_shape(learner.init, for_init), named_so(STATE, found))

    def after_chunk(done: int, state: Any, metrics: Metrics) -> None:
        for name, values in curves(metrics).items():
            kept[name] = np.concatenate([kept[name], values]) if name in kept else values
        context.progress(done, updates)
        context.checkpoint(
            lambda: {DONE: np.array(done)} | named(STATE, pack(state)) | named(CURVE, kept)
        )

    state, _ = train(
        learner, for_updates, updates, state=state, start=done, after_chunk=after_chunk
    )
    return Trained(state, kept)


def trials_in_turn(
    trials: int, context: Context, one: Callable[[int, Context], Arrays]
) -> list[Arrays]:
    """What is kept of each trial, run one after the other from the last checkpoint.

    Args:
        trials: how many.
        context: of the case.
        one: runs the trial of a number, in a context of its own.

    """
    found = context.restore() or {}
    finished: list[Arrays] = []
    while any(name.startswith(f"{FINISHED}{len(finished)}.") for name in found):
        finished.append(named_so(f"{FINISHED}{len(finished)}.", found))
    in_hand = {name: array for name, array in found.items() if not name.startswith(FINISHED)}
    for number in range(len(finished), trials):
        finished.append(one(number, _Turn(context, number, trials, finished, in_hand or None)))
        in_hand = {}
    return finished


def training_points(count: int, record_every: int, unit: str = "episode") -> Any:
    """The coordinate of a learning curve: the last episode of each point, for an `xarray.Dataset`.

    The last point may have fewer episodes than the others.  The unit may be another one: "update".
    """
    ends = np.arange(record_every, count + record_every, record_every)
    attributes = {"long_name": f"training {unit}s", "units": unit}
    return "point", np.minimum(ends, count), attributes


def learning_curve(
    values: Float[np.ndarray, "episode *of"], record_every: int
) -> Float[np.ndarray, "point *of"]:
    """Means over the episodes of each point, in 64 bits."""
    point = np.arange(len(values)) // record_every
    episodes = np.bincount(point)
    sums = np.zeros((len(episodes), *values.shape[1:]))
    np.add.at(sums, point, values)
    return sums / episodes.reshape(-1, *(1,) * (values.ndim - 1))


class _Turn(Context):
    """The context of one trial among those that run in turn."""

    def __init__(
        self, case: Context, number: int, trials: int, finished: list[Arrays], found: Arrays | None
    ) -> None:
        super().__init__()
        self._case, self._number, self._trials = case, number, trials
        self._finished, self._found = finished, found

    def progress(self, done: float, total: float) -> None:
        self._case.progress(self._number + done / max(total, 1e-9), self._trials)

    def restore(self) -> Arrays | None:
        return self._found

    def checkpoint(self, make: Callable[[], Arrays]) -> None:
        def whole() -> Arrays:
            arrays = make()
            for number, kept in enumerate(self._finished):
                arrays |= named(f"{FINISHED}{number}.", kept)
            return arrays

        self._case.checkpoint(whole)


def named(start: str, arrays: Arrays) -> Arrays:
    """Arrays whose names begin with a prefix more."""
    return {f"{start}{name}": array for name, array in arrays.items()}


def named_so(start: str, arrays: Arrays) -> Arrays:
    """Those arrays whose names begin with a prefix, under their names without it."""
    return {
        name.removeprefix(start): array for name, array in arrays.items() if name.startswith(start)
    }
