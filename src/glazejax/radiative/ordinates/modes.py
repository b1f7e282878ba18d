r"""Eigenmodes of an isotropically scattering layer, without an eigensolver.

In the even-parity form the layer's matrix is diag(1/mu^2) - q z z^T with z_i = sqrt(w_i)/mu_i:
diagonal minus a rank-one term. Its eigenvalues lambda_j = kappa_j^2 lie one between each pair of
neighbouring poles d_i = 1/mu_i^2 and are the roots of the secular equation

    1 = q sum_i z_i^2 / (d_i - lambda),

the characteristic equation of S. Chandrasekhar's discrete ordinates. It is solved here for the
offset r_j = (d_j - lambda_j)/q, which keeps its relative accuracy for any albedo q in [0, 1], 0 and
1 included. Eigenvectors follow in closed form. For a fixed set of directions r_j depends on q
alone.

Stacks lie side by side on the last axis, so that a processor's lanes run along them; directions and
modes stand before it.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

# The two-pole iteration converges quadratically from either side; seven give 1e-15 for 40
# directions.
_ITERATIONS = 7
# Relative accuracy of the tables, and the equal pieces of the albedo's range that each have a
# polynomial.
_TABLE_ACCURACY = 1e-13
_PIECES = 2


class LayerModes(NamedTuple):
    """Modes of one layer: sigma = vectors @ y with y'' = decay_squared * y - source."""

    decay_squared: Array  # (..., n, batch), lambda_j = kappa_j^2 >= 0, ascending
    vectors: Array  # (..., n, n, batch), orthonormal columns
    coupling: Array  # (..., n, batch), vectors^T z: how an isotropic source drives each mode


def _pole_differences(poles):
    """d_i - d_j as (..., i, j, batch)."""
    return poles[..., :, None, :] - poles[..., None, :, :]


def _off_diagonal(n: int) -> np.ndarray:
    return ~np.eye(n, dtype=bool)[..., None]


def secular_offsets(albedo: Any, poles: Any, strengths: Any, *, xp: Any = jnp) -> Any:
    """Roots r_j of z_j^2/r_j + q sum_(i != j) z_i^2/(d_i - d_j + q r_j) = 1.

    Args:
        albedo: q, (..., batch), in [0, 1].
        poles: d_i = 1/mu_i^2 ascending, (..., n, batch).
        strengths: z_i^2 = w_i/mu_i^2, (..., n, batch), with sum_i w_i = 1.
        xp: array module (numpy for tables, jax.numpy for traced directions).

    Returns:
        r, (..., n, batch). Two-pole rational iteration of Bunch, Nielsen and Sorensen (Numer.
        Math. 31, 1978).
    """
    n = poles.shape[-2]
    q = xp.asarray(albedo)[..., None, :]
    difference = _pole_differences(poles)
    off_diagonal = _off_diagonal(n)
    # Poles with a larger d bend the function from one side, those with a smaller d from the other.
    upper = np.triu(np.ones((n, n), dtype=bool), 1)[..., None]
    lower = np.tril(np.ones((n, n), dtype=bool), -1)[..., None]
    z2_i = strengths[..., :, None, :]
    # Width of the interval in q r: up to the next smaller pole; the first root has lambda >= 0.
    gap = xp.concatenate([poles[..., :1, :], poles[..., 1:, :] - poles[..., :-1, :]], axis=-2)
    first = (np.arange(n) == 0)[:, None]
    tiny = float(np.finfo(np.dtype(poles.dtype)).tiny)
    limit = gap / xp.maximum(q, tiny)
    # Start inside of the interval; at q = 0 the root is the strength itself.
    r = xp.where(first, limit, xp.minimum(strengths, 0.5 * limit))
    r = xp.where(q == 0, strengths, r)
    for _ in range(_ITERATIONS):
        denominator = xp.where(off_diagonal, difference + (q * r)[..., None, :, :], 1.0)
        ratio = z2_i / denominator
        slope = ratio / denominator
        # One side: p + s/r; other side: P - S/(gap - q r), both matched in value and slope at r.
        s = strengths + q * q * xp.sum(xp.where(lower, slope, 0.0), axis=-3) * r * r
        p = q * xp.sum(xp.where(lower, ratio - (q * r)[..., None, :, :] * slope, 0.0), axis=-3)
        distance = gap - q * r
        pull = xp.sum(xp.where(upper, slope, 0.0), axis=-3)
        big_s = q * pull * distance * distance
        big_p = q * xp.sum(xp.where(upper, ratio, 0.0), axis=-3) + q * pull * distance
        # The two-pole model's root in the interval, without cancellation; the first has one pole.
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
def _table(key: bytes) -> Float[np.ndarray, "rows terms"]:
    """Chebyshev coefficients in the albedo for one set of directions, (pieces * (2 n + 1), terms):
    of r_j(q), of the coupling of each mode and of lambda_0/(1 - q), all analytic in q on [0, 1].

    Not `glazejax.interpolated`, which stands above the solvers, and has one polynomial of 129 terms
    at most: for 8 to 32 directions its error is 2e-5 to 2e-4 of the largest value, and that
    of two pieces of 32 to 64 terms 2e-11.
    """
    cosines, weights = np.frombuffer(key).reshape(2, -1)
    poles = 1.0 / cosines[:, None] ** 2
    strengths = weights[:, None] * poles
    terms = 12
    while True:
        # More terms until the last two of all pieces are small enough.
        x = np.cos(np.pi * (np.arange(terms) + 0.5) / terms)
        pieces = []
        remainder = 0.0
        for piece in range(_PIECES):
            q = (piece + 0.5 * (x + 1.0)) / _PIECES
            # Exact values on Chebyshev's nodes of the piece.
            r = secular_offsets(q, poles, strengths, xp=np)
            columns = _columns(q, np.sqrt(strengths), poles, r, xp=np)
            coupling = 1.0 / np.sqrt(np.sum(columns**2, axis=-3))
            slowest = (poles[:1] - q * r[:1]) / (1.0 - q)
            values = np.concatenate([r, coupling, slowest]).T
            pieces.append(np.polynomial.chebyshev.chebfit(x, values, terms - 1).T)
            remainder = max(
                remainder, np.max(np.abs(pieces[-1][:, -2:].T) / np.max(np.abs(values), axis=0))
            )
        if remainder < _TABLE_ACCURACY or terms >= 64:
            return np.concatenate(pieces)
        terms += 4


def _chebyshev(x: Array, terms: int) -> Array:
    """T_0(x) ... T_(terms - 1)(x) on a first axis, four at a time: T_(m+4) = 2 T_4 T_m -
    T_(|m-4|).
    """
    second = 2.0 * x * x - 1.0
    third = x * (2.0 * second - 1.0)
    fourth = 2.0 * second * second - 1.0
    # T_|m - 4| for m from 0 to 3.
    before = jnp.stack([fourth, third, second, x])
    blocks = [jnp.stack([jnp.ones_like(x), x, second, third])]
    for _ in range(terms // 4 - 1):
        blocks.append(2.0 * fourth * blocks[-1] - before)
        before = blocks[-2]
    return jnp.concatenate(blocks)


def _from_table(albedo: Array, table: Float[np.ndarray, "rows terms"]) -> Array:
    """Offsets, couplings and lambda_0/(1 - q) one below the other, (2 n + 1, ..., batch)."""
    # Each piece of the albedo's range has a polynomial of its own.
    piece = jnp.clip(jnp.floor(albedo * _PIECES), 0, _PIECES - 1)
    polynomials = _chebyshev(2.0 * (albedo * _PIECES - piece) - 1.0, table.shape[1])
    # One matrix product for all pieces: a product is not computed again for each use, as fused
    # arithmetic would be.
    coefficients = jnp.asarray(table, albedo.dtype)
    values = jnp.tensordot(coefficients, polynomials, axes=1, precision="highest")
    values = values.reshape(_PIECES, len(table) // _PIECES, *albedo.shape)
    in_piece = jnp.stack([piece == number for number in range(_PIECES)]).astype(albedo.dtype)
    return jnp.sum(values * in_piece[:, None], axis=0)


def _columns(albedo, z, poles, offsets, norms: Any = 1.0, *, xp: Any = jnp) -> Any:
    """Eigenvectors q z_i/(d_i - lambda_j), scaled to z . column = 1, times norms of the columns,
    (..., i, j, batch).
    """
    # On the diagonal d_j - lambda_j = q r_j, and q cancels.
    off_diagonal = _off_diagonal(poles.shape[-2])
    q = albedo[..., None, None, :]
    r = offsets[..., None, :, :]
    numerator = z[..., :, None, :] * xp.where(off_diagonal, q, 1.0) * norms
    return numerator / xp.where(off_diagonal, _pole_differences(poles) + q * r, r)


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
    q = albedo[..., None, :]
    off_diagonal = _off_diagonal(poles.shape[-2])
    difference = _pole_differences(poles)
    denominator = jnp.where(off_diagonal, difference + (q * r)[..., None, :, :], 1.0)
    slope = jnp.where(off_diagonal, strengths[..., :, None, :] / denominator**2, 0.0)
    # F(r; q, z^2, d) = z_j^2/r + q sum z_i^2/(d_i - d_j + q r) - 1 = 0: dr = -(dF at fixed r)/F_r.
    by_r = -strengths / r**2 - q * q * jnp.sum(slope, axis=-3)
    residual = jnp.zeros_like(r)
    if not isinstance(d_albedo, SymbolicZero):
        residual += jnp.sum(slope * difference, axis=-3) * d_albedo[..., None, :]
    if not isinstance(d_strengths, SymbolicZero):
        by_strengths = jnp.where(off_diagonal, q[..., None, :, :] / denominator, 0.0)
        residual += d_strengths / r
        residual += jnp.sum(by_strengths * d_strengths[..., :, None, :], axis=-3)
    if not isinstance(d_poles, SymbolicZero):
        residual -= q * jnp.sum(slope * _pole_differences(d_poles), axis=-3)
    return r, -residual / by_r


_implicit.defjvp(_implicit_jvp, symbolic_zeros=True)


@jax.named_scope("modes")
def layer_modes(
    albedo: Float[Array, "*layers batch"],
    cosines: Float[Array, "n #batch"] | Float[np.ndarray, "n"],
    weights: Float[Array, "n #batch"] | Float[np.ndarray, "n"],
) -> LayerModes:
    """Modes of layers of single-scattering albedo q for half-range directions (cosines descending).

    Args:
        albedo: q in [0, 1], (..., batch). Derivatives by it are cheaper by `turning`.
        cosines: mu in (0, 1], descending, (n, batch). A numpy array (n,) is the fast path: its
            roots are tabulated.
        weights: quadrature weights, positive, with sum w = 1, in the shape of the cosines.

    Returns:
        `LayerModes`, arrays (..., n, batch), (..., n, n, batch), (..., n, batch).
    """
    q = albedo[..., None, :]
    if isinstance(cosines, np.ndarray) and isinstance(weights, np.ndarray):
        # Known directions: roots and couplings come from the table.
        n = cosines.size
        values = _from_table(albedo, _table(np.stack([cosines, weights]).tobytes()))
        r = jnp.moveaxis(values[:n], 0, -2)
        coupling = jnp.moveaxis(values[n : 2 * n], 0, -2)
        poles = (1.0 / cosines**2).astype(albedo.dtype)[:, None]
        z = (np.sqrt(weights) / cosines).astype(albedo.dtype)[:, None]
        # lambda_0 vanishes with 1 - q; tabulated over it, it keeps its digits.
        smallest = ((1.0 - albedo) * values[-1])[..., None, :]
        eigenvalues = jnp.where((np.arange(n) == 0)[:, None], smallest, poles - q * r)
        vectors = _columns(albedo, z, poles, r, coupling[..., None, :, :])
        return LayerModes(eigenvalues, vectors, coupling)
    # Traced directions: the roots are iterated, and the equation, not the iteration, is
    # differentiated.
    cosines = jnp.asarray(cosines, albedo.dtype)
    weights = jnp.asarray(weights, albedo.dtype)
    poles = 1.0 / cosines**2
    strengths = weights * poles
    root = secular_offsets(*jax.lax.stop_gradient((albedo, poles, strengths)))
    r = _implicit(root, albedo, poles, strengths)
    columns = _columns(albedo, jnp.sqrt(strengths), poles, r)
    # The secular equation says z . column = 1, so the coupling is the column's normalisation
    # itself.
    coupling = 1.0 / jnp.sqrt(jnp.sum(columns**2, axis=-3))
    return LayerModes(
        _decay_squared(albedo, cosines, weights, poles - q * r),
        columns * coupling[..., None, :, :],
        coupling,
    )


def turning(modes: LayerModes) -> Float[Array, "*layers n n batch"]:
    """Turning of the modes into each other as the albedo grows: d vectors/dq = vectors @ turning,
    (..., n, n, batch).

    First-order perturbation of diag(d) - q z z^T: antisymmetric, with d lambda_j/dq = -coupling_j^2
    and
    d coupling/dq = coupling @ turning.
    """
    lam = modes.decay_squared
    difference = lam[..., None, :, :] - lam[..., :, None, :]
    off_diagonal = _off_diagonal(lam.shape[-2])
    product = modes.coupling[..., :, None, :] * modes.coupling[..., None, :, :]
    return jnp.where(off_diagonal, -product, 0.0) / jnp.where(off_diagonal, difference, 1.0)


def _decay_squared(albedo: Array, cosines: Array, weights: Array, eigenvalues: Array) -> Array:
    """Give the smallest eigenvalue, which vanishes with 1 - q, its full relative accuracy.

    With sum w = 1 the secular equation reads (1 - q) = lambda q sum w mu^2/(1 - lambda mu^2).
    """
    smallest = eigenvalues[..., 0, :]
    guess = jax.lax.stop_gradient(smallest)
    q = jax.lax.stop_gradient(albedo)
    squared = jax.lax.stop_gradient(cosines) ** 2
    near_one = q > 0.7
    denominator = jnp.where(near_one[..., None, :], 1.0 - guess[..., None, :] * squared, 1.0)
    second_moment = jnp.sum(jax.lax.stop_gradient(weights) * squared / denominator, axis=-2)
    accurate = jnp.where(near_one, (1.0 - q) / jnp.where(near_one, q * second_moment, 1.0), guess)
    # Value from the accurate form, derivative from the eigenvalue itself.
    refined = accurate + (smallest - guess)
    return jnp.concatenate([refined[..., None, :], eigenvalues[..., 1:, :]], axis=-2)
