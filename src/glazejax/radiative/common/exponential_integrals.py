r"""Exponential integrals, the kernels of isotropic scattering once the directions are integrated
away.

    E_n(x) = int_0^1 mu^(n-2) e^(-x/mu) dmu,    E_n' = -E_(n-1)

Below 1 a power series with its logarithm, above it e^-x times a Chebyshev series in 1/(x + a). Both
have a fixed number of terms, unlike `jax.scipy.special.expn`, whose cost grows as 1/x.
"""

import functools
import math
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from .kernels import Reals, polynomial
from .quadrature import gauss

Arguments: TypeAlias = Float[ArrayLike, "..."]
"""Numbers that a function is asked for, JAX's or not."""
Coefficients: TypeAlias = tuple[float, ...]
"""Of a series, from the lowest power or degree up."""

_SPLIT = 1.0
_SERIES_TERMS = 20
_CHEBYSHEV_TERMS = 28
# The cone's integrals: R is 1e-16 or less beyond this substituted cosine, where the index is almost
# one.
_CONE_REACH = 9.0
_CONE_NODES = 20
_CONE_NODES_NEAR_ONE = 56
_NEAR_ONE = 1.2


def expn(order: int, x: Arguments) -> Reals:
    """Exponential integral E_n(x) for x >= 0.

    Args:
        order: n >= 0, static. E_0 = e^-x/x.
        x: argument, (...), >= 0.

    Returns:
        E_n(x), (...), relative error some 1e-15 in float64. At zero E_n = 1/(n - 1), infinite for n
        < 2; the slope of E_1 and E_2, infinite there, is that of the smallest positive number.
    """
    return _expn(order, x)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _expn(order: int, x: Arguments) -> Reals:
    x = _floating(x)
    tiny = least_argument(x.dtype)
    if order == 0:
        return jnp.exp(-x) / jnp.maximum(x, tiny)
    small = x < _SPLIT
    near, power = _series(order)
    # What is not chosen below is replaced, so that its slope is finite.
    safe = jnp.where(small, x, 0.5)
    # (-x)^(n-1)/(n-1)! (psi(n) - ln x), times x = 0 nothing for n > 1 and infinite for n = 1.
    logarithm = jnp.log(jnp.maximum(safe, tiny))
    below = polynomial(near, safe) - power * safe ** (order - 1) * logarithm
    if order == 1:
        below = jnp.where(x == 0, jnp.inf, below)
    far, shift = _far_series(order)
    beyond = jnp.where(small, 2.0, x)
    t = 2.0 * ((_SPLIT + shift) / (beyond + shift)) - 1.0
    return jnp.where(small, below, jnp.exp(-beyond) * _clenshaw(far, t) / (beyond + order))


@_expn.defjvp
def _expn_jvp(order: int, primals, tangents):
    (x,), (dx,) = primals, tangents
    if order == 0:
        value = expn(0, x)
        return value, -(1.0 + 1.0 / jnp.maximum(x, least_argument(x.dtype))) * value * dx
    # Where the slope is infinite, the largest that cannot overflow once it is multiplied.
    return expn(order, x), -expn(order - 1, jnp.maximum(x, least_argument(x.dtype))) * dx


def _floating(x: ArrayLike) -> Array:
    array = jnp.asarray(x)
    return (
        array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(jnp.result_type(float))
    )


def least_argument(dtype: np.dtype) -> float:
    """Smallest positive argument that counts in a precision."""
    return 1e-290 if dtype == jnp.float64 else 1e-36


@functools.cache
def _series(order: int) -> tuple[Coefficients, float]:
    """Coefficients of the power series without its logarithm, and the factor of x^(n-1) ln x."""
    terms = [
        -((-1.0) ** k) / ((k - order + 1) * math.factorial(k)) if k != order - 1 else 0.0
        for k in range(max(_SERIES_TERMS, order + 2))
    ]
    power = (-1.0) ** (order - 1) / math.factorial(order - 1)
    digamma = -np.euler_gamma + sum(1.0 / k for k in range(1, order))
    terms[order - 1] = power * digamma
    return tuple(float(c) for c in terms), power


@functools.cache
def _far_series(order: int) -> tuple[Coefficients, float]:
    """Chebyshev series of (x + n) e^x E_n(x), and the shift a of its variable 1/(x + a)."""
    shift = 2.0 + 0.6 * (order - 1)
    count = _CHEBYSHEV_TERMS
    odd = 2 * np.arange(count) + 1
    angle = np.pi * odd / (2 * count)
    # Chebyshev's points of t, as arguments x from the split to infinity.
    x = 2.0 * (_SPLIT + shift) / (np.cos(angle) + 1.0) - shift
    tail = np.zeros(count)
    for k in range(2000, 0, -1):  # the continued fraction, backwards
        tail = k * (order + k - 1) / (x + order + 2 * k - tail)
    value = (x + order) / (x + order - tail)
    # The angle k (2 j + 1) pi / (2 count) reduced by whole turns before it is rounded.
    cosines = np.cos(np.pi * (np.outer(np.arange(count), odd) % (4 * count)) / (2 * count))
    series = 2.0 / count * cosines @ value
    series[0] *= 0.5
    return tuple(float(c) for c in series), shift


