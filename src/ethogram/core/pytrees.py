"""State as named arrays and back, for checkpoints."""

from typing import Any, TypeVar

import jax
import numpy as np

T = TypeVar("T")


def to_arrays(tree: Any) -> dict[str, np.ndarray]:
    """Every array of a tree under its path; random keys as their data."""
    return {
        jax.tree_util.keystr(path, simple=True, separator="."): np.asarray(_plain(leaf))
        for path, leaf in jax.tree_util.tree_leaves_with_path(tree)
    }


def from_arrays(like: T, arrays: dict[str, np.ndarray]) -> T:
    """The tree that `to_arrays` took apart, in the structure of `like`.

    Raises:
        ValueError: an array is missing or has another shape or type.

    """

    def put_back(path: Any, leaf: Any) -> Any:
        name = jax.tree_util.keystr(path, simple=True, separator=".")
        plain = _plain(leaf)
        found = arrays.get(name)
        if found is None or found.shape != plain.shape or found.dtype != plain.dtype:
            raise ValueError(f"{name}: expected {plain.dtype}{plain.shape}")
        value = jax.numpy.asarray(found)
        return jax.random.wrap_key_data(value) if _is_key(leaf) else value

    return jax.tree_util.tree_map_with_path(put_back, like)


def _is_key(leaf: Any) -> bool:
    return jax.numpy.issubdtype(leaf.dtype, jax.dtypes.prng_key)


def _plain(leaf: Any) -> Any:
    return jax.random.key_data(leaf) if _is_key(leaf) else leaf
