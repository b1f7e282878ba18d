"""Glazes under a rough surface, for their table: GGX facets on both sides
(`glazejax.radiative.rough`).

All light between air and body passes a few functions of the angle, `Operators.enters`. What the
body does is a matrix and a vector on them, so one solution a function, and one for light that
starts on the ground, give all angles.
"""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...radiative.common.chunks import by_blocks
from ...radiative.common.quadrature import gauss
from ...radiative.rough import loss_constant, rough_reflectance_factor, surface_albedo, surface_loss
from ...radiative.rough.body import Lit, reflectance
from ...radiative.rough.body import Surface as Resolved
from ...radiative.rough.resolution import FINEST, resolve
from ..glaze.interpolation import lagrange
from .ground_split import GroundTerms, evenly, split
from .lookup import NUMPY, Arithmetic
from .surfaces import ErrorOfNodes, Layers, SolvedSurface

_STEPS = 257
_ANGLE_NODES = (12, 16, 20, 24, 32, 40, 48)


class Rough(SolvedSurface):
    """GGX facets, their loss made good; it answers what `smooth.Smooth` does.

    Attributes:
        lost: what the compensation divides by, C of `glazejax.radiative.rough.surface`.
        table: at even steps of the coordinate: all that is reflected, what single facets lose, and
            the share of that in the former, (steps, 1, 4), float32.
    """

    def __init__(self, refractive_index: float, roughness: float):
        arguments: dict[str, Any] = {"refractive_index": refractive_index, "roughness": roughness}
        super().__init__(rough_reflectance_factor, block=512, finest=FINEST, **arguments)
        self.roughness: float = roughness
        self._resolved = resolve(refractive_index, roughness, FINEST)
        air_table = self._resolved.operators().table
        assert air_table is not None
        self._turn = float(air_table.turn)
        self.lost: float = loss_constant(**arguments)
        # Even steps of the coordinate, in which the lookup counts.
        cosines = np.maximum(self.cosine(np.linspace(0.0, 1.0, _STEPS)), 1e-6)
        albedo, loss = (
            np.asarray(f(cosines, **arguments), float) for f in (surface_albedo, surface_loss)
        )
        # How much of what single facets lose comes back to the air.
        fine, weights = gauss(64)
        fine_loss = np.asarray(surface_loss(fine, **arguments), float)
        back = 2.0 * np.pi * np.sum(weights * fine * fine_loss) / self.lost
        share = np.clip(loss * back / albedo, 0.0, 1.0)
        columns = np.stack([albedo, loss, share, 0.0 * share], axis=-1)
        self.table: np.ndarray = np.ascontiguousarray(columns[:, None], np.float32)

    def coordinate(self, ops: Arithmetic, cosine: Any) -> Any:
        """From cosines in air to [0, 1]."""
        return ops.asinh(cosine / self._turn) / float(np.arcsinh(1.0 / self._turn))

    def cosine(self, coordinate: Any) -> Any:
        """From [0, 1] to cosines in air."""
        return np.clip(self._turn * np.sinh(coordinate * np.arcsinh(1.0 / self._turn)), 0.0, 1.0)

    def let_in(self, ops: Arithmetic, cosine: Any) -> Any:
        """Nothing is known without the table."""
        return 1.0

    def analytic_factor(self, ops: Arithmetic, cos_in: Any, cos_out: Any) -> Any:
        """Nothing is known without the table."""
        return 1.0

    def angles(self, error: ErrorOfNodes, tolerance: float) -> np.ndarray:
        """Nodes between which the functions of the angle are polynomials, which costs no
        solution.
        """
        rough_operators = self._resolved.operators()
        between = self.cosine(np.linspace(0.0, 1.0, 301)[1:])
        exact = np.asarray(rough_operators.enters(between), float)
        cosines = np.zeros(0)
        for count in _ANGLE_NODES:
            cosines = self.cosine(evenly(count))
            basis = lagrange(2.0 * self.coordinate(NUMPY, between) - 1.0, count)
            # Their errors may add up, however the body weighs them.
            off = (
                np.abs(basis @ np.asarray(rough_operators.enters(cosines), float) - exact)
                .sum(axis=1)
                .max()
            )
            if off <= tolerance:
                break
        return cosines

    def terms(self, layers: Layers, cosines: np.ndarray, tolerance: float) -> np.ndarray:
        """R0, T and S on the functions of the angle, one row a stack: (..., rows), see
        `ground_split.split`.
        """
        surface = resolve(self.refractive_index, self.roughness, max(tolerance, FINEST))
        albedo, depth = (x.reshape(-1, x.shape[-1]) for x in layers)
        solved = by_blocks(
            len(albedo), 256, lambda rows: _terms(albedo[rows], depth[rows], surface)
        )
        return np.asarray(solved, float).reshape(*layers[0].shape[:-1], -1)

    def expand(self, values: np.ndarray, cosines: np.ndarray, tolerance: float) -> GroundTerms:
        """From the functions of the angle to the angles."""
        rough_operators = resolve(
            self.refractive_index, self.roughness, max(tolerance, FINEST)
        ).operators()
        enters = np.asarray(rough_operators.enters(cosines), float)
        terms = split(values, rough_operators.basis.cosines.size)
        return GroundTerms(enters @ terms.black @ enters.T, terms.through @ enters.T, terms.back)


@functools.partial(jax.jit, static_argnums=2)
def _terms(albedo: Array, depth: Array, surface: Resolved) -> Float[Array, "stacks rows"]:
    """R0 (upper triangle), T and S of stacks, on the functions of the angle; see
    `radiative.rough.ports`.
    """
    stacks = albedo.shape[0]
    n = surface.operators().basis.cosines.size
    pairs = -(-n // 2)
    # Each row lights the body by one function of the angle and views it by another.
    unit = jnp.eye(2 * pairs, n, dtype=albedo.dtype).reshape(pairs, 2, n)
    # The last row is light that starts on a white ground and is seen from there.
    enters = jnp.concatenate([unit, jnp.zeros((1, 2, n), albedo.dtype)])
    last = jnp.arange(pairs + 1) == pairs

    def repeat(values: Array) -> Array:
        return jnp.repeat(values, pairs + 1, axis=0)

    def tile(values: Array) -> Array:
        return jnp.tile(values, (stacks, *[1] * (values.ndim - 1)))

    # Only the last row has a white ground, with light on it.
    white = tile(last.astype(albedo.dtype))
    lit = Lit(
        albedo=repeat(albedo),
        optical_thickness=repeat(depth),
        ground=white,
        enters=tile(enters),
        from_ground=jnp.stack([white, white], axis=1),
    )
    value, back = jax.vjp(
        lambda enters: reflectance(lit._replace(enters=enters), surface), lit.enters
    )
    (slopes,) = back(jnp.ones_like(value))
    slopes = slopes.reshape(stacks, pairs + 1, 2, n)
    # The form is bilinear: its slope by one beam is the matrix times the other.
    matrix = slopes[:, :-1, ::-1].reshape(stacks, 2 * pairs, n)[:, :n] / surface.refractive_index**2
    # Reciprocity, which rounding misses.
    matrix = 0.5 * (matrix + jnp.swapaxes(matrix, 1, 2))
    # 4/(1 - S) of the ground itself, 2 n T/(1 - S) of light from above: see
    # `radiative.rough.ports`.
    itself = value.reshape(stacks, -1)[:, -1:]
    through = 2.0 * slopes[:, -1, 0] / (surface.refractive_index * itself)
    rows, columns = np.triu_indices(n)
    return jnp.concatenate([matrix[:, rows, columns], through, 1.0 - 4.0 / itself], axis=1)
