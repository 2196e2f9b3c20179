import builtins
import sys

import numpy as np
import pytest
import scipy.stats
from scipy.spatial.distance import pdist

from ethogram.studies.sensing import behaviour
from ethogram.studies.sensing.behaviour import (
    behaviours,
    embedded,
    maps_available,
    scaled,
    silhouettes,
    spreads,
)

needs_maps = pytest.mark.skipif(not maps_available(), reason="scikit-learn is not here")


def clouds(seed=0, apart=2.0, wide=1.0, runs=(7, 5), size=6):
    """Two kinds of behaviours, around 0 and around `apart`, the second `wide` times as wide."""
    rng = np.random.default_rng(seed)
    one, other = (rng.normal(size=(count, size)) for count in runs)
    return one, apart + wide * other


# The vector


def test_a_behaviour_is_the_magnitudes_of_both_transforms_worked_by_hand():
    # x: 0, 4, 0, -4 is a sine of one cycle: coefficients 0, -8i, 0, 8i of 4 samples.
    # z: 3 everywhere is its mean alone: 12 of 4 samples.
    path = np.array([[[0, 4, 0, -4], [3, 3, 3, 3]]], float)
    np.testing.assert_allclose(behaviours(path), [[0, 2, 0, 2, 3, 0, 0, 0]], atol=1e-15)


def test_a_behaviour_does_not_know_when_a_gait_began():
    time = np.arange(64)
    early, late = (np.sin(2 * np.pi * 5 * (time + lag) / 64) for lag in (0, 7))
    flat = np.full(64, 0.01)
    one, other = behaviours(np.array([[early, flat], [late, flat]]))
    np.testing.assert_allclose(one, other, atol=1e-12)
    assert np.argsort(one[:64])[-2:].tolist() in ([5, 59], [59, 5])


def test_sampling_a_slow_path_less_often_leaves_its_behaviour_as_far_from_others():
    time = np.arange(400) / 400
    paths = np.stack([[2 * np.cos(8 * np.pi * time), 1 + 0 * time], [0 * time, 3 + 0 * time]])
    often, seldom = (pdist(behaviours(paths[..., ::every])) for every in (1, 5))
    np.testing.assert_allclose(often, seldom)


def test_a_path_that_is_not_finite_gives_a_behaviour_that_is_not_and_harms_no_other():
    path = np.ones((2, 2, 8))
    path[0, 1, 5:] = np.nan
    found = behaviours(path)
    assert np.isnan(found[0, 8:]).all()
    assert np.isfinite(found[1]).all()


# Silhouettes and spread


def test_silhouettes_are_those_worked_by_hand():
    one, other = np.array([[0.0], [2.0]]), np.array([[5.0], [6.0], [7.0]])
    # 0: a = 2, b = 6; 2: a = 2, b = 4; 5: a = 1.5, b = 4; 6: a = 1, b = 5; 7: a = 1.5, b = 6
    found = silhouettes(one, other)
    np.testing.assert_allclose(found.one, [4 / 6, 2 / 4])
    np.testing.assert_allclose(found.other, [2.5 / 4, 4 / 5, 4.5 / 6])


def test_silhouettes_are_those_of_scikit_learn():
    metrics = pytest.importorskip("sklearn.metrics")
    one, other = clouds()
    labels = np.repeat([0, 1], [len(one), len(other)])
    reference = metrics.silhouette_samples(np.concatenate([one, other]), labels)
    np.testing.assert_allclose(np.concatenate(silhouettes(one, other)), reference)


def test_a_run_that_is_alone_of_its_kind_or_like_all_others_has_a_silhouette_of_zero():
    alone = silhouettes(np.ones((1, 3)), np.zeros((2, 3)))
    assert (alone.one, alone.other.tolist()) == (0, [1, 1])
    same = silhouettes(np.ones((2, 3)), np.ones((4, 3)))
    assert not np.concatenate(same).any()


def test_one_cloud_in_two_has_no_silhouette_and_two_clouds_have_one():
    mixed = [np.mean(silhouettes(*clouds(seed, apart=0.0)).one) for seed in range(200)]
    assert abs(np.mean(mixed)) < 0.03
    assert silhouettes(*clouds(apart=20.0)).one.min() > 0.8


def test_a_narrow_cloud_inside_a_wide_one_has_a_silhouette_and_the_wide_one_none():
    narrow, wide = silhouettes(*clouds(apart=0.0, wide=10.0, runs=(30, 30)))
    assert np.concatenate([narrow, wide]).mean() > 0.2  # which is why claim 5 asks for both
    assert wide.mean() < 0 < narrow.mean()


def test_spread_is_the_distance_from_the_mean_worked_by_hand():
    runs = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]])  # around (1, 1)
    expected = np.sqrt([2, 2, 4]) * np.sqrt(3 / 2)
    np.testing.assert_allclose(spreads(runs), expected)
    assert np.isnan(spreads(runs[:1])).all()


def test_few_runs_are_as_spread_as_many():
    rng = np.random.default_rng(3)
    few, many = (
        np.mean([spreads(rng.normal(size=(runs, 50))).mean() for _ in range(400)])
        for runs in (3, 30)
    )
    assert few == pytest.approx(many, rel=0.02)


# Maps


@needs_maps
@pytest.mark.parametrize("place", [scaled, embedded])
def test_a_map_is_the_same_each_time_and_keeps_clouds_apart(place):
    runs = np.concatenate(clouds(apart=10.0, runs=(12, 12)))
    found = place(runs)
    assert found.shape == (24, 2)
    np.testing.assert_array_equal(found, place(runs))
    assert min(np.concatenate(silhouettes(found[:12], found[12:]))) > 0.5


@needs_maps
def test_scaling_keeps_the_distances_of_behaviours_that_lie_in_a_plane():
    plane = np.random.default_rng(1).normal(size=(9, 2))
    tilted = 1e-3 * plane @ scipy.stats.ortho_group.rvs(5, random_state=0)[:2]
    np.testing.assert_allclose(pdist(scaled(tilted)), pdist(tilted), rtol=1e-6)


@needs_maps
def test_scaling_is_nearer_to_the_distances_than_the_plane_of_most_variance():
    runs = np.random.default_rng(2).normal(size=(20, 8))
    stress = [
        np.sum((pdist(found) - pdist(runs)) ** 2)
        for found in (scaled(runs), behaviour._classical(runs))
    ]
    assert stress[0] < 0.7 * stress[1]


@needs_maps
@pytest.mark.parametrize("place", [scaled, embedded])
def test_behaviours_that_are_all_alike_lie_in_one_place(place):
    assert not place(np.ones((5, 6))).any()
    few = np.ones((behaviour.LEAST_MAPPED, 6))
    few[0] = 2
    assert np.isfinite(place(few)).all()


def test_nothing_but_maps_needs_scikit_learn(monkeypatch):
    monkeypatch.setattr(behaviour, "find_spec", lambda name: None)
    assert not maps_available()
    real = builtins.__import__

    def refuse(name, *args, **kwargs):
        assert not name.startswith("sklearn"), name
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", refuse)
    for module in [name for name in sys.modules if name.startswith("sklearn")]:
        monkeypatch.delitem(sys.modules, module)
    one, other = clouds()
    assert len(silhouettes(one, other).one) == len(spreads(one)) == 7
    with pytest.raises(AssertionError, match="sklearn"):
        scaled(one)
