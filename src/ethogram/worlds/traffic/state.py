"""What there is on the roads of chapter 4 at one moment."""

import equinox as eqx
from jax import Array
from jaxtyping import Bool, Float, Int


class State(eqx.Module):
    """Cars: where they are, how fast, and what has become of them."""

    element: Int[Array, "car"]  # p: sections first, then vertices
    position: Float[Array, "car"]  # x, m along the element
    lane: Int[Array, "car"]  # y, from 1, the rightmost
    speed: Float[Array, "car"]  # v_x, m/s
    exit: Int[Array, "car"]  # the element that comes next
    dead: Int[Array, "car"]  # steps for which it is still dead; 0 = alive
    impact: Int[Array, "car"]  # of a dead car: 1 if it was hit from behind, -1 if it hit
    spared_by: Int[Array, "car 4"]  # cars overlapped when restored, and since then; -1 for none
    present: Bool[Array, "car"]  # on the road: neither removed nor padding
    time: Int[Array, ""]  # steps since the start

    @property
    def alive(self) -> Bool[Array, "car"]:
        """Whether a car is driven by its driver."""
        return self.present & (self.dead == 0)

    @property
    def immune(self) -> Bool[Array, "*batch car"]:
        """Whether any car spares it that it overlaps."""
        return (self.spared_by >= 0).any(-1)


class Road(eqx.Module):
    """The graph as the arrays that a step computes with, and the sizes that all cars share."""

    length: Float[Array, "element"]  # l(p), m
    lanes: Int[Array, "element"]  # w(p)
    following: Int[Array, "element out"]  # n(p), padded with the number of elements
    preceding: Int[Array, "element in"]  # padded alike
    end: Int[Array, "element"]  # of a section, the vertex at its end
    exits: Int[Array, "element choice"]  # of a section, those that can be taken at its end
    choices: Int[Array, "element"]
    sections: int = eqx.field(static=True)
    max_lanes: int = eqx.field(static=True)
