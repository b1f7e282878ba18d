"""Elementary integrals of exponentials over one layer, finite in value and gradient everywhere.

Every function here is analytic where a textbook form divides zero by zero (equal exponents, empty
layer, conservative scattering), so a beam on a node of the quadrature or an albedo of one is
nothing special.
"""

import math
from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Reals: TypeAlias = Float[Array, "..."]
"""Real numbers in any shape; those of one call broadcast."""

# Below these arguments the power series is used; above, the closed form has lost few digits.
_SERIES_PHI = 0.5
_SERIES_DECAYS = 0.1
_SERIES_TANH = 0.02
_LINEAR = 1e-20

# phi'(x) = sum_k (-1)^(k+1) (k+1)/(k+2)! x^k
_PHI_SLOPE = tuple((-1.0) ** (k + 1) * (k + 1) / math.factorial(k + 2) for k in range(15))

TANHC = (
    1.0,
    -1.0 / 3,
    2.0 / 15,
    -17.0 / 315,
    62.0 / 2835,
    -1382.0 / 155925,
    21844.0 / 6081075,
    -929569.0 / 638512875,
    6404582.0 / 10854718875,
)
"""Series of tanh(sqrt x)/sqrt x, from the Bernoulli numbers."""
_TANHC_SLOPE = tuple(k * TANHC[k] for k in range(1, len(TANHC)))
# (1 - e^-x)/x = sum_k (-x)^k/(k + 1)!
_PHI = tuple((-1.0) ** k / math.factorial(k + 1) for k in range(10))


def polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    """Polynomial by its coefficients, from the lowest power up; even and odd powers apart: half the
    steps that wait for each other.
    """
    square = x * x
    even, odd = (jnp.full_like(x, half[-1]) for half in (coefficients[::2], coefficients[1::2]))
    for c in coefficients[::2][-2::-1]:
        even = even * square + c
    for c in coefficients[1::2][-2::-1]:
        odd = odd * square + c
    return even + x * odd


@jax.custom_jvp
def phi(x: Reals) -> Reals:
    """(1 - exp(-x)) / x for x >= 0, equal to one at zero."""
    safe = jnp.where(x == 0, 1.0, x)
    return jnp.where(x == 0, 1.0, -jnp.expm1(-safe) / safe)


@phi.defjvp
def _phi_jvp(primals, tangents):
    x: Array = primals[0]
    dx: Array = tangents[0]
    value = phi(x)
    small = x < _SERIES_PHI
    safe = jnp.where(small, 1.0, x)
    slope = jnp.where(
        small,
        polynomial(_PHI_SLOPE, jnp.where(small, x, 0.0)),
        (jnp.exp(-safe) - jnp.where(small, 0.0, value)) / safe,
    )
    return value, slope * dx


@jax.custom_jvp
def quotient(a: Reals, b: Reals) -> Reals:
    """a / b, whose slope ends with a division too.

    What ends with one XLA computes once and keeps. What ends with anything else it computes again
    for each use, within sums one number at a time.
    """
    return a / b


@quotient.defjvp
def _quotient_jvp(primals, tangents):
    b: Array = primals[1]
    d_a: Array
    d_b: Array
    d_a, d_b = tangents
    value = quotient(*primals)
    return value, (d_a - value * d_b) / b


def fading(decay_squared: Reals, depth: Reals) -> tuple[Array, Array]:
    """kappa = sqrt(decay_squared), but never zero, and expm1(-kappa depth)."""
    tiny = float(np.finfo(decay_squared.dtype).tiny)
    kappa = jnp.sqrt(jnp.maximum(decay_squared, tiny))
    return kappa, jnp.expm1(-kappa * depth)


@jax.custom_jvp
def tanh_sech(decay_squared: Reals, depth: Reals) -> tuple[Array, Array]:
    """tanh(kappa D)/kappa and 1/cosh(kappa D), both even in kappa = sqrt(decay_squared) >= 0."""
    kappa, faded = fading(decay_squared, depth)
    fade = 1.0 + faded
    norm = 1.0 / (1.0 + fade * fade)
    # Where kappa D could underflow the layer is as good as linear.
    tanh = jnp.where(kappa * depth < _LINEAR, depth, -faded * (1.0 + fade) * norm / kappa)
    return tanh, 2.0 * fade * norm


@tanh_sech.defjvp
def _tanh_sech_jvp(primals, tangents):
    decay_squared: Array
    depth: Array
    decay_squared, depth = primals
    d_squared, d_depth = tangents
    tanh, sech = tanh_sech(decay_squared, depth)
    argument = decay_squared * depth**2
    small = argument < _SERIES_TANH
    series = 2.0 * depth**3 * polynomial(_TANHC_SLOPE, jnp.where(small, argument, 0.0))
    slope = jnp.where(small, series, depth * sech**2 - tanh) / jnp.where(
        small, 2.0, 2.0 * decay_squared
    )
    d_tanh = slope * d_squared + sech**2 * d_depth
    d_sech = -0.5 * sech * tanh * depth * d_squared - sech * decay_squared * tanh * d_depth
    return (tanh, sech), (d_tanh, d_sech)


def decay_integral(a: Reals, depth: Reals) -> Reals:
    """Integral of exp(-a t) over t in [0, depth]."""
    return depth * phi(a * depth)


def two_decays(a: Reals, b: Reals, depth: Reals, faded_a: Reals, faded_b: Reals) -> Reals:
    """Integral of exp(-a (depth - t)) exp(-b t) over the layer: (e^-a D - e^-b D)/(b - a), regular
    at a = b.

    ``faded_a`` is expm1(-a depth), ``faded_b`` expm1(-b depth): the caller has them already.
    """
    x = (b - a) * depth
    close = jnp.abs(x) < _SERIES_DECAYS
    # (1 - e^-x)/x by its series, where the difference below has no digits.
    series = depth * (1.0 + faded_a) * polynomial(_PHI, jnp.where(close, x, 0.0))
    return quotient(jnp.where(close, series, faded_a - faded_b), jnp.where(close, 1.0, b - a))
