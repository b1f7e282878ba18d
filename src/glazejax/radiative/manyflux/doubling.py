r"""Reflection and transmission operators of one homogeneous layer, by doubling: no eigenvectors,
any phase function.

With y = sqrt(mu w) I a layer is u' = -A v, v' = -B u (see `scattering.rates`). It is symmetric
about its middle, so that at the distance h from there even fields have v = -X u and odd ones u = -Y
v,

    X = B t(A B),  Y = A t(B A),
    t(z) = tanh(sqrt(z) h)/sqrt(z) = h (1 - z h^2/3 + 2 z^2 h^4/15 - ...),
    1 - (T + R) = 2 X (1 + X)^-1,     1 - (T - R) = 2 Y (1 + Y)^-1.

A layer so thin that the series converges is doubled until it has its thickness. Next to R the loss
U = 1 - T is carried instead of T, so that thin layers keep their relative accuracy and an albedo of
one loses no light. Everything is rational in what is given: gradients have no special cases.
"""

from typing import TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.inputs import Numbers, concrete
from ..common.kernels import TANHC
from .bordered import Bordered

LayerOperators: TypeAlias = tuple[Bordered, Bordered]
"""Reflection R and loss U = 1 - T of layers."""

# Series of tanh(x)/x in x^2, for x up to an eighth.
_SERIES = TANHC[:7]


def doublings(optical_thickness: Numbers, least_cosine: float) -> int:
    """Number of times that a layer must be halved until the series holds in all directions.

    Args:
        optical_thickness: of layers; up to 1e6 where it is traced.
        least_cosine: smallest cosine of any direction inside.
    """
    thickness = concrete(optical_thickness)
    largest = 1e6 if thickness is None else max(float(thickness.max(initial=0.0)), 1e-300)
    # The series holds for x = D 2^-count/(2 mu) up to an eighth (`_SERIES`).
    exact = max(0, int(np.ceil(np.log2(largest / (0.25 * least_cosine)))))
    # Few different numbers, so that another thickness rarely needs another program.
    return -(-exact // 4) * 4


def layer_by_doubling(
    a: Bordered, b: Bordered, thickness: Float[Array, "*batch"], count: int
) -> LayerOperators:
    """Reflection R and loss U = 1 - T of layers.

    Args:
        a, b: operators A and B of each layer.
        thickness: optical thickness D, (...), >= 0.
        count: number of doublings, static, at least `doublings` of the thickest layer.

    Returns:
        R and U, `Bordered`.
    """
    # The slice that the series is for; each doubling joins two equal slices.
    depth = thickness * 2.0**-count
    start = _thin_layer(a, b, depth)
    return jax.lax.fori_loop(0, count, lambda _, layer: _double(*layer), start)


def _thin_layer(a: Bordered, b: Bordered, depth: Array) -> LayerOperators:
    # A slice's faces lie at the distance h from its middle.
    h = 0.5 * depth

    # X from B and A, Y from A and B, both at once.
    first = pair(b, a)
    second: Bordered = jax.tree.map(lambda x: x[::-1], first)
    # z h^2 of the series, for z = A B and z = B A.
    squared = (second @ first).scaled(h * h)
    # Horner's rule, from the highest power down.
    total = squared.scaled(_SERIES[-1]).plus_identity(_SERIES[-2])

    def lower_power(total: Bordered, coefficient: Array):
        return (squared @ total).plus_identity(coefficient), None

    total, _ = jax.lax.scan(lower_power, total, jnp.asarray(_SERIES[-3::-1], depth.dtype))
    # X = B t(A B) and Y = A t(B A), symmetric but for rounding.
    return reflection_and_loss((first @ total).scaled(h).symmetric())


def pair(one: Bordered, other: Bordered) -> Bordered:
    """Two operators along a new leading axis."""
    return jax.tree.map(lambda x, y: jnp.stack(jnp.broadcast_arrays(x, y)), one, other)


def reflection_and_loss(impedance: Bordered) -> LayerOperators:
    """R and U = 1 - T of a layer from the `pair` of X and Y at its face, both symmetric."""
    # Half of 2 X (1 + X)^-1 and the like.
    halves = impedance @ impedance.plus_identity().inverse()
    from_even, from_odd = (jax.tree.map(lambda leaf, i=i: leaf[i], halves) for i in (0, 1))
    return (from_odd - from_even).symmetric(), (from_odd + from_even).symmetric()


def _double(r: Bordered, loss: Bordered) -> LayerOperators:
    """Two equal layers: R + T (1 - R R)^-1 R T and 1 - T (1 - R R)^-1 T."""
    t = loss.one_minus()
    # (1 - R R)^-1: light between the two layers goes to and fro.
    between = (r @ r).one_minus().symmetric().inverse(often=True)
    # Upward light between them, sent back by the lower layer. It leaves above, or is turned down
    # once more and leaves below.
    again = (between @ r) @ t
    back = t @ again
    onward = t @ (r @ again)
    # 1 - T T = U (2 - U).
    once = loss @ loss.scaled(-1.0).plus_identity(2.0)
    return (r + back).symmetric(), (once - onward).symmetric()
