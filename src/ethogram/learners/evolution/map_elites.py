"""MAP-Elites: an archive of the fittest of every kind of behaviour (Mouret and Clune, 2015).

Beside its fitness, a candidate has a descriptor: how it behaved, as a few numbers.  The space of
descriptors is cut into a grid of cells, and each cell keeps the fittest candidate that fell into
it, its elite (arXiv:1504.04909, figure 1).  Children are born to elites drawn at random, whether
their cells are good or bad: what is found is not one solution but a map of what is possible.

A child is its parent with a number from N(0, sigma_iso) added to every gene; with a `line_scale` it
moves along the line to a second elite, too:

    x_i + sigma_iso N(0, I) + sigma_line (x_j - x_i) N(0, 1)

(Vassiliades and Mouret, "Discovering the elite hypervolume by leveraging interspecies correlation",
2018, eq. 1; their values are 0.01 and 0.2).

Readings and deviations.  Children come in batches, as in later implementations, not one by one: of
a batch the fittest for a cell enters it, the first drawn by lot where several tie.  An elite stays
until a fitter one comes; one that is as fit does not replace it.  Descriptors beyond their limits
fall into the cells at the border.  A candidate that diverges, or whose descriptor is not finite,
enters no cell.  Elites are not evaluated again where fitness is not deterministic, as in the paper:
cells then keep lucky ones.
"""

from typing import Annotated, Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array
from jaxtyping import Bool, Float, Int, Key
from pydantic import Field

from ethogram.core.batching import least, take
from ethogram.core.errors import InvalidSettings
from ethogram.core.memory import require_memory
from ethogram.core.settings import Number, setting
from ethogram.learners.base import Metrics
from ethogram.learners.evolution.base import (
    WORST_FITNESS,
    BestEver,
    Evaluation,
    EvolutionaryLearner,
    best_first,
    fitness_metrics,
    with_worst,
)

MOST_CELLS = 10_000_000


class Archive(eqx.Module):
    """The elites, cell after cell, the last descriptor's cells next to each other."""

    genome: Float[Array, "cell gene"]
    fitness: Float[Array, "cell"]  # the worst where a cell is empty
    descriptor: Float[Array, "cell descriptor"]  # 0 where a cell is empty
    filled: Bool[Array, "cell"]
    best_ever: BestEver
    diverged: Int[Array, ""]  # of the candidates that were evaluated last


