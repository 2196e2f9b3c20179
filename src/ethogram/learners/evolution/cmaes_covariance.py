"""The covariance C of CMA-ES: full, separable (diagonal), or isotropic (the identity).

All have the same methods.  C^(1/2) is the symmetric root, which does not depend on the signs and
the order of eigenvectors, so that a run does not either.  In 32 bits eigenvalues below 1e-7 times
the largest are rounding errors: they are raised to that.

Equations are numbered as in Hansen's tutorial (2016, arXiv:1604.00772).
"""

from abc import abstractmethod
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jaxtyping import Float

LEAST_EIGENVALUE = 1e-7  # of the largest


class Change(NamedTuple):
    """What a generation does to a covariance."""

    kept: Float[Array, ""]  # the share of the old one
    path: Float[Array, "gene"]  # p_c
    path_rate: float  # c_1
    steps: Float[Array, "candidate gene"]  # y_i
    step_rates: Float[Array, "candidate"]  # c_mu w_i, with the weights of eq. 46


class Covariance(eqx.Module):
    """A positive definite matrix over genes, and its root of some generations ago."""

    @abstractmethod
    def scaled(self, z: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """C^(1/2) z."""

    @abstractmethod
    def whitened(self, y: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """C^(-1/2) y."""

    @abstractmethod
    def changed(self, change: Change) -> "Covariance":
        """C after a generation (eq. 47); its root is the old one until `decomposed`."""

    @abstractmethod
    def decomposed(self) -> "Covariance":
        """The same C, with the root of it as it is now."""

    @abstractmethod
    def divided(self, unit: Float[Array, ""]) -> "Covariance":
        """C over a number."""

    @abstractmethod
    def eigenvalues(self) -> Float[Array, "value"]:
        """Those of C as it was last decomposed."""

    @abstractmethod
    def variances(self) -> Float[Array, "value"]:
        """The diagonal of C."""


class Full(Covariance):
    """Any covariance: n^2 numbers, and n^3 operations to decompose it."""

    matrix: Float[Array, "gene gene"]
    vectors: Float[Array, "gene gene"]  # B: eigenvectors are its columns
    values: Float[Array, "gene"]  # D^2: eigenvalues

    @classmethod
    def identity(cls, genes: int) -> "Full":
        """The first."""
        return cls(jnp.eye(genes), jnp.eye(genes), jnp.ones(genes))

    def scaled(self, z: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """B D B^T z."""
        return ((z @ self.vectors) * jnp.sqrt(self.values)) @ self.vectors.T

    def whitened(self, y: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """B D^-1 B^T y."""
        return ((y @ self.vectors) / jnp.sqrt(self.values)) @ self.vectors.T

    def changed(self, change: Change) -> "Full":
        """C after a generation."""
        steps = jnp.concatenate([change.steps, change.path[None]])
        rates = jnp.append(change.step_rates, change.path_rate)
        matrix = change.kept * self.matrix + (rates[:, None] * steps).T @ steps  # eq. 47
        return Full(matrix, self.vectors, self.values)

    def decomposed(self) -> "Full":
        """The same C, with its root."""
        values, vectors = jnp.linalg.eigh(self.matrix)  # of its symmetric part
        return Full(self.matrix, vectors, jnp.maximum(values, LEAST_EIGENVALUE * values.max()))

    def divided(self, unit: Float[Array, ""]) -> "Full":
        """C over a number."""
        return Full(self.matrix / unit, self.vectors, self.values / unit)

    def eigenvalues(self) -> Float[Array, "value"]:
        """Those of C as it was last decomposed."""
        return self.values

    def variances(self) -> Float[Array, "value"]:
        """The diagonal of C."""
        return jnp.maximum(jnp.diagonal(self.matrix), 0.0)


class Separable(Covariance):
    """A diagonal covariance: n numbers, and n operations (Ros and Hansen, 2008)."""

    diagonal: Float[Array, "gene"]

    @classmethod
    def identity(cls, genes: int) -> "Separable":
        """The first."""
        return cls(jnp.ones(genes))

    def scaled(self, z: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """C^(1/2) z."""
        return z * jnp.sqrt(self.eigenvalues())

    def whitened(self, y: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """C^(-1/2) y."""
        return y / jnp.sqrt(self.eigenvalues())

    def changed(self, change: Change) -> "Separable":
        """C after a generation."""
        steps = change.step_rates @ change.steps**2
        path = change.path_rate * change.path**2
        return Separable(change.kept * self.diagonal + path + steps)  # eq. 47, its diagonal

    def decomposed(self) -> "Separable":
        """The same C: its root is at hand."""
        return self

    def divided(self, unit: Float[Array, ""]) -> "Separable":
        """C over a number."""
        return Separable(self.diagonal / unit)

    def eigenvalues(self) -> Float[Array, "value"]:
        """Those of C."""
        return jnp.maximum(self.diagonal, LEAST_EIGENVALUE * self.diagonal.max())

    def variances(self) -> Float[Array, "value"]:
        """The diagonal of C."""
        return self.eigenvalues()


class Isotropic(Covariance):
    """The identity: only sigma is adapted."""

    @classmethod
    def identity(cls, genes: int) -> "Isotropic":
        """The first, and only one."""
        del genes
        return cls()

    def scaled(self, z: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """The same."""
        return z

    def whitened(self, y: Float[Array, "*candidate gene"]) -> Float[Array, "*candidate gene"]:
        """The same."""
        return y

    def changed(self, change: Change) -> "Isotropic":
        """The same."""
        del change
        return self

    def decomposed(self) -> "Isotropic":
        """The same."""
        return self

    def divided(self, unit: Float[Array, ""]) -> "Isotropic":
        """The same: its unit is always 1."""
        del unit
        return self

    def eigenvalues(self) -> Float[Array, "value"]:
        """One, for all of them."""
        return jnp.ones(1)

    def variances(self) -> Float[Array, "value"]:
        """One, for all of them."""
        return jnp.ones(1)


COVARIANCES: dict[str, type[Full] | type[Separable] | type[Isotropic]] = {
    "full": Full,
    "separable": Separable,
    "isotropic": Isotropic,
}
