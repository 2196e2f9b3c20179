"""How robots move, as vectors that can be compared (thesis, section 5.4.1).

The behaviour of a run is that of its best robot: the magnitudes of the discrete Fourier transforms
of its centre of mass' x and of its z, one after the other.  Behaviours are compared by Euclidean
distance.

Deviations from the thesis.  Paths are sampled every so many steps (`record_every`, 25), not at
each: frequencies above half of the sampling's (140 Hz; robots are driven at 40 Hz) are folded
back.  Magnitudes are divided by the number of samples, so that they are in the path's unit,
however it was sampled; distances between behaviours shrink by a common factor, and neither
silhouettes nor maps change.
"""

from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.spatial.distance import cdist, pdist, squareform

LEAST_MAPPED = 4  # behaviours that a map needs
PERPLEXITY = 30.0  # of t-SNE, and at most a third of the behaviours

Behaviours = Float[np.ndarray, "run coefficient"]


def behaviours(path: Float[np.ndarray, "run axis sample"]) -> Behaviours:
    """The vector d of each run, in the unit of its path."""
    magnitude = np.abs(np.fft.fft(np.asarray(path, float), norm="forward"))
    return magnitude.reshape(len(path), -1)


class Silhouettes(NamedTuple):
    """Of two kinds of run, those of each."""

    one: Float[np.ndarray, "run"]
    other: Float[np.ndarray, "run"]


def silhouettes(one: Behaviours, other: Behaviours) -> Silhouettes:
    """How much nearer each run is to its own kind than to the other (Rousseeuw, 1987).

    (b - a) / max(a, b), with a the mean distance to the others of its kind and b that to the other
    kind: 1 where kinds are far apart, 0 where they are one cloud, negative where a run would
    rather be of the other.  A run that is alone of its kind has 0.
    """
    across = cdist(one, other)
    return Silhouettes(_silhouettes(one, across.mean(1)), _silhouettes(other, across.mean(0)))


def _silhouettes(own: Behaviours, to_other: Float[np.ndarray, "run"]) -> Float[np.ndarray, "run"]:
    if len(own) == 1:
        return np.zeros(1)
    to_own = cdist(own, own).sum(1) / (len(own) - 1)
    larger = np.maximum(to_own, to_other)
    return np.divide(to_other - to_own, larger, out=np.zeros(len(own)), where=larger > 0)


def spreads(runs: Behaviours) -> Float[np.ndarray, "run"]:
    """How far each run is from the mean behaviour of its kind (Anderson, 2006).

    Stretched by sqrt(n / (n - 1)), as the mean is nearer to few runs than to many; undefined for
    a run that is alone.
    """
    if len(runs) == 1:
        return np.full(1, np.nan)
    away = np.linalg.norm(runs - runs.mean(0), axis=1)
    return away * np.sqrt(len(runs) / (len(runs) - 1))


def maps_available() -> bool:
    """Whether there is what draws maps: scikit-learn, of the extra `analysis`."""
    return find_spec("sklearn") is not None


def scaled(runs: Behaviours) -> Float[np.ndarray, "run 2"]:
    """Multidimensional scaling: a plane in which distances are as near as can be to the true ones.

    Metric scaling by majorisation (SMACOF), which starts from classical scaling (Torgerson, 1952;
    Cox and Cox, 2000): the same map each time.
    """
    from sklearn.manifold import smacof

    start = _classical(runs)
    size = np.sqrt(np.mean(pdist(runs) ** 2))
    if size == 0:
        return start
    distances = squareform(pdist(runs)) / size
    found, _ = smacof(
        distances, init=start / size, n_init=1, random_state=0, normalized_stress=False
    )
    return size * found


def _classical(runs: Behaviours) -> Float[np.ndarray, "run 2"]:
    """Of Euclidean distances, classical scaling is the first two principal components."""
    left, size, _ = np.linalg.svd(runs - runs.mean(0), full_matrices=False)
    found = left[:, :2] * size[:2]
    largest = np.take_along_axis(found, np.abs(found).argmax(0)[None], 0)
    return found * np.where(largest < 0, -1.0, 1.0)  # a singular vector has no sign of its own


def embedded(runs: Behaviours) -> Float[np.ndarray, "run 2"]:
    """t-SNE (van der Maaten and Hinton, 2008): who is near to whom; far distances mean little."""
    from sklearn.manifold import TSNE

    if np.ptp(runs, axis=0).max() == 0:
        return np.zeros((len(runs), 2))
    perplexity = min(PERPLEXITY, (len(runs) - 1) / 3)
    found = TSNE(perplexity=perplexity, method="exact", init="pca", random_state=0)
    return np.asarray(found.fit_transform(runs), float)
