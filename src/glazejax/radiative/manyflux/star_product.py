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
    """Operators of any joined layers on light from above and from below."""

    above: Bordered
    """Reflection of light from above."""
    below: Bordered
    """Reflection of light from below."""
    down: Bordered
    """Transmission downwards."""
    up: Bordered
    """Transmission upwards."""


def join(upper: Slab, lower: Slab, between: Bordered | None = None) -> Slab:
    """Two slabs as one: the star product.

    Args:
        upper, lower: slabs.
        between: how light between them multiplies, (1 - R R')^-1 by default.

    Source: paper C, equation (14) with its misprints put right.
    """
    if between is None:
        between = (upper.below @ lower.above).one_minus().inverse()
    # Of light from above: what goes down between the slabs, and what the lower one sends up.
    downward = between @ upper.down
    upward = lower.above @ downward
    # Of light from below: what goes down between them once the upper one has reflected it.
    back = between @ upper.below @ lower.up
    return Slab(
        upper.above + upper.up @ upward,
        lower.below + lower.down @ back,
        lower.down @ downward,
        upper.up @ (lower.up + lower.above @ back),
    )


def join_all(slabs: Slab) -> Slab:
    """Slabs along the leading axis, top first, joined pairwise in parallel."""

    return jax.tree.map(lambda leaf: leaf[-1], jax.lax.associative_scan(join, slabs))


def slab_of_layer(reflection: Bordered, loss: Bordered) -> Slab:
    """A homogeneous layer, R and U = 1 - T, as a slab."""
    t = loss.one_minus()
    return Slab(reflection, reflection, t, t)


def reflection_over(slab: Slab, below: Bordered) -> Bordered:
    """Reflection of a slab on what reflects below it."""
    between = (slab.below @ below).one_minus().inverse()
    return slab.above + slab.up @ (below @ (between @ slab.down))


def stack_reflection(reflections: Bordered, losses: Bordered, ground: Bordered) -> Bordered:
    """Reflection of layers along the leading axis, top first, on a ground."""

    def add(below: Bordered, layer: tuple[Bordered, Bordered]):
        # Reciprocity makes it symmetric, and many layers' rounding would not keep it so.
        return reflection_over(slab_of_layer(*layer), below).symmetric(), None

    return jax.lax.scan(add, ground, (reflections, losses), reverse=True)[0]


def reflector(
    reflectance: Float[Array, ""], roots: Diagonal, factor: Float[Array, "modes #rows #columns"]
) -> Bordered:
    """Ground, 2 rho g g^T with g = sqrt(mu w), times its factor between directions in each azimuth
    mode.

    Args:
        reflectance: rho, ().
        roots: g of nodes and added directions.
        factor: relative to a white Lambertian ground's in mode 0.
    """
    rows = jnp.concatenate([roots.nodes, roots.viewing])
    columns = jnp.concatenate([roots.nodes, roots.incidence])
    modes = factor.shape[0]
    return Bordered(
        factor * (2.0 * reflectance * rows[:, None] * columns),
        jnp.zeros((modes, roots.viewing.size), factor.dtype),
        jnp.zeros((modes, roots.incidence.size), factor.dtype),
    )


def lambert(reflectance: Float[Array, ""], roots: Diagonal, modes: int) -> Bordered:
    """Lambertian ground: its light goes evenly to all azimuths, so that mode 0 has all of it."""
    first = jnp.zeros((modes, 1, 1), roots.nodes.dtype).at[0].set(1.0)
    return reflector(reflectance, roots, first)


def under_surface(reflection: Bordered, surface: Diagonal) -> Bordered:
    """Light that comes out through a smooth surface: t (1 - R r)^-1 R t, t = 1 - r; its own
    reflection is not included.

    Args:
        reflection: R of all that lies below, inside the medium.
        surface: Fresnel reflectance r of the surface in each direction inside.
    """
    passing = jax.tree.map(lambda r: 1.0 - r, surface)
    between = reflection.multiply(surface).one_minus().inverse()
    return (between @ reflection).symmetric().multiply(passing).multiplied_by(passing)
