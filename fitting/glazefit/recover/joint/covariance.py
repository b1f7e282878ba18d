"""Covariance that a joint fit leaves in k and s of all paints at all wavelengths: the largest parts
of its covariance.

The covariance of thousands of coefficients is known by the factors of the normal matrix, and is
never formed. Draws from it would do too, but a few hundred say a small paint's errors no better
than to a fifth.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from .problem import Unknowns
from .solver import Factors, covariance_times, draws


class JointCovariance(NamedTuple):
    """The whole covariance of the bands' coefficients, log k of all paints and then log s.

    Attributes:
        factors: of the normal matrix.
        modes: how each of the fit's other unknowns moves the coefficients.
        thickness_modes: and how it moves the log of each film's thickness.
        with_others: covariance of these other unknowns with the coefficients.
    """

    factors: Factors
    modes: Float[np.ndarray, "others bands local"]
    thickness_modes: Float[np.ndarray, "others films"]
    with_others: Float[np.ndarray, "others bands local"]

    def draw(self, best: Unknowns, count: int) -> Unknowns:
        """Draws about the solution, of coefficients and thicknesses as they are (`totals`)."""
        off = draws(self.factors, best, count)
        off.films[:, :, 0] += off.others @ self.thickness_modes
        off = off._replace(bands=off.bands + np.einsum("do,obi->dbi", off.others, self.modes))
        return jax.tree.map(np.add, best, off)

    def largest(
        self,
        size: Float[np.ndarray, "bands local"],
        count: int,
        fixed: Sequence[int] = (),
        slopes: Float[np.ndarray, "known bands local"] | None = None,
    ) -> Float[np.ndarray, "modes bands local"]:
        """The largest modes of the coefficients' errors: eigenvectors of their covariance times the
        roots of its eigenvalues, largest first, by subspace iteration.

        Args:
            size: factor of each coefficient's error, 0 for those that do not matter.
            count: of the modes; there are no more than coefficients.
            fixed: numbers of other unknowns whose values are taken as known.
            slopes: of the coefficients by each of these unknowns.
        """
        with_known = self.with_others[list(fixed)]

        def times(basis: Float[np.ndarray, "numbers columns"]) -> np.ndarray:
            scaled = basis.reshape(*size.shape, -1) * size[..., None]
            out = covariance_times(self.factors, scaled, self.modes)
            if slopes is not None and len(slopes):
                out = out - np.einsum(
                    "obi,oc->bic", slopes, np.einsum("obi,bic->oc", with_known, scaled)
                )
            return (out * size[..., None]).reshape(basis.shape)

        # With so many vectors more than are wanted, and the covariance applied so often, the last
        # modes are good to some per cent.
        columns = min(count + 16, size.size)
        basis = np.random.default_rng(0).standard_normal((size.size, columns))
        for _ in range(8):
            basis, _ = np.linalg.qr(times(basis))
        values, vectors = np.linalg.eigh(basis.T @ times(basis))
        last = slice(-min(count, columns), None)
        modes = (basis @ vectors[:, last]) * np.sqrt(np.maximum(values[last], 0.0))
        return modes.T[::-1].reshape(-1, *size.shape)
