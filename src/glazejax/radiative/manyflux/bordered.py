"""Matrices over directions, some of which carry no weight: the arithmetic behind exact angles in
`manyflux`.

A field is known at quadrature nodes. Light that falls in from, or is seen in, any other direction
is followed too, as a node whose weight tends to zero: it takes part in no sum but is driven by all.
To first order in the roots of those weights an operator is

             | core     columns |      core      nodes to nodes
    body  =  |                  |      columns   each direction of incidence to nodes
             | rows     corner  |      rows      nodes to each direction of viewing
                                       corner    incidence to viewing

and the diagonal numbers with which the added directions pass on their own light. Such matrices form
a ring: sums, products and inverses stay of this kind, so every formula for layers holds as it
stands (it is the same as integrating the source function along the direction, exactly), and only
matrices over the nodes are ever inverted. Incidence and viewing are kept apart, so that a direction
may be in both.
"""

import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.linalg import inverse, inverse_symmetric, matmul, transpose


class Bordered(NamedTuple):
    """Operator from n nodes and i directions of incidence to n nodes and v directions of
    viewing.
    """

    body: Float[Array, "*batch n+v n+i"]
    viewing: Float[Array, "*batch v"]
    """Diagonal: what each direction of viewing passes on."""
    incidence: Float[Array, "*batch i"]
    """Diagonal: what each direction of incidence passes on."""

    @property
    def nodes(self) -> int:
        """Number of quadrature nodes."""
        return self.body.shape[-1] - self.incidence.shape[-1]

    @property
    def core(self) -> Array:
        """Nodes to nodes, (..., n, n)."""
        return self.body[..., : self.nodes, : self.nodes]

    @property
    def columns(self) -> Array:
        """Directions of incidence to nodes, (..., n, i)."""
        return self.body[..., : self.nodes, self.nodes :]

    @property
    def rows(self) -> Array:
        """Nodes to directions of viewing, (..., v, n)."""
        return self.body[..., self.nodes :, : self.nodes]

    @property
    def corner(self) -> Array:
        """Directions of incidence to directions of viewing, (..., v, i)."""
        return self.body[..., self.nodes :, self.nodes :]

    def __add__(self, other: "Bordered") -> "Bordered":  # pyright: ignore[reportIncompatibleMethodOverride]
        """Sum."""
        return jax.tree.map(operator.add, self, other)

    def __sub__(self, other: "Bordered") -> "Bordered":
        """Difference."""
        return jax.tree.map(operator.sub, self, other)

    def __matmul__(self, other: "Bordered") -> "Bordered":
        """Product: through the nodes, or past them on a direction's own diagonal."""
        n = self.nodes
        # Sums over directions run over the nodes alone: an added direction has no weight in them.
        body = matmul(self.body[..., :n], other.body[..., :n, :])
        # Light of an added direction may also pass one of the two straight on, by its diagonal, and
        # be scattered in the other alone.
        body += self.body * _after_nodes(n, other.incidence)[..., None, :]
        body += _after_nodes(n, self.viewing)[..., :, None] * other.body
        return Bordered(body, self.viewing * other.viewing, self.incidence * other.incidence)

    def scaled(self, factor: Float[Array, "*batch"] | float) -> "Bordered":
        """Times a number for each operator of the batch."""
        factor = jnp.asarray(factor, self.body.dtype)
        return Bordered(
            self.body * factor[..., None, None],
            self.viewing * factor[..., None],
            self.incidence * factor[..., None],
        )

    def plus_identity(self, factor: float | Array = 1.0) -> "Bordered":
        """The operator plus a multiple of the one that changes nothing."""
        # Only the nodes' diagonal stands in the body: one direction may be among viewing and
        # incidence both, so that theirs are kept apart.
        rows, columns = self.body.shape[-2:]
        identity = np.eye(rows, columns, dtype=self.body.dtype)
        identity[self.nodes :] = 0.0
        return Bordered(
            self.body + factor * identity, self.viewing + factor, self.incidence + factor
        )

    def one_minus(self) -> "Bordered":
        """The operator that changes nothing, without this one."""
        return self.scaled(-1.0).plus_identity()

    def symmetric(self) -> "Bordered":
        """With the core's two halves averaged: rounding leaves them different."""
        change = 0.5 * (transpose(self.core) - self.core)
        # The borders have no mirror image in the body: rows are for viewing, columns for incidence.
        edges = [(0, 0)] * (change.ndim - 2) + [
            (0, self.viewing.shape[-1]),
            (0, self.incidence.shape[-1]),
        ]
        return self._replace(body=self.body + jnp.pad(change, edges))

    def inverse(self, *, often: bool = False) -> "Bordered":
        """Inverse operator, without LAPACK and without pivoting.

        None is needed for a core that is symmetric positive definite, nor for 1 - R R' with two
        reflections: scaled by the flux in each direction, its rows are diagonally dominant.

        Args:
            often: take the faster form that is slower to compile; the core must be symmetric
                positive definite.
        """
        # Block elimination: added directions pass on their own light by diagonals, so that only the
        # core needs an inverse.
        core = inverse_symmetric(self.core) if often else inverse(self.core)
        rows = matmul(self.rows, core)
        columns = matmul(core, self.columns)
        corner = matmul(rows, self.columns) - self.corner
        viewing = 1.0 / self.viewing
        incidence = 1.0 / self.incidence
        of_rows = viewing[..., :, None]
        of_columns = incidence[..., None, :]
        body = jnp.block(
            [[core, -columns * of_columns], [-rows * of_rows, corner * of_columns * of_rows]]
        )
        return Bordered(body, viewing, incidence)

    def multiply(self, factor: "Diagonal") -> "Bordered":
        """Operator times a diagonal one: each column by its factor."""
        body = self.body * jnp.concatenate([factor.nodes, factor.incidence], axis=-1)[..., None, :]
        return Bordered(body, self.viewing * factor.viewing, self.incidence * factor.incidence)

    def multiplied_by(self, factor: "Diagonal") -> "Bordered":
        """A diagonal operator times this one: each row by its factor."""
        body = self.body * jnp.concatenate([factor.nodes, factor.viewing], axis=-1)[..., :, None]
        return Bordered(body, self.viewing * factor.viewing, self.incidence * factor.incidence)

    def reweight(self, viewing: Array, incidence: Array) -> "Bordered":
        """With added directions of other weights: their roots' ratios, (..., v) and (..., i)."""
        rows, columns = (
            jnp.concatenate([jnp.ones((*x.shape[:-1], self.nodes), x.dtype), x], axis=-1)
            for x in (viewing, incidence)
        )
        return self._replace(body=self.body * rows[..., :, None] * columns[..., None, :])


def diagonal(entries: "Diagonal") -> Bordered:
    """A diagonal operator, such as what a smooth surface lets through."""
    nodes, viewing, incidence = entries
    count, rows, columns = (x.shape[-1] for x in (nodes, viewing, incidence))
    body = jnp.zeros((*nodes.shape[:-1], count + rows, count + columns), nodes.dtype)
    return Bordered(body.at[..., np.arange(count), np.arange(count)].set(nodes), viewing, incidence)


class Diagonal(NamedTuple):
    """One number for each node and each added direction, such as the reflectance of a smooth
    surface.
    """

    nodes: Float[Array, "*batch n"]
    viewing: Float[Array, "*batch v"]
    incidence: Float[Array, "*batch i"]


def _after_nodes(nodes: int, added: Array) -> Array:
    return jnp.pad(added, [(0, 0)] * (added.ndim - 1) + [(nodes, 0)])
