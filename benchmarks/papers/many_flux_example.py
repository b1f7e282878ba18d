"""Paper C's joined example, figures 8 to 10: paint of index 1.3 on a white ground, and the joining
as a series.
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from benchmarks.papers.many_flux_paths import COSINES, DIRECTIONS, SECTORS

if TYPE_CHECKING:
    from glazejax.radiative.manyflux.star_product import Slab

INDEX, ABSORPTION, SCATTERING, GROUND, ANGLE = 1.3, 0.1, 0.4, 0.8, 45.0
ALBEDO = SCATTERING / (ABSORPTION + SCATTERING)
THICKNESS = 0.5
"""Optical: half of 1/sigma_t."""
PRINTED = (0.16, 0.018)
"""Per cent: root mean square errors of orders 0 and 1."""
_STREAMS = 24


class Order(NamedTuple):
    """How far one order of the series is from the whole."""

    error: float  # rms over all directions, over the rms of the exact intensities
    diffuse_error: float  # the same of scattered light alone
    light_error: float  # rms over all directions, over the intensity of the light
    bound: float  # of the share of the flux that is left out, for the light that comes in


class Example(NamedTuple):
    """What the surface and the paint do by themselves, and the series."""

    orders: list[Order]
    fresnel_outside: float
    fresnel_inside: float
    kubelka_munk: float


def compute() -> Example:
    """All of it."""
    from glazejax.radiative.common.fresnel import dielectric_reflectance
    from glazejax.radiative.twoflux import two_flux_layer

    lit = float(np.cos(np.deg2rad(ANGLE)))
    outside = float(np.sqrt(1.0 - INDEX**2 * (1.0 - lit**2)))
    depth = THICKNESS / (ABSORPTION + SCATTERING)
    return Example(
        orders=series((0, 1, 2, 3)),
        fresnel_outside=float(dielectric_reflectance(lit, INDEX)),
        fresnel_inside=float(dielectric_reflectance(outside, INDEX)),
        kubelka_munk=float(two_flux_layer(ABSORPTION * depth, SCATTERING * depth)[0]),
    )


def series(orders: tuple[int, ...]) -> list[Order]:
    """Surface joined to the layer, over more of the medium: exactly, then by the series.

    Intensities are over n^2, for light of intensity one in one of 303 directions: what is scattered
    is spread over all of them, what goes straight or is mirrored stays in one.
    """
    from glazejax.radiative.common.fresnel import dielectric_reflectance
    from glazejax.radiative.manyflux.star_product import join

    lit = float(np.cos(np.deg2rad(ANGLE)))
    solid = 2.0 * np.pi / DIRECTIONS

    mirrored = float(dielectric_reflectance(lit, INDEX))

    def read(order: int | None) -> tuple[np.ndarray, float]:
        """All intensities, the bound."""
        factors, straight, bound = [], [], 0.0
        for downward in (False, True):
            upper, lower, roots = halves(downward=downward)
            if order is None:
                slab = join(upper, lower)
            else:
                slab, left = join_in_series(upper, lower, order, roots)
                bound = float(left[np.argmin(np.abs(_kept() - np.sin(np.deg2rad(ANGLE))))])
            operator = slab.down if downward else slab.above
            factors.append(0.5 * np.asarray(operator.corner)[0, :, 0])
            straight.append(float(operator.incidence[0, 0]))
        everywhere = [np.repeat(f * lit * solid / np.pi, SECTORS) for f in factors]
        return np.concatenate([*everywhere, [mirrored + straight[0], straight[1]]]), bound

    exact, _ = read(None)
    found = []
    for order in orders:
        intensities, bound = read(order)
        change = np.linalg.norm(intensities - exact)
        diffuse = np.linalg.norm((intensities - exact)[:-2]) / np.linalg.norm(exact[:-2])
        found.append(
            Order(
                error=float(change / np.linalg.norm(exact)),
                diffuse_error=float(diffuse),
                light_error=float(change / np.sqrt(exact.size)),
                bound=bound,
            )
        )
    return found


def join_in_series(
    upper: "Slab", lower: "Slab", order: int, roots: Float[Array, "n"]
) -> "tuple[Slab, Float[Array, 'n']]":
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
    import jax.numpy as jnp

    from glazejax.radiative.manyflux.star_product import join

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
    return join(upper, lower, between), jnp.where(largest < 1, bound, jnp.inf)


def _pieces():
    from glazejax.radiative.manyflux.media import fewest_shared_directions

    return fewest_shared_directions((INDEX,), (1.0, INDEX), (1.0,), 1e-6, _STREAMS)


def halves(*, downward: bool = False) -> tuple[Any, Any, Any]:
    """Operators of the surface and of the layer for light of the example, seen in the cells, and the
    roots of the flux of each direction; of mode 0.
    """
    import jax
    import jax.numpy as jnp

    from glazejax.radiative.manyflux.effort import FluxEffort
    from glazejax.radiative.manyflux.joined import joined_stack
    from glazejax.radiative.manyflux.media import Media, shared_directions
    from glazejax.radiative.manyflux.solve import Layers

    layers = Layers(jnp.array([ALBEDO]), jnp.array([THICKNESS]), jnp.ones((1, 1)), jnp.asarray(0.0))
    lit = jnp.array([np.cos(np.deg2rad(ANGLE))])
    effort = FluxEffort(_pieces(), 1, 1, None)
    media = Media((INDEX,), INDEX)
    made = joined_stack(layers, media, jnp.asarray(COSINES), lit, effort, downward=downward)
    upper, lower = (jax.tree.map(lambda leaf: leaf[0], x) for x in (made.faces, made.coats))
    return upper, lower, jnp.sqrt(jnp.asarray(shared_directions(_pieces()).flux))


def _kept() -> np.ndarray:
    """n sin(theta) of the nodes."""
    from glazejax.radiative.manyflux.media import shared_directions

    common = shared_directions(_pieces())
    return np.sqrt(common.end**2 - common.beyond)
