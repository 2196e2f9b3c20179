"""Pareto fronts of few individuals."""

import jax.numpy as jnp
from jax import Array, lax
from jaxtyping import Bool, Float, Int


def dominance(
    fitness: Float[Array, "individual"], age: Int[Array, "individual"]
) -> Bool[Array, "individual individual"]:
    """Whether the row's individual dominates the column's.

    It is at least as fit and at most as old, and fitter or younger.
    """
    fit, young = fitness[:, None] >= fitness, age[:, None] <= age
    return fit & young & ((fitness[:, None] > fitness) | (age[:, None] < age))


def fronts(dominates: Bool[Array, "individual individual"]) -> Int[Array, "individual"]:
    """The front of each individual: 0 where none dominates it, n + 1 where only fronts to n do."""
    size = len(dominates)

    def peel(found: tuple[Array, Array]) -> tuple[Array, Array]:
        front, number = found
        left = front == size
        outermost = left & ~(dominates & left[:, None]).any(0)
        return jnp.where(outermost, number, front), number + 1

    def some_left(found: tuple[Array, Array]) -> Array:
        return (found[0] == size).any()

    start = jnp.full(size, size), jnp.asarray(0)
    return lax.while_loop(some_left, peel, start)[0]
