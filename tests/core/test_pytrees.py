import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.pytrees import from_arrays, to_arrays


def test_a_tree_comes_back_from_its_arrays_with_keys_and_all():
    tree = {"table": {"agent": jnp.arange(6.0).reshape(2, 3)}, "key": jax.random.key(4)}
    arrays = to_arrays(tree)
    assert all(isinstance(array, np.ndarray) for array in arrays.values())
    back = from_arrays(tree, arrays)
    np.testing.assert_array_equal(back["table"]["agent"], tree["table"]["agent"])
    assert jax.random.bits(back["key"]) == jax.random.bits(tree["key"])


def test_an_array_of_another_shape_is_refused_by_name():
    with pytest.raises(ValueError, match=r"table: expected float32\(2,\)"):
        from_arrays({"table": jnp.zeros(2)}, {"table": np.zeros(3, np.float32)})
