import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ethogram.core.batching import add, in_any_copy, put, take

rng = np.random.default_rng(0)
VALUES = jnp.asarray(rng.integers(0, 100, (3, 2, 7)))
INDEX = jnp.asarray(rng.integers(0, 7, (3, 2, 4)))
NEW = jnp.asarray(rng.integers(0, 100, (3, 2, 4)))


def each(function, *arrays):
    """One vector after the other."""
    places = [(row, column) for row in range(3) for column in range(2)]
    found = [function(*(array[place] for array in arrays)) for place in places]
    return jnp.stack(found).reshape(3, 2, -1)


def batched(function):
    return jax.vmap(jax.vmap(function))


def test_a_batch_of_batches_is_read_and_written_as_its_vectors_are():
    np.testing.assert_array_equal(batched(take)(VALUES, INDEX), each(take, VALUES, INDEX))
    found = batched(add)(VALUES, INDEX, NEW)
    np.testing.assert_array_equal(found, each(add, VALUES, INDEX, NEW))
    distinct = jnp.broadcast_to(jnp.array([6, 0, 3, 2]), INDEX.shape)
    found = batched(put)(VALUES, distinct, NEW)
    np.testing.assert_array_equal(found, each(put, VALUES, distinct, NEW))


def test_rows_of_a_batch_of_matrices_are_read_as_those_of_each():
    matrices = jnp.stack([VALUES, -VALUES], -1)
    found = jax.vmap(jax.vmap(take))(matrices, INDEX)
    expected = np.take_along_axis(np.asarray(matrices), np.asarray(INDEX)[..., None], 2)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("axes", [(0, None), (None, 0), (0, 0)])
def test_any_part_of_a_read_can_be_batched(axes):
    values = VALUES[0] if axes[0] == 0 else VALUES[0, 0]
    index = INDEX[0] if axes[1] == 0 else INDEX[0, 0]
    found = jax.vmap(take, axes)(values, index)
    for copy in range(2):
        own = values[copy] if axes[0] == 0 else values
        np.testing.assert_array_equal(found[copy], own[index[copy] if axes[1] == 0 else index])


@pytest.mark.parametrize("write", [put, add])
def test_what_is_written_beyond_the_end_is_dropped_and_reaches_no_neighbour(write):
    values, beyond = jnp.zeros((3, 4), int), jnp.array([[4], [7], [3]])
    found = jax.vmap(write)(values, beyond, jnp.ones((3, 1), int))
    assert found.tolist() == [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]
    assert write(values[0], beyond[0], jnp.ones(1, int)).tolist() == [0, 0, 0, 0]


def test_a_flag_in_any_copy_is_one_answer_for_all():
    flags = jnp.array([[False, True], [False, False]])
    assert jax.vmap(jax.vmap(in_any_copy))(flags).tolist() == [[True, True], [True, True]]
    assert not jax.vmap(in_any_copy)(jnp.zeros(3, bool)).any()
