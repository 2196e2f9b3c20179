import jax
import numpy as np
import pytest

from ethogram.core.errors import InvalidSettings
from ethogram.core.search_space import SearchSpace


def test_samples_lie_within_the_ranges_and_clipped_genomes_within_the_limits():
    space = SearchSpace(
        np.array([0.0, -3.0]), np.array([1.0, 3.0]), np.full(2, -5.0), np.full(2, 4.0)
    )
    drawn = space.sample(jax.random.key(0), 1000)
    assert drawn.shape == (1000, space.size) == (1000, 2)
    np.testing.assert_allclose(drawn.min(0), [0, -3], atol=0.05)
    np.testing.assert_allclose(drawn.max(0), [1, 3], atol=0.05)
    np.testing.assert_array_equal(
        space.clip(10 * drawn - 5)[:, 0], np.clip(10 * drawn - 5, -5, 4)[:, 0]
    )


@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        (([0.0, 1.0], [1.0, 0.5], [0.0, 0.0], [1.0, 1.0]), "gene 1 is drawn from 1.0 to 0.5"),
        (([0.0], [1.0], [0.5], [1.0]), "gene 0 .* limited to 0.5 to 1.0"),
        (([0.0], [np.inf], [0.0], [np.inf]), "gene 0 .* finite"),
        (([0.0], [1.0, 1.0], [0.0], [1.0]), "one range for each gene"),
        (([], [], [], []), "at least one"),
    ],
)
def test_ranges_that_no_gene_fits_are_refused(bounds, message):
    with pytest.raises(InvalidSettings, match=message):
        SearchSpace(*map(np.array, bounds))
