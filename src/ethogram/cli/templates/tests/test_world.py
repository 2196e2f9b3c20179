"""The world: steps worked by hand."""

import jax
import jax.numpy as jnp
import pytest

import ethogram


@pytest.mark.parametrize(("pooled", "eaten"), [(0.0, [0.625, 1.25]), (1.0, [0.9375, 0.9375])])
def test_a_herder_that_grazes_hard_eats_more_unless_all_is_pooled(
    pooled: float, eaten: list[float]
) -> None:
    world = ethogram.make("grazing", herders=2, pooled=pooled)
    grass, outcome = jax.jit(world.step)(jax.random.key(1), 1.0, {"herder": jnp.array([0, 1])})
    assert float(grass) == pytest.approx(0.625)  # 1 - 0.75 / 2
    assert outcome.reward["herder"].tolist() == pytest.approx(eaten)
    assert outcome.terminated["herder"].all()
