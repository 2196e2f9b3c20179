"""The compact rows of a table over what a sharing agent can observe.

What all agents see alike, the filling and the words heard, is a vector of counts per resource:

    c_j  speakers that are on j and want j            v_j = (n_a + 1) c_j + d_j   (eq. 3.2)
    d_j  speakers that want j and are elsewhere
    x_j  other agents on j                            rho_j = c_j + x_j

With n = n_a - sum(c) agents that are not settled speakers, the counts that can occur together
are those with sum(x) <= n, sum(d) <= n (= n if all speak) and d_j <= n - x_j: those who want j
from elsewhere are not on j.  (Hall's condition: any two resources together can be reached from
every place, so only single resources constrain.)  `joint_rows` counts them in closed form;
`Ranking` numbers them in lexicographic order with one small table per count, so that no table
over the product of the ranges is ever built.  For ten agents and two resources they number
21 021, where the product of the ranges of eq. 3.2 has 1 464 100 entries.
"""

from collections.abc import Iterator
from functools import cache
from math import comb
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array
from jaxtyping import Int

Communication = Literal["always", "optional", "none"]


class Group(NamedTuple):
    """What decides which counts can occur."""

    agents: int
    resources: int
    communication: Communication
    observe_filling: bool


class Partial(NamedTuple):
    """What the counts fixed so far leave for the next ones."""

    loose: int  # n: agents that are not settled speakers
    places: int  # of these, not yet counted as standing on a resource
    voices: int  # of these, not yet counted as speakers
    elsewhere: int  # of these, not on the resource in hand


def joint_rows(group: Group) -> int:
    """How many combinations of filling and words heard can occur, in closed form."""
    n_a, n_r, communication, observed = group
    if communication == "none":
        return comb(n_a + n_r, n_r) if observed else 1
    short = 1 if communication == "always" else 0  # sum(d) = n has one degree of freedom less
    if not observed:
        return comb(n_a + 2 * n_r - short, 2 * n_r - short)
    # with c, x and d free of each other, for each n
    free = sum(
        comb(n_a - n + n_r - 1, n_r - 1) * comb(n + n_r, n_r) * comb(n + n_r - short, n_r - short)
        for n in range(n_a + 1)
    )
    # d_j > n - x_j: for one j at a time, since x_i + x_j <= n; summed by Vandermonde's identity
    barred = n_r * comb(n_a - 1 + 3 * n_r - short, 3 * n_r - short)
    return free - barred


class Ranking(NamedTuple):
    """Numbers each possible vector of counts: a walk through one table per count.

    Standing at `state`, count number k adds `weight[k][state, count]` (how many possible vectors
    come before) and leads to `following[k][state, count]`.
    """

    order: tuple[int, ...]  # which entry of (c, x, d) each step reads
    weight: tuple[np.ndarray, ...]  # Int[states, n_a + 1] per step
    following: tuple[np.ndarray, ...]  # Int[states, n_a + 1] per step

    def __call__(self, counts: Int[Array, "counts"]) -> Int[Array, ""]:
        """Rank a vector (c_1.., x_1.., d_1..) that can occur."""
        row = jnp.int32(0)
        state = jnp.int32(0)
        for entry, weight, following in zip(self.order, self.weight, self.following, strict=True):
            place = (state, counts[entry])
            row = row + jnp.asarray(weight).at[place].get(mode="promise_in_bounds")
            state = jnp.asarray(following).at[place].get(mode="promise_in_bounds")
        return row


@cache
def ranking(group: Group) -> Ranking:
    """Build the tables, from the last count back to the first."""
    order = _order(group)
    layers: list[dict[Partial, dict[int, Partial]]] = []
    states = {Partial(group.agents, group.agents, group.agents, 0)}
    for entry in order:
        layers.append({state: dict(_choices(group, entry, state)) for state in sorted(states)})
        states = {after for moves in layers[-1].values() for after in moves.values()}
    completions = {state: int(_complete(group, state)) for state in states}
    number = dict.fromkeys(states, 0)
    weights: list[np.ndarray] = []
    followings: list[np.ndarray] = []
    for layer in reversed(layers):
        weight = np.zeros((len(layer), group.agents + 1), np.int32)
        following = np.zeros_like(weight)
        totals = {}
        for index, (state, moves) in enumerate(layer.items()):
            before = 0
            for count, after in moves.items():
                weight[index, count] = before
                following[index, count] = number[after]
                before += completions[after]
            totals[state] = before
        completions = totals
        number = {state: index for index, state in enumerate(layer)}
        weights.append(weight)
        followings.append(following)
    return Ranking(order, tuple(reversed(weights)), tuple(reversed(followings)))


def _order(group: Group) -> tuple[int, ...]:
    """Entries of (c, x, d) that vary and are seen: first all c, then x and d in turn."""
    n_r = group.resources
    speak, see = group.communication != "none", group.observe_filling
    settled = tuple(range(n_r)) if speak else ()
    pairs = ((n_r + j,) * see + (2 * n_r + j,) * speak for j in range(n_r))
    return settled + tuple(entry for pair in pairs for entry in pair)


def _choices(group: Group, entry: int, state: Partial) -> Iterator[tuple[int, Partial]]:
    """Values that a count may take after those fixed so far, and what each leaves."""
    kind = entry // group.resources
    loose, places, voices, elsewhere = state
    if kind == 0:  # c
        for count in range(loose + 1):
            left = loose - count
            yield count, Partial(left, left, left, left if not group.observe_filling else 0)
    elif kind == 1:  # x
        for count in range(places + 1):
            yield count, Partial(loose, places - count, voices, loose - count)
    else:  # d
        beyond = loose if not group.observe_filling else 0
        for count in range(min(voices, elsewhere) + 1):
            yield count, Partial(loose, places, voices - count, beyond)


def _complete(group: Group, state: Partial) -> bool:
    """Whether the counts fixed can be all of them: if all must speak, all have."""
    return group.communication != "always" or state.voices == 0
