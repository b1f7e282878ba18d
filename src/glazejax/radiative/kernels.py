"""Elementary integrals of exponentials over one layer, finite in value and gradient everywhere.

Every function here is analytic where a textbook form divides zero by zero (equal exponents, empty layer,
conservative scattering), so a beam on a node of the quadrature or an albedo of one is nothing special.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# Below these arguments the power series is used; above, the closed form has lost fewer digits.
_SERIES_PHI = 0.5
_SERIES_TANHC = 0.25

# phi'(x) = sum_k (-1)^(k+1) (k+1)/(k+2)! x^k
_PHI_SLOPE = (
    -1.0 / 2,
    1.0 / 3,
    -1.0 / 8,
    1.0 / 30,
    -1.0 / 144,
    1.0 / 840,
    -1.0 / 5760,
    1.0 / 45360,
    -1.0 / 403200,
    1.0 / 3991680,
    -1.0 / 43545600,
    1.0 / 518918400,
    -1.0 / 6706022400,
    1.0 / 93405312000,
    -1.0 / 1394852659200,
)

# tanh(sqrt x)/sqrt x = sum_k t_k x^k, from the Bernoulli numbers.
_TANHC = (
    1.0,
    -1.0 / 3,
    2.0 / 15,
    -17.0 / 315,
    62.0 / 2835,
    -1382.0 / 155925,
    21844.0 / 6081075,
    -929569.0 / 638512875,
    6404582.0 / 10854718875,
    -443861162.0 / 1856156927625,
    18888466084.0 / 194896477400625,
    -113927491862.0 / 2900518163668125,
    58870668456604.0 / 3698160658676859375,
    -8374643517010684.0 / 1298054391195577640625,
    689005380505609448.0 / 263505041412702261046875,
    -129848163681107301953.0 / 122529844256906551386796875,
    1736640792209901647222.0 / 4043484860477916195764296875,
    -418781231495293038913922.0 / 2405873491984360136479756640625,
)
_TANHC_SLOPE = tuple(k * c for k, c in enumerate(_TANHC))[1:]


def _polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    total = jnp.full_like(x, coefficients[-1])
    for c in coefficients[-2::-1]:
        total = total * x + c
    return total


@jax.custom_jvp
def phi(x: Float[Array, "..."]) -> Float[Array, "..."]:
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
        _polynomial(_PHI_SLOPE, jnp.where(small, x, 0.0)),
        (jnp.exp(-safe) - jnp.where(small, 0.0, value)) / safe,
    )
    return value, slope * dx


@jax.custom_jvp
def tanhc_sqrt(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """tanh(sqrt(x)) / sqrt(x) for x >= 0: analytic in x, so even in the eigenvalue's root."""
    small = x < _SERIES_TANHC
    root = jnp.sqrt(jnp.where(small, 1.0, x))
    return jnp.where(small, _polynomial(_TANHC, jnp.where(small, x, 0.0)), jnp.tanh(root) / root)


@tanhc_sqrt.defjvp
def _tanhc_sqrt_jvp(primals, tangents):
    x: Array = primals[0]
    dx: Array = tangents[0]
    value = tanhc_sqrt(x)
    small = x < _SERIES_TANHC
    safe = jnp.where(small, 1.0, x)
    # d/dx from sech^2 = 1 - tanh^2.
    closed = (1.0 - safe * value**2 - value) / (2.0 * safe)
    slope = jnp.where(small, _polynomial(_TANHC_SLOPE, jnp.where(small, x, 0.0)), closed)
    return value, slope * dx


@jax.custom_jvp
def sech_sqrt(x: Float[Array, "..."]) -> Float[Array, "..."]:
    """1 / cosh(sqrt(x)) for x >= 0, without overflow."""
    positive = x > 0
    root = jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0)
    decay = jnp.exp(-root)
    return 2.0 * decay / (1.0 + decay * decay)


@sech_sqrt.defjvp
def _sech_sqrt_jvp(primals, tangents):
    x: Array = primals[0]
    dx: Array = tangents[0]
    value = sech_sqrt(x)
    return value, -0.5 * value * tanhc_sqrt(x) * dx


def decay_integral(a: Float[Array, "..."], depth: Float[Array, "..."]) -> Float[Array, "..."]:
    """Integral of exp(-a t) over t in [0, depth]."""
    return depth * phi(a * depth)


def two_decays(a: Float[Array, "..."], b: Float[Array, "..."], depth: Float[Array, "..."]) -> Float[Array, "..."]:
    """Integral of exp(-a (depth - t)) exp(-b t) over the layer: (e^-a D - e^-b D) / (b - a).

    Written so that a = b, where the usual form is 0/0, is an ordinary point.
    """
    return depth * jnp.exp(-jnp.minimum(a, b) * depth) * phi(jnp.abs(b - a) * depth)
