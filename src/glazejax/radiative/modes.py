r"""Eigenmodes of an isotropically scattering layer, without an eigensolver.

In the even-parity form the layer's matrix is diag(1/mu^2) - q z z^T with z_i = sqrt(w_i)/mu_i: diagonal minus a
rank-one term. Its eigenvalues lambda_j = kappa_j^2 lie one between each pair of neighbouring poles d_i = 1/mu_i^2
and are the roots of the secular equation

    1 = q sum_i z_i^2 / (d_i - lambda)          (paper A's characteristic equation for the discretised kernel)

solved here for the offset r_j = (d_j - lambda_j)/q, which keeps its relative accuracy for any albedo q in [0, 1],
0 and 1 included. Eigenvectors follow in closed form. For a fixed set of directions r_j depends on q alone.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

# The two-pole iteration converges quadratically from either side; seven give 1e-15 for 40 directions.
_ITERATIONS = 7
# A table of this relative accuracy leaves one Newton step to rounding.
_TABLE_ACCURACY = 1e-8


class Modes(NamedTuple):
    """Modes of one layer: sigma = vectors @ y with y'' = decay_squared * y - source."""

    decay_squared: Array  # (..., n), lambda_j = kappa_j^2 >= 0, ascending
    vectors: Array  # (..., n, n), orthonormal columns
    coupling: Array  # (..., n), vectors^T z: how strongly an isotropic source drives each mode


def _pole_differences(poles):
    """d_i - d_j as (..., i, j)."""
    return poles[..., :, None] - poles[..., None, :]


def secular_offsets(albedo, poles, strengths, *, xp=jnp):
    """Roots r_j of z_j^2/r_j + q sum_(i != j) z_i^2/(d_i - d_j + q r_j) = 1.

    Args:
        albedo: q, (...), in [0, 1].
        poles: d_i = 1/mu_i^2 ascending, (..., n).
        strengths: z_i^2 = w_i/mu_i^2, (..., n), with sum_i w_i = 1.
        xp: array module (numpy for tables, jax.numpy for traced directions).

    Returns:
        r, (..., n). Two-pole rational iteration of Bunch, Nielsen and Sorensen (Numer. Math. 31, 1978).
    """
    n = poles.shape[-1]
    q = xp.asarray(albedo)[..., None]
    difference = _pole_differences(poles)
    off_diagonal = ~np.eye(n, dtype=bool)
    # Poles with a larger d bend the function from one side, those with a smaller d from the other.
    upper = np.triu(np.ones((n, n), dtype=bool), 1)
    lower = np.tril(np.ones((n, n), dtype=bool), -1)
    z2_i = strengths[..., :, None]
    # Width of the interval in q r: up to the next smaller pole; the first root has lambda >= 0.
    gap = xp.concatenate([poles[..., :1], poles[..., 1:] - poles[..., :-1]], axis=-1)
    first = np.arange(n) == 0
    tiny = float(np.finfo(np.dtype(poles.dtype)).tiny)
    limit = gap / xp.maximum(q, tiny)
    r = xp.where(first, limit, xp.minimum(strengths, 0.5 * limit))
    r = xp.where(q == 0, strengths, r)
    for _ in range(_ITERATIONS):
        denominator = xp.where(off_diagonal, difference + (q * r)[..., None, :], 1.0)
        ratio = z2_i / denominator
        slope = ratio / denominator
        # One side: p + s/r; other side: P - S/(gap - q r), both matched in value and slope at r.
        s = strengths + q * q * xp.sum(xp.where(lower, slope, 0.0), axis=-2) * r * r
        p = q * xp.sum(xp.where(lower, ratio - (q * r)[..., None, :] * slope, 0.0), axis=-2)
        rest = gap - q * r
        pull = xp.sum(xp.where(upper, slope, 0.0), axis=-2)
        big_s = q * pull * rest * rest
        big_p = q * xp.sum(xp.where(upper, ratio, 0.0), axis=-2) + q * pull * rest
        c = 1.0 - p - big_p
        b = c * gap + s * q + big_s
        product = c * q * s * gap
        root = xp.sqrt(xp.maximum(b * b - 4.0 * product, 0.0))
        larger = xp.where(b > 0, 1.0, 0.5 * (b - root) / xp.where(b > 0, 1.0, c * q))
        two_pole = xp.where(b > 0, 2.0 * s * gap / xp.where(b > 0, b + root, 1.0), larger)
        r_new = xp.where(first, s / xp.where(first, c, 1.0), two_pole)
        r = xp.clip(r_new, tiny, limit)
    return r


@functools.lru_cache(maxsize=64)
def _table(key: bytes) -> np.ndarray:
    """Chebyshev coefficients in 2q - 1 of r_j(q)/z_j^2 for one set of directions, (terms, n)."""
    cosines, weights = np.frombuffer(key).reshape(2, -1)
    poles, strengths = 1.0 / cosines**2, weights / cosines**2
    terms = 16
    while True:
        x = np.cos(np.pi * (np.arange(terms) + 0.5) / terms)
        values = secular_offsets(0.5 * (x + 1.0), poles, strengths, xp=np) / strengths
        coefficients = np.polynomial.chebyshev.chebfit(x, values, terms - 1)
        if np.max(np.abs(coefficients[-3:])) < _TABLE_ACCURACY or terms >= 128:
            return coefficients
        terms += 8


def _from_table(albedo: Array, poles: np.ndarray, strengths: np.ndarray, table: np.ndarray) -> Array:
    """Clenshaw's sum of the table and one Newton step on the secular equation."""
    x = 2.0 * albedo[..., None] - 1.0
    b1 = b2 = jnp.zeros((*albedo.shape, poles.size), albedo.dtype)
    for row in table[:0:-1].astype(albedo.dtype):
        b1, b2 = row + 2.0 * x * b1 - b2, b1
    r = strengths.astype(albedo.dtype) * (table[0].astype(albedo.dtype) + x * b1 - b2)
    q = albedo[..., None]
    # Here [j, i]: the sum over poles runs along the last, contiguous axis.
    difference = _pole_differences(poles).T.astype(albedo.dtype)
    off_diagonal = ~np.eye(poles.size, dtype=bool)
    masked = np.where(off_diagonal, strengths, 0.0).astype(albedo.dtype)
    ratio = masked / jnp.where(off_diagonal, difference + (q * r)[..., None], 1.0)
    rest = 1.0 - q * jnp.sum(ratio, axis=-1)
    slope = q * q * jnp.sum(ratio * ratio / strengths.astype(albedo.dtype), axis=-1)
    z2 = strengths.astype(albedo.dtype)
    # Newton for z^2/r = rest(r), in the form that keeps r positive.
    return r + (z2 - r * rest) * r / (z2 + slope * r * r)


