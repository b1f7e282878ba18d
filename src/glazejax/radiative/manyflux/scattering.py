"""Scattering between discrete directions, one matrix for each Fourier mode of azimuth.

With Lambda_l^m = sqrt((l - m)!/(l + m)!) P_l^m the m-th mode of the phase function between cosines
mu and mu' is sum_l (2l + 1) chi_l Lambda_l^m(mu) Lambda_l^m(mu'). Turning mu' round changes the
sign of the terms with l - m odd, so that the terms with l - m even act on the sum of up- and
downward light, and the odd ones on the difference.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.linalg import einsum, matmul, transpose
from ..common.phase import delta_m
from .bordered import Bordered, Diagonal


class Layers(NamedTuple):
    """One stack, top first."""

    albedo: Float[Array, "layers"]
    optical_thickness: Float[Array, "layers"]
    moments: Float[Array, "layers terms"]
    ground: Float[Array, ""]


class ScaledScattering(NamedTuple):
    """Scattering of layers between discrete directions, delta-M scaled."""

    albedo: Array  # (layers,)
    thickness: Array  # (layers,)
    even: Array  # (layers, modes, n + v, n + i)
    odd: Array

    def rates(self, cosines: Diagonal) -> tuple[Bordered, Bordered]:
        """A and B of each layer and mode."""
        return rates(self.albedo[:, None], self.even, self.odd, cosines)


def sine(cosine: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """Sine of an angle with that cosine; its slope, infinite at normal incidence, is taken as zero
    there.
    """
    squared = jnp.maximum(1.0 - cosine * cosine, 0.0)
    return jnp.sqrt(jnp.where(squared > 0, squared, 1.0)) * (squared > 0).astype(squared.dtype)


def associated_legendre(
    cosines: Float[Array, "*batch n"], modes: int, terms: int
) -> Float[Array, "*batch modes terms n"]:
    """Lambda_l^m(mu) for m < modes and l < terms; zero where l < m.

    Args:
        cosines: mu, (..., n), in [0, 1].
        modes, terms: numbers of orders m and degrees l.

    Source: Dave and Armstrong, J. Quant. Spectrosc. Radiat. Transfer 10 (1970) 557: upward in l it
    is stable.
    """
    mu = cosines[..., None, :]
    sines = sine(mu)
    m = np.arange(modes)
    # Lambda_m^m = sqrt((2m - 1)/(2m)) sin Lambda_(m-1)^(m-1).
    start = [jnp.ones_like(sines)]
    for factor in np.sqrt((2 * m[1:] - 1) / (2 * m[1:])):
        start.append(start[-1] * sines * factor)
    sectoral = jnp.concatenate(start, axis=-2)  # Lambda_m^m, (..., modes, n)
    # Lambda_l = a_l mu Lambda_(l-1) - b_l Lambda_(l-2) for each order, from l = m + 1 on.
    degree = np.arange(terms)[:, None]
    above = degree > m
    below = np.sqrt(np.where(above, degree**2 - m**2, 1.0))
    first = np.where(above, (2 * degree - 1) / below, 0.0)
    second = np.where(above, np.sqrt(np.maximum((degree - 1) ** 2 - m**2, 0)) / below, 0.0)

    def climb(state: tuple[Array, Array], item: tuple[Array, Array, Array]):
        lower, second_lower = state
        a, b, begins = (x[:, None] for x in item)
        degree_value = jnp.where(begins, sectoral, a * mu * lower - b * second_lower)
        return (degree_value, lower), degree_value

    zero = jnp.zeros_like(sectoral)
    items = (jnp.asarray(first, mu.dtype), jnp.asarray(second, mu.dtype), jnp.asarray(degree == m))
    _, functions = jax.lax.scan(climb, (zero, zero), items)
    return jnp.moveaxis(functions, 0, -2)


def azimuth_waves(azimuth: Float[Array, "k"], modes: int) -> Float[Array, "modes k"]:
    """Factors that the modes of radiance are summed with: cos(m azimuth), twice that from m = 1 on.

    Args:
        azimuth: radians, (k,).
        modes: number of orders m.
    """
    m = jnp.arange(modes, dtype=azimuth.dtype)[:, None]
    return jnp.cos(m * azimuth) * jnp.where(m == 0, 1.0, 2.0)


def scattering(
    moments: Float[Array, "*#batch terms"],
    nodes: Float[Array, "*#batch modes terms n"],
    viewing: Float[Array, "*#batch modes terms v"],
    incidence: Float[Array, "*#batch modes terms i"],
    roots: Float[Array, "*#batch n"],
) -> tuple[Float[Array, "*batch modes n+v n+i"], Float[Array, "*batch modes n+v n+i"]]:
    """Halved sum and difference of forward and backward scattering, C_even = (C+ + C-)/2 and C_odd
    = (C+ - C-)/2.

    Args:
        moments: chi_l, (..., terms).
        nodes, viewing, incidence: Lambda_l^m at the nodes and the added directions; batch axes
            broadcast.
        roots: sqrt(w) of the nodes, (..., n); added directions count as of weight one.

    Returns:
        Bodies of bordered matrices, (..., modes, n + v, n + i), symmetric in form.

    Notes:
        Nodes integrate products of Legendre functions with a small error, by which scattering would
        lose or gain light. The even part of mode 0 is corrected (by a symmetric matrix of rank two)
        so that it returns exactly what comes in.
    """
    modes, terms, count = nodes.shape[-3:]
    even = (np.arange(terms) - np.arange(modes)[:, None]) % 2 == 0
    # With sqrt(w) at the nodes, sums over directions are plain products of matrices.
    weighed = nodes * roots[..., None, None, :]
    across = _append_directions(weighed, incidence)
    down = _append_directions(weighed, viewing)
    # (2l + 1) chi_l, the weight of each degree in the phase function.
    factors = ((2.0 * np.arange(terms) + 1.0) * moments)[..., None, :, None]

    def part(parity: np.ndarray) -> Array:
        mask = jnp.asarray(parity, factors.dtype)[..., None]
        return matmul(transpose(down * factors * mask), across * mask)

    c_even = part(even)
    c_odd = part(~even)
    # Flux is in the even part of mode 0: there all light that is scattered must come back.
    zeroth = c_even[..., 0, :, :]
    rows_root = _append_directions(roots, jnp.ones(down.shape[-1] - count, roots.dtype))
    columns_root = _append_directions(roots, jnp.ones(across.shape[-1] - count, roots.dtype))
    # Over the sum of weights, which is one only to the accuracy of the rule where several media
    # share it.
    scale = jnp.sum(roots * roots, axis=-1, keepdims=True)
    share = roots / scale
    # What each row and column lacks by the error of the nodes.
    rows_missing = rows_root - einsum("...ij,...j->...i", zeroth[..., :, :count], roots)
    columns_missing = columns_root - einsum("...i,...ij->...j", roots, zeroth[..., :count, :])
    missing_flux = einsum("...j,...j->...", columns_missing[..., :count], share)[..., None, None]
    # The symmetric matrix of rank two that adds this; the flux that both terms bring is taken off
    # once.
    change = rows_missing[..., :, None] * columns_root[..., None, :]
    change += rows_root[..., :, None] * columns_missing[..., None, :]
    change = (change - missing_flux * rows_root[..., :, None] * columns_root[..., None, :]) / scale[
        ..., None
    ]
    # Light scattered once between two added directions meets no quadrature and stays exact.
    seen, lit = (np.arange(root.shape[-1]) >= count for root in (rows_root, columns_root))
    return c_even.at[..., 0, :, :].add(jnp.where(seen[:, None] & lit, 0.0, change)), c_odd


def rates(
    albedo: Float[Array, "*#batch"],
    even: Float[Array, "*#batch rows columns"],
    odd: Float[Array, "*#batch rows columns"],
    cosines: Diagonal,
) -> tuple[Bordered, Bordered]:
    """Operators A, B of u' = -A v, v' = -B u for u, v the sum and difference of down- and upward
    sqrt(mu w) I.

    A = M^-1/2 (1 - q C_odd) M^-1/2 and B the same with C_even.

    Args:
        albedo: q, (...).
        even, odd: from `scattering`, (..., n + v, n + i).
        cosines: of nodes (..., n), directions of viewing (..., v) and of incidence (..., i).
    """
    mu, viewing, incidence = cosines
    # M^-1/2 on both sides, where viewing and incidence have rows and columns of their own.
    rows, columns = (_append_directions(mu, added) ** -0.5 for added in (viewing, incidence))
    scale = albedo[..., None, None] * rows[..., :, None] * columns[..., None, :]
    batch = jnp.broadcast_shapes(scale.shape[:-2], even.shape[:-2])
    # An added direction loses its own light at the rate 1/mu.
    along = jnp.broadcast_to(1.0 / viewing, (*batch, viewing.shape[-1]))
    into = jnp.broadcast_to(1.0 / incidence, (*batch, incidence.shape[-1]))
    i = np.arange(mu.shape[-1])

    def operator(c: Array) -> Bordered:
        body = jnp.broadcast_to(-scale * c, (*batch, *c.shape[-2:]))
        return Bordered(body.at[..., i, i].add(1.0 / mu), along, into)

    return operator(odd), operator(even)


def _append_directions(nodes: Array, added: Array) -> Array:
    """Nodes, then added directions, on the last axis; all other axes broadcast."""
    batch = jnp.broadcast_shapes(nodes.shape[:-1], added.shape[:-1])
    return jnp.concatenate(
        [jnp.broadcast_to(a, (*batch, a.shape[-1])) for a in (nodes, added)], axis=-1
    )


def scatter_between(
    layers: Layers, cosines: Diagonal, roots: Array, terms: int, modes: int
) -> ScaledScattering:
    """Scattering of layers between directions, with as many moments as are kept.

    Args:
        layers: of one stack.
        cosines: the same for all layers, (n,), or those of each, (layers, n).
        roots: square roots of the nodes' weights, of the same shape.
        terms: Legendre moments.
        modes: of the azimuth.
    """
    # A forward peak beyond the moments kept counts as light that was not scattered.
    albedo, thickness, moments = delta_m(
        layers.albedo, layers.optical_thickness, layers.moments, terms
    )
    nodes, viewing, incidence = (associated_legendre(c, modes, moments.shape[-1]) for c in cosines)
    even, odd = scattering(moments, nodes, viewing, incidence, roots)
    return ScaledScattering(albedo, thickness, even, odd)