def _clenshaw(coefficients: Coefficients, t: Array) -> Array:
    last = jnp.full_like(t, coefficients[-1])
    before = jnp.zeros_like(t)
    for c in coefficients[-2:0:-1]:
        last, before = 2.0 * t * last - before + c, last
    return t * last - before + coefficients[0]


def cone_nodes(
    refractive_index: float | Float[Array, "*batch"], nodes: int | None = None
) -> tuple[Array | np.ndarray, Array | np.ndarray, Array | np.ndarray]:
    r"""Nodes for integrals over the directions that can leave, in the cosine mu inside the medium.

    With mu_F = a sinh u and n mu = a cosh u, a^2 = n^2 - 1, both Fresnel amplitudes are entire
    functions of e^-2u, so Gauss nodes in u converge exponentially however near the index is to one.

    Args:
        refractive_index: n > 1, a number (the result is then numpy) or an array (...).
        nodes: how many; by default enough for rounding of the integrals that
            `internal_reflection_integral` makes.

    Returns:
        Cosines mu, weights dmu, and the internal reflectance R(mu), (..., nodes). Where the index
        is almost one the nodes end where R has become negligible, so they serve integrals of R
        only.
    """
    traced = isinstance(refractive_index, jax.Array)
    xp = jnp if traced else np
    n = (
        refractive_index[..., None]
        if isinstance(refractive_index, jax.Array)
        else np.float64(refractive_index)
    )
    if nodes is None:
        nodes = _CONE_NODES_NEAR_ONE if traced or n < _NEAR_ONE else _CONE_NODES
    # Kept above 0, which it is at an index of one, where its root would have no slope.
    floor = 1e-18 if n.dtype == np.float64 else 1e-11
    a = xp.sqrt(xp.maximum((n - 1.0) * (n + 1.0), floor))
    reach = xp.minimum(xp.arcsinh(1.0 / a), _CONE_REACH)
    y, w = gauss(nodes)
    y, w = (jnp.asarray(v, n.dtype) for v in (y, w)) if traced else (y, w)
    u = reach * y
    cosh = xp.cosh(u)
    sinh = xp.sinh(u)
    # n mu = a cosh u, so that dmu = a sinh u du/n.
    mu = a * cosh / n
    s = xp.exp(-2.0 * u)  # (n mu - mu_F)/(n mu + mu_F)
    p = (n * n * sinh - cosh) / (n * n * sinh + cosh)
    return mu, w * reach * a * sinh / n, 0.5 * (s * s + p * p)


def internal_reflection_integral(
    power: int,
    x: Arguments,
    refractive_index: float | Reals,
) -> Reals:
    """Integral over mu in [0, 1] of R(mu) mu^(power-1) e^(-x/mu), R the internal Fresnel
    reflectance.

    Power 0 is U(x) of paper A's eq. (17) as a function of x = tau + s, power 1 the interface's part
    of M (18), power 2 half of K (20).

    Args:
        power: static, >= 0.
        x: optical depth, (...), >= 0. For power 0 it must be positive: the totally reflected part
            has a logarithm.
        refractive_index: n >= 1, a number or a JAX array that broadcasts against x. At n = 1 the
            result is zero.

    Returns:
        The integral, broadcast shape. Absolute error some 1e-15 in float64 (relative to its value
        at x = 0).
    """
    x = _floating(x)
    if not isinstance(refractive_index, jax.Array) and refractive_index == 1:
        return jnp.zeros_like(x)
    mu, w, r = (jnp.asarray(v, x.dtype) for v in cone_nodes(refractive_index))
    # The cone by its nodes; beyond the critical angle R = 1: mu_c^p E_(p+1)(x/mu_c).
    cone = jnp.sum(w * r * mu ** (power - 1) * jnp.exp(-x[..., None] / mu), axis=-1)
    n = jnp.asarray(refractive_index, x.dtype)
    critical = critical_cosine(n)
    total = critical**power * expn(power + 1, x / critical)
    result: Array = cone + total
    return jnp.where(jnp.asarray(n > 1.0), result, jnp.zeros_like(result))


def critical_cosine(refractive_index: float | Arguments) -> Reals:
    """Cosine inside of the critical angle, sqrt(1 - 1/n^2), kept just above zero for n =
    1, (...).
    """
    n = _floating(refractive_index)
    return (
        jnp.sqrt(jnp.maximum((n - 1.0) * (n + 1.0), 1e-18 if n.dtype == jnp.float64 else 1e-11)) / n
    )
