"""Glazes under a smooth surface, for their table."""

from typing import Any

import numpy as np
from jaxtyping import Float

from ...radiative.stack import stack_reflectance_factor
from ..glaze.interpolation import LEAST_SUM
from .ground_split import GroundTerms, evenly, split
from .lookup import Arithmetic
from .surfaces import ErrorOfNodes, Layers, SolvedSurface, inside

# Numbers of angles that are tried.
_ANGLES = (4, 5, 6, 8, 10, 12, 16, 24, 32)


class Smooth(SolvedSurface):
    """Fresnel's surface: what is smooth is smooth in the cosine inside the paint.

    The table of a body asks a surface for the coordinate in which angles are smooth, what is known
    of its transmission in closed form, and the solver's answers for the body below.
    """

    def __init__(self, refractive_index: float):
        super().__init__(
            stack_reflectance_factor, block=4096, finest=0.0, refractive_index=refractive_index
        )
        self._steepest = float(
            np.sqrt((refractive_index - 1.0) * (refractive_index + 1.0)) / refractive_index
        )

    def coordinate(self, ops: Arithmetic, cosine: Any) -> Any:
        """From cosines in air to [0, 1]."""
        return (inside(ops, cosine, self.refractive_index) - self._steepest) / (
            1.0 - self._steepest
        )

    def cosine(self, coordinate: Any) -> Any:
        """From [0, 1] to cosines in air."""
        n = self.refractive_index
        within = self._steepest + coordinate * (1.0 - self._steepest)
        # Snell's law, from the cosine inside back to air.
        return np.sqrt(np.clip(n**2 * (within**2 - 1.0) + 1.0, 0.0, 1.0))

    def let_in(self, ops: Arithmetic, cosine: Any) -> Any:
        """Closed-form factor of T: 1 - Fresnel's reflectance, which is `dielectric_reflectance` for
        NumPy and JAX.
        """
        n = self.refractive_index
        within = n * inside(ops, cosine, n)
        s = (cosine - within) / (cosine + within)
        p = (n * n * cosine - within) / (n * n * cosine + within)
        return 1.0 - 0.5 * (s * s + p * p)

    def analytic_factor(self, ops: Arithmetic, cos_in: Any, cos_out: Any) -> Any:
        """Closed-form factor of R0, T T/(mu_I + mu_F): what changes fast with the angle."""
        n = self.refractive_index
        total = ops.maximum(inside(ops, cos_in, n) + inside(ops, cos_out, n), LEAST_SUM)
        return self.let_in(ops, cos_in) * self.let_in(ops, cos_out) / total

    def angles(self, error: ErrorOfNodes, tolerance: float) -> Float[np.ndarray, "angles"]:
        """Cosines in air of as few nodes (`evenly`) as will do; `error` tries some."""
        cosines = np.zeros(0)
        for count in _ANGLES:
            cosines = self.cosine(evenly(count))
            if error(cosines) <= tolerance:
                break
        return cosines

    def terms(
        self, layers: Layers, cosines: np.ndarray, tolerance: float
    ) -> Float[np.ndarray, "*stacks rows"]:
        """R0 of all pairs of angles, T of each and S, from three levels of the ground."""
        n = cosines.size
        rows, columns = np.triu_indices(n)
        # The last angle is the steepest, which lets most light through.
        first = np.concatenate([rows, np.arange(n), [n - 1]])
        second = np.concatenate([columns, np.arange(n), [n - 1]])
        ground = np.concatenate([np.zeros(rows.size), np.ones(n), [0.5]])
        stacks = [x[..., None, :] for x in layers]
        factor_values = self.factor(stacks, ground, cosines[first], cosines[second], tolerance)
        black = factor_values[..., : rows.size]
        diagonal = black[..., rows == columns]
        full = np.maximum(factor_values[..., rows.size : -1] - diagonal, 0.0)
        half = factor_values[..., -1] - diagonal[..., -1]
        # Where no light reaches the ground and comes back, what the ground sees does not matter.
        determined = full[..., -1] > 0.0
        # From T T/(1 - S) and .5 T T/(1 - .5 S).
        ratio = np.where(determined, half, 0.4) / np.where(determined, full[..., -1], 1.0)
        back = np.where(determined, np.clip((1.0 - 2.0 * ratio) / (1.0 - ratio), 0.0, 1.0), np.nan)
        back = _fill_unknown(back.reshape(-1, back.shape[-1])).reshape(back.shape)[..., None]
        # T^2 is (1 - S) times what a white ground adds.
        return np.concatenate([black, np.sqrt(full * (1.0 - back)), back], axis=-1)

    def expand(self, values: np.ndarray, cosines: np.ndarray, tolerance: float) -> GroundTerms:
        """`GroundTerms` at the nodes from sums of those numbers, which are theirs already."""
        return split(values, cosines.size)


def _fill_unknown(back: Float[np.ndarray, "points bands"]) -> Float[np.ndarray, "points bands"]:
    """S where it is not known: that of the next point, since it hardly changes where little light
    gets through.
    """
    for band in back.T:
        determined = np.flatnonzero(np.isfinite(band))
        unknown = np.flatnonzero(~np.isfinite(band))
        if unknown.size:
            near = (
                determined[np.abs(determined[None] - unknown[:, None]).argmin(axis=1)]
                if determined.size
                else None
            )
            band[unknown] = 0.0 if near is None else band[near]
    return back