@jax.custom_jvp
def _implicit(root: Array, albedo: Array, poles: Array, strengths: Array) -> Array:
    """The root as it is, with the derivative of the secular equation it solves."""
    return root


def _implicit_jvp(primals, tangents):
    """Implicit differentiation, so that no iteration is differentiated."""
    root: Array
    albedo: Array
    poles: Array
    strengths: Array
    root, albedo, poles, strengths = primals
    _, d_albedo, d_poles, d_strengths = tangents
    r = _implicit(root, albedo, poles, strengths)
    q = albedo[..., None]
    off_diagonal = ~np.eye(poles.shape[-1], dtype=bool)
    difference = _pole_differences(poles)
    denominator = jnp.where(off_diagonal, difference + (q * r)[..., None, :], 1.0)
    slope = jnp.where(off_diagonal, strengths[..., :, None] / denominator**2, 0.0)
    by_r = -strengths / r**2 - q * q * jnp.sum(slope, axis=-2)
    residual = jnp.zeros_like(r)
    if not isinstance(d_albedo, SymbolicZero):
        residual += jnp.sum(slope * difference, axis=-2) * d_albedo[..., None]
    if not isinstance(d_strengths, SymbolicZero):
        by_strengths = jnp.where(off_diagonal, q[..., None] / denominator, 0.0)
        residual += d_strengths / r + jnp.sum(by_strengths * d_strengths[..., :, None], axis=-2)
    if not isinstance(d_poles, SymbolicZero):
        residual -= q * jnp.sum(slope * _pole_differences(d_poles), axis=-2)
    return r, -residual / by_r


