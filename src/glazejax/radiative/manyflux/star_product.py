"""Joining of layers, grounds and surfaces, all of them operators on sqrt(mu w) I (see `bordered`).

    surface   Fresnel reflectance, diagonal
    layer 1   R, T the same from both sides
    layer 2
    ground    R

Paper C, equations (11)-(14), as the star product. Across a surface radiance changes by n^2, the
flux in a direction does not.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .bordered import Bordered, Diagonal


class Slab(NamedTuple):
    """What any joined layers do to light from above and from below."""

    above: Bordered
    """Reflection of light from above."""
    below: Bordered
    """Reflection of light from below."""
    down: Bordered
    """Transmission downwards."""
    up: Bordered
    """Transmission upwards."""


def join(upper: Slab, lower: Slab) -> Slab:
    """Two slabs as one: the star product.

    Source: paper C, equation (14) with its misprints put right.
    """
    return _join(upper, lower, (upper.below @ lower.above).scaled(-1.0).plus_identity().inverse())


def join_in_series(
    upper: Slab, lower: Slab, order: int, roots: Float[Array, "*batch n"]
) -> tuple[Slab, Float[Array, "*batch n"]]:
    """Two slabs as one by a series: light that has come back between them more than ``order`` times
    is lost.

    Args:
        upper, lower: slabs with the azimuth modes as their leading axis.
        order: of the series, >= 0.
        roots: sqrt(mu w) of the nodes, (n,).

    Returns:
        The slab, and for light from above in each node a bound (n,) on the share of its flux that
        is left out: what comes back once more often than counted, over 1 - eta, eta being the
        largest share of any light that comes back.

    Raises:
        ValueError: a negative order.

    Source: paper C, equation (21).
    """
    if order < 0:
        raise ValueError(f"order is {order}; it must be at least 0")
    once = upper.below @ lower.above
    between = once.scaled(0.0).plus_identity()
    for _ in range(order):
        between = (once @ between).plus_identity()
    flux = jnp.where(roots > 0, roots, 1.0)
    back = jnp.abs(once.core[0])
    largest = jnp.max(jnp.where(roots > 0, roots @ back, 0.0) / flux)
    left = jnp.abs(upper.down.core[0])
    for _ in range(order + 1):
        left = back @ left
    bound = (roots @ left) / flux / jnp.maximum(1.0 - largest, 1e-300)
    return _join(upper, lower, between), jnp.where(largest < 1, bound, jnp.inf)


def _join(upper: Slab, lower: Slab, between: Bordered) -> Slab:
    """Two slabs with (1 - R R')^-1 given: how light between them multiplies."""
    downward = between @ upper.down
    upward = lower.above @ downward
    back = between @ upper.below @ lower.up
    return Slab(
        upper.above + upper.up @ upward,
        lower.below + lower.down @ back,
        lower.down @ downward,
        upper.up @ (lower.up + lower.above @ back),
    )


def join_all(slabs: Slab) -> Slab:
    """Slabs along the leading axis, top first, joined pairwise in parallel."""

    def join_pair(upper: Slab, lower: Slab) -> Slab:
        return join(upper, lower)

    return jax.tree.map(lambda leaf: leaf[-1], jax.lax.associative_scan(join_pair, slabs))


def slab_of_layer(reflection: Bordered, loss: Bordered) -> Slab:
    """A homogeneous layer, R and U = 1 - T, as a slab."""
    t = loss.scaled(-1.0).plus_identity()
    return Slab(reflection, reflection, t, t)


def lay_over(reflection: Bordered, loss: Bordered, below: Bordered) -> Bordered:
    """Reflection of a layer, R and U = 1 - T, on what reflects below it: R + T B (1 - R B)^-1 T."""
    t = loss.scaled(-1.0).plus_identity()
    between = (reflection @ below).scaled(-1.0).plus_identity().inverse()
    return (reflection + t @ (below @ (between @ t))).symmetric()


def stack_reflection(reflections: Bordered, losses: Bordered, ground: Bordered) -> Bordered:
    """Reflection of layers along the leading axis, top first, on a ground."""

    def add(below: Bordered, layer: tuple[Bordered, Bordered]):
        return lay_over(*layer, below), None

    return jax.lax.scan(add, ground, (reflections, losses), reverse=True)[0]


def lambert(
    reflectance: Float[Array, ""], roots: Diagonal, modes: int, dtype: jnp.dtype
) -> Bordered:
    """Lambertian ground, 2 rho g g^T with g = sqrt(mu w) in mode 0, black in the others.

    Args:
        reflectance: rho, ().
        roots: g of nodes and added directions.
        modes: number of azimuth modes; the result has them as its leading axis.
    """
    rows = jnp.concatenate([roots.nodes, roots.viewing])
    columns = jnp.concatenate([roots.nodes, roots.incidence])
    first = jnp.zeros(modes, dtype).at[0].set(1.0)
    body = first[:, None, None] * (2.0 * reflectance * rows[:, None] * columns)
    return Bordered(
        body,
        jnp.zeros((modes, roots.viewing.size), dtype),
        jnp.zeros((modes, roots.incidence.size), dtype),
    )


def under_surface(reflection: Bordered, surface: Diagonal) -> Bordered:
    """What comes out through a smooth surface: t (1 - R r)^-1 R t, t = 1 - r; its own reflection is
    not included.

    Args:
        reflection: R of all that lies below, inside the medium.
        surface: Fresnel reflectance r of the surface in each direction inside.
    """
    passing = jax.tree.map(lambda r: 1.0 - r, surface)
    between = reflection.multiply(surface).scaled(-1.0).plus_identity().inverse()
    return (between @ reflection).symmetric().multiply(passing).multiplied_by(passing)
