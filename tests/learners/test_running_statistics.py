import jax.numpy as jnp
import numpy as np

from ethogram.learners.running_statistics import RunningStatistics


def test_statistics_of_batches_are_those_of_all_that_counts_in_them():
    draw = np.random.default_rng(0)
    batches = draw.normal(50.0, 3.0, size=(4, 30, 2)).astype(np.float32)
    counted = draw.random((4, 30, 2)) < 0.7
    statistics = RunningStatistics.of_nothing(2)
    for batch, counts in zip(batches, counted, strict=True):
        statistics = statistics.after(jnp.asarray(batch), jnp.asarray(counts))
    for i in range(2):
        seen = batches[:, :, i][counted[:, :, i]]
        assert statistics.count[i] == len(seen)
        np.testing.assert_allclose(statistics.mean[i], seen.mean(), rtol=1e-5)
        np.testing.assert_allclose(statistics.deviation[i], seen.std(), rtol=1e-4)


def test_of_nothing_values_are_as_they_are_and_clipped():
    statistics = RunningStatistics.of_nothing(1)
    assert (statistics.after(jnp.ones((3, 1)), jnp.zeros((3, 1), bool)).count == 0).all()
    np.testing.assert_allclose(statistics.normalized(jnp.array([-20.0, 2.0]), 10.0), [-10, 2])


def test_values_that_never_change_are_0():
    statistics = RunningStatistics.of_nothing().after(jnp.full(5, 3.0), jnp.ones(5, bool))
    np.testing.assert_allclose(statistics.normalized(jnp.array(3.0), 10.0), 0, atol=1e-6)
