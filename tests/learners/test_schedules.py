import jax.numpy as jnp
import numpy as np

from ethogram.learners.schedules import Constant, ExponentialDecay, Linear


def test_schedules_fall_from_their_start_to_their_end():
    decay = ExponentialDecay(1.0, 0.01, 0.9995)
    np.testing.assert_allclose(decay(jnp.int32(0)), 1.0)
    np.testing.assert_allclose(decay(jnp.int32(100)), 0.9995**100, rtol=1e-4)
    assert decay(jnp.int32(9207)) > 0.01
    np.testing.assert_allclose(decay(jnp.int32(9209)), 0.01)  # as the thesis' numbers imply
    linear = Linear(1.0, 0.2, 10)
    np.testing.assert_allclose([linear(jnp.int32(at)) for at in (0, 5, 50)], [1.0, 0.6, 0.2])
    np.testing.assert_allclose(Constant(0.3)(jnp.int32(7)), 0.3)
