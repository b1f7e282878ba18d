"""Covariance that a joint fit leaves in k and s of all paints at all wavelengths, by the factors of
the normal matrix. The whole of it, of thousands of coefficients, is never formed. Draws from it
would do too, but a few hundred say a small paint's errors no better than to a fifth.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from ...film.model.errors import principal_modes
from .problem import JointProblem, Unknowns
from .solver import Factors, solve, unflatten, unwhiten, whiten


class JointCovariance(NamedTuple):
    """Laplace's covariance of all unknowns as they are (`totals`).

    Attributes:
        factors: of the normal matrix, of the deviations.
        modes: how what all bands share moves all unknowns in addition.
        others: number of the unknowns' `others`, which are the last.
    """

    factors: Factors
    modes: Float[np.ndarray, "shared unknowns"]
    others: int

    @classmethod
    def of(cls, problem: JointProblem, factors: Factors) -> "JointCovariance":
        """At the solution of a problem."""
        count, shared = factors.border.shape
        films, per_film = problem.film_scale.shape
        thickness = problem.thickness_modes
        modes = np.zeros((shared, count + shared))
        first = shared - len(thickness)
        modes[first:, :count] = np.reshape(problem.band_modes, (len(thickness), count))
        modes[first:, count : count + films * per_film : per_film] = thickness
        return cls(factors, modes, len(thickness))

    @property
    def of_shared(self) -> Float[np.ndarray, "shared shared"]:
        """Covariance of what all bands share."""
        count, shared = self.factors.border.shape
        root = self.factors.corner @ (np.eye(shared) + self.modes[:, count:])
        return root.T @ root

    def of_bands(self, bands: int) -> Float[np.ndarray, "bands local local"]:
        """Covariance of each band's unknowns."""
        diagonals, border, corner = self.factors
        local = len(border) // bands
        blocks = []
        for first in range(0, len(border), local):
            # Columns of the inverse factor are nought at the bands before.
            rest = Factors(diagonals[:, first:], border[first:], corner)
            here = np.eye(len(rest.border), local)
            white = whiten(rest, np.concatenate([here, self.modes[:, first : first + local]]))
            blocks.append(white.T @ white)
        return np.stack(blocks)

    def times(
        self, vectors: Float[np.ndarray, "unknowns columns"]
    ) -> Float[np.ndarray, "unknowns columns"]:
        """The covariance times some vectors."""
        count = len(self.factors.border)
        shared = vectors[count:] + self.modes @ vectors
        solved = solve(self.factors, np.concatenate([vectors[:count], shared]))
        return solved + self.modes.T @ solved[count:]

    def regress(
        self, numbers: Sequence[int]
    ) -> tuple[Float[np.ndarray, "known numbers"], Float[np.ndarray, "known numbers"]]:
        """Slopes of the bands' unknowns by some of the `others`, and their covariance with them."""
        count = len(self.factors.border)
        # Of no columns LAPACK's wrapper writes where it must not (scipy 1.17).
        if not len(numbers):
            nothing = np.zeros((0, count))
            return nothing, nothing
        size = self.modes.shape[1]
        rows = size - self.others + np.array(numbers)
        columns = self.times(np.eye(size)[:, rows])
        across = columns[:count].T
        return np.linalg.inv(columns[rows]) @ across, across

    def draw(self, best: Unknowns, count: int) -> Unknowns:
        """Draws about the solution, each with a leading axis of draws."""
        rng = np.random.default_rng(0)
        bands, shared = self.factors.border.shape
        noise = [rng.standard_normal((numbers, count)) for numbers in (shared, bands)]
        off = unwhiten(self.factors, np.concatenate(noise[::-1]))
        off = off + self.modes.T @ off[bands:]
        return jax.tree.map(np.add, best, unflatten(off.T, best))

    def largest(
        self, size: Float[np.ndarray, "*shape"], count: int, known: Sequence[int] = ()
    ) -> Float[np.ndarray, "modes *shape"]:
        """The largest modes of the coefficients' errors (`principal_modes`), largest first, by
        subspace iteration.

        Args:
            size: factor of each coefficient's error, (bands, local), 0 for those that do not
                matter.
            count: of the modes; there are no more than coefficients.
            known: numbers of the `others` whose values are taken as known.
        """
        slopes, across = self.regress(known)
        scale = size.reshape(-1, 1)

        def times(basis: Float[np.ndarray, "numbers columns"]) -> np.ndarray:
            scaled = basis * scale
            wide = np.pad(scaled, ((0, len(self.modes)), (0, 0)))
            return (self.times(wide)[: len(basis)] - slopes.T @ (across @ scaled)) * scale

        # With so many vectors more than are wanted, and the covariance applied so often, the last
        # modes are good to some per cent.
        columns = min(count + 16, size.size)
        basis = np.random.default_rng(0).standard_normal((size.size, columns))
        for _ in range(8):
            basis, _ = np.linalg.qr(times(basis))
        modes = principal_modes(basis.T @ times(basis))[-count:] @ basis.T
        return modes[::-1].reshape(-1, *size.shape)
