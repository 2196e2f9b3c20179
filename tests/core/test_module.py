import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ethogram.core.module import Module
from ethogram.worlds.language import Language
from ethogram.worlds.sharing import Sharing

TRACES = []


class Slope(Module):
    rise: jax.Array = eqx.field(converter=jnp.asarray)

    def climb(self, way):
        """How high."""
        TRACES.append(None)
        return self.rise * way

    def climb_twice(self, way):
        return 2 * jax.jit(self.climb)(way)

    def __call__(self, way):
        return self.climb(way)


def traces(run):
    TRACES.clear()
    return float(run()), len(TRACES)


def test_jit_takes_a_method_and_compiles_it_once_for_each_module():
    two, three = Slope(2.0), Slope(3.0)
    climb = jax.jit(two.climb)
    assert traces(lambda: climb(1.0)) == (2.0, 1)
    assert traces(lambda: climb(5.0)) == (10.0, 0)
    assert traces(lambda: jax.jit(two.climb)(1.0)) == (2.0, 0)
    assert traces(lambda: jax.jit(three.climb)(1.0)) == (3.0, 1)
    assert traces(lambda: jax.jit(three)(1.0))[0] == 3.0
    assert traces(lambda: jax.jit(three.climb_twice)(1.0))[0] == 6.0


def test_no_program_is_used_for_the_values_of_another_module():
    """Modules that come and go may stand where another one stood."""
    assert [float(jax.jit(Slope(rise).climb)(1.0)) for rise in range(20)] == [*range(20)]


def test_a_method_given_to_jit_can_be_called_while_jax_traces():
    climb = jax.jit(Slope(2.0).climb)
    climb(1.0)
    assert jax.lax.scan(lambda way, _: (climb(way), None), 1.0, None, 3)[0] == 8.0
    np.testing.assert_array_equal(
        jax.vmap(lambda rise: jax.jit(Slope(rise).climb)(1.0))(jnp.arange(3.0)), [0, 1, 2]
    )


def test_a_method_is_a_tree_of_its_modules_arrays_and_goes_by_its_functions_name():
    climb = Slope(2.0).climb
    assert jax.tree.leaves(climb) == [2.0]
    doubled = jax.tree.map(lambda rise: 2 * rise, climb)
    assert doubled(3.0) == 12.0
    assert traces(lambda: eqx.filter_jit(climb)(1.0))[1] == 1
    assert traces(lambda: eqx.filter_jit(Slope(7.0).climb)(1.0)) == (7.0, 0)
    assert (climb.__name__, climb.__doc__) == ("climb", "How high.")
    assert list(inspect.signature(climb).parameters) == ["way"]


def test_a_module_is_equal_to_itself_alone():
    slope = Slope(2.0)
    assert slope == slope
    assert slope.climb == slope.climb
    assert hash(slope.climb) == hash(slope.climb)
    assert slope != Slope(2.0)
    assert slope.climb != Slope(2.0).climb != slope.climb_twice
    assert eqx.tree_equal(slope, Slope(2.0))


def test_a_module_is_shown_with_the_values_of_its_fields():
    assert repr(Slope(0.1)) == "Slope(rise=0.1)"
    assert repr(Slope(jnp.arange(3))) == "Slope(rise=i32[3])"
    shown = repr(Sharing(agents=3, scenario="mixed"))
    assert shown.startswith("Sharing(scenario='mixed', agents=3, resources=2, steps=100, ")
    assert "delta=0.05, " in repr(Language(dynamics=jump))
    assert "dynamics=jump, " in repr(Language(dynamics=jump))
    jax.jit(lambda rise: Slope(rise).climb(float(len(repr(Slope(rise))))))(1.0)  # tracers, too


def jump(position, velocity, push, delta):
    return position + delta * push, velocity
