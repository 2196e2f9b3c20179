"""Bodies from genes, and how critical they are: the original's numbers, laws, and hand-work."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ethogram.core.errors import InvalidSettings
from ethogram.worlds.softbody.avalanche_scene import ACTIVE, BEEN, avalanche_scene
from ethogram.worlds.softbody.bodies import PLANE, cells_of, text_of
from ethogram.worlds.softbody.criticality import (
    avalanches_of,
    criticality,
    power_law,
    threshold,
)
from ethogram.worlds.softbody.growth import grown, random_body, require_room, walked_body

REFERENCE = json.loads(
    (Path(__file__).parents[1] / "physics/reference/softbody2d.json").read_text()
)


@pytest.mark.parametrize("name", REFERENCE["bodies"])
def test_scores_are_those_of_the_original(name):
    expected = REFERENCE["bodies"][name]
    found = criticality(np.array(expected["sizes"]), 20)
    for mine, its in (("score", "f"), ("r_squared", "r2"), ("distance", "ks"), ("slope", "slope")):
        assert getattr(found, mine) == pytest.approx(expected[its], abs=6e-4)


def test_a_straight_line_scores_the_most_and_one_size_nothing():
    # counts 8, 4, 2, 1 of sizes 1, 2, 4, 8 fall on log c = log 8 - log s; other sizes count as once
    straight = np.repeat([1, 2], [2, 1])
    assert criticality(straight, 2).score == pytest.approx(2.0)
    assert criticality(np.array([3, 3, 3]), 3).score == 0


def test_the_threshold_falls_with_the_voxels_and_never_rises():
    values = [threshold(n) for n in range(1, 200)]
    assert (np.diff(values) <= 0).all()
    assert threshold(20) == pytest.approx(
        6.092750496194226e-3 - 20 * 1.4273597198968677e-4 + 400 * 9.238294116972325e-7
    )


def test_the_most_likely_power_law_is_the_one_that_sizes_were_drawn_from():
    support = np.arange(1, 51)
    weight = support**-1.5
    sizes = np.random.default_rng(0).choice(support, 4000, p=weight / weight.sum())
    found = power_law(sizes, 50, samples=50)
    assert found.exponent == pytest.approx(1.5, abs=0.05)
    assert found.p_value > 0.1


def test_sizes_about_a_mean_are_no_power_law():
    sizes = np.random.default_rng(0).binomial(40, 0.5, 200)
    assert power_law(sizes, 40, samples=50).p_value < 0.1


def is_connected(cells):
    left = {tuple(cell) for cell in cells.tolist()}
    reached = [left.pop()]
    while reached:
        x, y = reached.pop()
        for beside in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if beside in left:
                left.remove(beside)
                reached.append(beside)
    return not left


@given(seed=st.integers(0, 2**32 - 1), voxels=st.integers(1, 20))
def test_grown_bodies_hang_together_and_have_as_many_voxels_as_were_wanted_or_more(seed, voxels):
    genes = np.random.default_rng(seed).random(36)
    cells = grown(genes, voxels)
    assert voxels <= len(cells) < 4 * voxels + 1
    assert is_connected(cells)
    assert (cells.min(0) == 0).all()
    assert len(set(map(tuple, cells.tolist()))) == len(cells)


def test_genes_grow_the_cells_of_the_greatest_first():
    # rows from below; 9 and 8 lie apart, 7 joins nothing, 6 joins 9 and 8
    genes = np.array([9, 0, 7, 6, 0, 0, 8, 0, 0]) / 10
    assert text_of(grown(genes, 1)) == "#"
    assert text_of(grown(genes, 3)) == "#/#/#"


def test_walks_visit_as_many_cells_as_are_wanted():
    rng = np.random.default_rng(3)
    for voxels in (1, 2, 20):
        cells = walked_body(rng, voxels)
        assert len(cells) == voxels
        assert is_connected(cells)


@pytest.mark.parametrize(("cells", "voxels"), [(10, 3), (9, 10), (9, 0)])
def test_a_grid_that_holds_no_body_is_refused(cells, voxels):
    with pytest.raises(InvalidSettings, match=f"A grid of {cells} cells cannot hold a body"):
        require_room(cells, voxels)


def test_bodies_of_many_sizes_are_measured_together_as_alone():
    rng = np.random.default_rng(0)
    bodies = [random_body(rng, 4, 5), walked_body(rng, 4), cells_of("##/##/##", axes=PLANE)]
    together = avalanches_of(bodies, [2e-3] * 3)
    for body, (size, duration) in zip(bodies, together, strict=True):
        ((alone, lasted),) = avalanches_of([body], [2e-3])
        np.testing.assert_array_equal(size, alone)
        np.testing.assert_array_equal(duration, lasted)
        assert size.shape == (len(body),)
    with pytest.raises(InvalidSettings, match="2 thresholds for 3 bodies"):
        avalanches_of(bodies, [1e-3] * 2)


def test_a_scene_shows_as_many_active_voxels_as_the_avalanche_has():
    cells = cells_of("####/####", axes=PLANE)
    ((size, duration),) = avalanches_of([cells])
    scene = avalanche_scene(cells, "a box")
    for chapter in dict.fromkeys(scene.chapters):
        drive = int(chapter.split()[1]) - 1
        frames = np.array([each == chapter for each in scene.chapters])
        tint = scene.tint[frames]
        assert (tint[-1] == BEEN).sum() == size[drive]
        assert (tint == ACTIVE).any(1).sum() == duration[drive]
        assert scene.series["size so far"][frames][-1, 0] == size[drive]