class MAPElites(EvolutionaryLearner):
    """MAP-Elites for any fitness function that describes behaviour.

    Candidates that diverge, or whose fitness is not finite, are counted and enter no cell.

    Attributes:
        search_space: where genes are drawn, and within what they stay.
        fitness: of all candidates in one call, with a `descriptor` of each
            (see `ethogram.learners.evolution.base.Evaluation`).
        cells: per descriptor, into equally wide ones, from 1 to 10 000.
        descriptor_low: where the first cell begins, of every descriptor.
        descriptor_high: where the last one ends; above `descriptor_low`.
        initial_size: genomes drawn at random at first, from 1 to 1 000 000.
        batch_size: children of an update, from 1 to 1 000 000.
        mutation_scale: sigma_iso, in units of the gene; 0 or more.
        line_scale: sigma_line, a share of the way to another elite; 0 or more.
        least_fitness: what QD-score counts from: fitness below it lowers the score.

    """

    cells: int = setting(10, Annotated[int, Field(ge=1, le=10_000)], static=True)
    descriptor_low: Number = setting(0.0, float)
    descriptor_high: Number = setting(1.0, float)
    initial_size: int = setting(100, Annotated[int, Field(ge=1, le=1_000_000)], static=True)
    batch_size: int = setting(100, Annotated[int, Field(ge=1, le=1_000_000)], static=True)
    mutation_scale: Number = setting(0.1, Annotated[float, Field(ge=0)])
    line_scale: Number = setting(0.0, Annotated[float, Field(ge=0)])
    least_fitness: Number = setting(0.0, float)

    def __check_init__(self) -> None:
        """Refuse limits that are upside down.

        Raises:
            InvalidSettings: descriptors would have no cells.

        """
        limits = self.descriptor_low, self.descriptor_high
        if any(isinstance(limit, jax.core.Tracer) or jnp.ndim(limit) for limit in limits):
            return
        low, high = (float(limit) for limit in limits)
        if not low < high:
            raise InvalidSettings(
                f"MAPElites: descriptor_high = {high:g} with descriptor_low = {low:g}; allowed: "
                "a descriptor_high above it."
            )

    def init(self, key: Key[Array, ""]) -> Archive:
        """The elites of genomes drawn at random; its metrics are those of `metrics`.

        Raises:
            InvalidSettings: the fitness describes no behaviour, or there would be too many cells.
            TooLarge: the archive would not fit in memory; the message names the size.

        """
        candidates = self.search_space.sample(key, self.initial_size)
        descriptors = self._descriptors(candidates)
        if self.cells**descriptors > MOST_CELLS:
            raise InvalidSettings(
                f"MAPElites: cells = {self.cells} of each of {descriptors} descriptors; allowed: "
                f"{MOST_CELLS:,} in all."
            )
        size, genes = self.cells**descriptors, self.search_space.size
        require_memory(
            f"MAP-Elites with {size:,} cells for {genes} genes",
            archive_bytes(size, genes, max(self.initial_size, self.batch_size)),
        )
        empty = Archive(
            genome=jnp.zeros((size, genes)),
            fitness=jnp.full(size, WORST_FITNESS, jnp.float32),
            descriptor=jnp.zeros((size, descriptors)),
            filled=jnp.zeros(size, bool),
            best_ever=BestEver(candidates[0], jnp.float32(WORST_FITNESS)),
            diverged=jnp.int32(0),
        )
        return self.tell(key, empty, candidates, self.evaluate(key, candidates))

    def metrics(self, state: Archive) -> Metrics:
        """The numbers of an update.

        The `best` fitness, also as `episode_return`; the `mean` of the elites (0 if there are
        none); `coverage`, the share of cells that are filled; `qd_score`, the sum of the elites'
        fitness above `least_fitness`; how many candidates have `diverged`.
        """
        above = jnp.where(state.filled, state.fitness - self.least_fitness, 0.0)
        return fitness_metrics(state.best_ever.fitness, state.fitness) | {
            "coverage": state.filled.mean(),
            "qd_score": above.sum(),
            "diverged": state.diverged,
        }

    def ask(self, key: Key[Array, ""], state: Archive) -> Float[Array, "candidate gene"]:
        """Children of elites; genomes drawn at random as long as there are none."""
        for_parents, for_change, for_line, for_nobody = jax.random.split(key, 4)
        chosen = drawn_where(for_parents, state.filled, 2 * self.batch_size)
        parent, other = take(state.genome, chosen).reshape(2, self.batch_size, -1)
        change = self.mutation_scale * jax.random.normal(for_change, parent.shape)
        along = self.line_scale * jax.random.normal(for_line, (self.batch_size, 1))
        child = parent + change + along * (other - parent)
        nobodys = self.search_space.sample(for_nobody, self.batch_size)
        return jnp.where(state.filled.any(), self.search_space.clip(child), nobodys)

    def tell(
        self,
        key: Key[Array, ""],
        state: Archive,
        candidates: Float[Array, "candidate gene"],
        evaluation: Evaluation,
    ) -> Archive:
        """The archive with those that are fitter than the elites of their cells, or the first."""
        evaluation = with_worst(evaluation)
        descriptor, fitness = required_descriptor(self.fitness, evaluation), evaluation.fitness
        sound = ~evaluation.diverged & jnp.isfinite(descriptor).all(-1)
        cell = self.cell_of(descriptor)
        size, number = state.filled.size, fitness.size
        rank = jnp.argsort(best_first(key, fitness))
        nobody = jnp.full(size, number, rank.dtype)
        first = least(nobody, jnp.where(sound, cell, size), rank)
        enters = sound & (take(first, cell) == rank) & (fitness > take(state.fitness, cell))
        at = jnp.where(enters, cell, size)  # beyond the end: nothing is written
        return Archive(
            genome=state.genome.at[at].set(candidates, mode="drop"),
            fitness=state.fitness.at[at].set(fitness, mode="drop"),
            descriptor=state.descriptor.at[at].set(descriptor, mode="drop"),
            filled=state.filled.at[at].set(True, mode="drop"),
            best_ever=state.best_ever.after(candidates, fitness),
            diverged=evaluation.diverged.sum(),
        )

    def cell_of(self, descriptor: Float[Array, "candidate descriptor"]) -> Int[Array, "candidate"]:
        """The number of the cell that each descriptor falls into; 0 where it is not finite."""
        share = (descriptor - self.descriptor_low) / (self.descriptor_high - self.descriptor_low)
        share = jnp.nan_to_num(share, nan=0.0)
        place = jnp.clip(jnp.floor(share * self.cells), 0, self.cells - 1).astype(jnp.int32)
        descriptors = descriptor.shape[-1]
        steps = [self.cells ** (descriptors - 1 - number) for number in range(descriptors)]
        return place @ jnp.asarray(steps, jnp.int32)

    def _descriptors(self, candidates: Float[Array, "candidate gene"]) -> int:
        """How many descriptors the fitness has."""
        found = jax.eval_shape(self.fitness, jax.random.key(0), candidates)
        return int(required_descriptor(self.fitness, found).shape[-1])


def required_descriptor(fitness: object, evaluation: Evaluation) -> Any:
    """The descriptor of an evaluation, or of the shapes of one.

    Raises:
        InvalidSettings: there is none.

    """
    if evaluation.descriptor is None:
        raise InvalidSettings(
            f"MAPElites: the fitness {type(fitness).__name__} describes no behaviour; allowed: one "
            "whose Evaluation has a `descriptor`, a few numbers for each candidate."
        )
    return evaluation.descriptor


def drawn_where(key: Key[Array, ""], flags: Bool[Array, "cell"], number: int) -> Int[Array, "draw"]:
    """Numbers of cells whose flag is up, each as likely as any other; where none is, any."""
    order = jnp.argsort(~flags, stable=True)  # those that are up come first
    last = jnp.maximum(flags.sum(), 1)
    return take(order, jax.random.randint(key, (number,), 0, last))


def archive_bytes(cells: int, genes: int, candidates: int) -> int:
    """Memory of an archive before and after an update, and of the candidates.

    What the fitness function needs is not among it.
    """
    return 4 * genes * (2 * cells + 6 * candidates) + 40 * cells