_implicit.defjvp(_implicit_jvp, symbolic_zeros=True)


def _offsets(albedo: Array, cosines: Array | np.ndarray, weights: Array | np.ndarray) -> Array:
    if isinstance(cosines, np.ndarray) and isinstance(weights, np.ndarray):
        poles = 1.0 / cosines**2
        strengths = weights * poles
        table = _table(np.stack([cosines, weights]).tobytes())
        root = _from_table(jax.lax.stop_gradient(albedo), poles, strengths, table)
    else:
        poles = 1.0 / cosines**2
        strengths = weights * poles
        root = secular_offsets(*jax.lax.stop_gradient((albedo, poles, strengths)))
    poles, strengths = jnp.asarray(poles, albedo.dtype), jnp.asarray(strengths, albedo.dtype)
    return _implicit(root, albedo, poles, strengths)


def layer_modes(
    albedo: Float[Array, "*batch"],
    cosines: Float[Array | np.ndarray, "*#batch n"],
    weights: Float[Array | np.ndarray, "*#batch n"],
) -> Modes:
    """Modes of layers of single-scattering albedo q for half-range directions (cosines descending).

    Args:
        albedo: q in [0, 1], (...).
        cosines: mu in (0, 1], descending, (..., n). A numpy array (n,) is the fast path: its roots are tabulated.
        weights: quadrature weights, positive, with sum w = 1, (..., n).

    Returns:
        `Modes`, arrays (..., n), (..., n, n), (..., n).
    """
    n = cosines.shape[-1]
    r = _offsets(albedo, cosines, weights)
    cosines, weights = jnp.asarray(cosines, albedo.dtype), jnp.asarray(weights, albedo.dtype)
    poles = 1.0 / cosines**2
    z = jnp.sqrt(weights) / cosines
    q = albedo[..., None]
    off_diagonal = ~np.eye(n, dtype=bool)
    offsets = q * r
    denominator = jnp.where(off_diagonal, _pole_differences(poles) + offsets[..., None, :], 1.0)
    columns = jnp.where(off_diagonal, (q[..., None] * z[..., :, None]) / denominator, 0.0)
    columns += jnp.eye(n, dtype=z.dtype) * (z / r)[..., None, :]
    # The secular equation says z . column = 1, so the coupling is the column's normalisation itself.
    coupling = 1.0 / jnp.sqrt(jnp.sum(columns**2, axis=-2))
    vectors = columns * coupling[..., None, :]
    return Modes(_decay_squared(albedo, cosines, weights, poles - offsets), vectors, coupling)


def _decay_squared(albedo: Array, cosines: Array, weights: Array, eigenvalues: Array) -> Array:
    """Give the smallest eigenvalue, which vanishes with 1 - q, its full relative accuracy.

    With sum w = 1 the secular equation reads (1 - q) = lambda q sum w mu^2/(1 - lambda mu^2).
    """
    smallest = eigenvalues[..., 0]
    guess = jax.lax.stop_gradient(smallest)
    q = jax.lax.stop_gradient(albedo)
    squared = jax.lax.stop_gradient(cosines) ** 2
    near_one = q > 0.7
    denominator = jnp.where(near_one[..., None], 1.0 - guess[..., None] * squared, 1.0)
    second_moment = jnp.sum(jax.lax.stop_gradient(weights) * squared / denominator, axis=-1)
    accurate = jnp.where(near_one, (1.0 - q) / jnp.where(near_one, q * second_moment, 1.0), guess)
    # Value from the accurate form, derivative from the eigenvalue itself.
    refined = accurate + (smallest - guess)
    return jnp.concatenate([refined[..., None], eigenvalues[..., 1:]], axis=-1)
