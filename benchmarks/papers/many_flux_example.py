"""Paper C's joined example, figures 8 to 10: paint of index 1.3 on a white ground, and the joining
as a series.
"""

from typing import NamedTuple

import numpy as np

from benchmarks.papers.many_flux_paths import BANDS, DIRECTIONS, SECTORS

INDEX, ABSORPTION, SCATTERING, GROUND, ANGLE = 1.3, 0.1, 0.4, 0.8, 45.0
ALBEDO = SCATTERING / (ABSORPTION + SCATTERING)
THICKNESS = 0.5
"""Optical: half of 1/sigma_t."""
PRINTED = (0.16, 0.018)
"""Per cent: root mean square errors of orders 0 and 1."""
_STREAMS = 24


class Order(NamedTuple):
    """One order of the series."""

    up: np.ndarray  # reflectance factor over the view angles
    down: np.ndarray
    error: float  # rms over all directions, over the rms of the exact intensities
    diffuse_error: float  # the same of scattered light alone
    light_error: float  # rms over all directions, over the intensity of the light
    bound: float  # of the share of the flux that is left out, for the light that comes in


class Example(NamedTuple):
    """Lobes in the plane of incidence, and the series."""

    angles: np.ndarray  # degrees, negative towards the light
    layer_up: np.ndarray
    layer_down: np.ndarray
    joined: np.ndarray
    exact: Order
    orders: list[Order]
    fresnel_outside: float
    fresnel_inside: float
    kubelka_munk: float


def compute() -> Example:
    """All of it."""
    from glazejax.radiative.common.fresnel import cos_refracted, dielectric_reflectance
    from glazejax.radiative.manyflux.free import free_factor
    from glazejax.radiative.manyflux.reflectance import brdf_table
    from glazejax.radiative.twoflux import two_flux_layer

    angles = np.linspace(-85.0, 85.0, 69)
    cosines, azimuth = np.cos(np.deg2rad(angles)), np.where(angles < 0, 180.0, 0.0)
    lit = float(np.cos(np.deg2rad(ANGLE)))
    inside = float(cos_refracted(lit, INDEX))
    layer = [ALBEDO], [THICKNESS]
    lobes = [
        free_factor(
            *layer,
            transmitted=t,
            refractive_index=1.0,
            cos_incidence=inside,
            cos_viewing=cosines,
            azimuth=azimuth,
        )
        for t in (False, True)
    ]
    joined = np.pi * np.asarray(
        brdf_table(*layer, GROUND, refractive_index=INDEX, cos_incidence=[lit], cos_viewing=cosines)
    )
    depth = THICKNESS / (ABSORPTION + SCATTERING)
    exact, *orders = series(angles, (0, 1, 2, 3))
    outside = float(np.sqrt(1.0 - INDEX**2 * (1.0 - lit**2)))
    return Example(
        angles,
        np.asarray(lobes[0]),
        np.asarray(lobes[1]),
        joined[:, 0, 0],
        exact,
        orders,
        float(dielectric_reflectance(lit, INDEX)),
        float(dielectric_reflectance(outside, INDEX)),
        float(two_flux_layer(ABSORPTION * depth, SCATTERING * depth)[0]),
    )


def series(angles: np.ndarray, orders: tuple[int, ...]) -> list[Order]:
    """Surface joined to the layer, over more of the medium: exactly, then by the series.

    Intensities are over n^2, for light of intensity one in one of 303 directions: what is scattered
    is spread over all of them, what goes straight or is mirrored stays in one.
    """
    import jax
    import jax.numpy as jnp

    from glazejax.radiative.common.fresnel import dielectric_reflectance
    from glazejax.radiative.manyflux.effort import FluxEffort
    from glazejax.radiative.manyflux.joined import joined_stack
    from glazejax.radiative.manyflux.media import Media, fewest_shared_directions
    from glazejax.radiative.manyflux.solve import Layers
    from glazejax.radiative.manyflux.star_product import join, join_in_series

    cells = (np.arange(BANDS) + 0.5)[::-1] / BANDS
    seen = jnp.asarray(np.concatenate([cells, np.cos(np.deg2rad(angles))]))
    lit = float(np.cos(np.deg2rad(ANGLE)))
    pieces = fewest_shared_directions((INDEX,), (1.0, INDEX), (1.0,), 1e-6, _STREAMS)
    effort = FluxEffort(pieces, 1, 1, None)
    layers = Layers(jnp.array([ALBEDO]), jnp.array([THICKNESS]), jnp.ones((1, 1)), jnp.asarray(0.0))
    solid = 2.0 * np.pi / DIRECTIONS

    def parts(downward: bool):
        return joined_stack(
            layers, Media((INDEX,), INDEX), seen, jnp.array([lit]), effort, 1, downward=downward
        )

    mirrored = float(dielectric_reflectance(lit, INDEX))

    def read(order: int | None) -> tuple[list[np.ndarray], np.ndarray, float]:
        """Factors on both sides, all intensities, the bound."""
        factors, straight, bound = [], [], 0.0
        for downward in (False, True):
            made = parts(downward)
            upper, lower = (jax.tree.map(lambda leaf: leaf[0], x) for x in (made.faces, made.coats))
            if order is None:
                slab = join(upper, lower)
            else:
                roots = jnp.sqrt(made.flux)
                slab, left = join_in_series(upper, lower, order, roots)
                bound = float(left[np.argmin(np.abs(_kept(pieces) - np.sin(np.deg2rad(ANGLE))))])
            operator = slab.down if downward else slab.above
            factors.append(0.5 * np.asarray(operator.corner)[0, :, 0])
            straight.append(float(operator.incidence[0, 0]))
        scattered = [f[:BANDS] * lit * solid / np.pi for f in factors]
        everywhere = [np.repeat(s, SECTORS) for s in scattered]
        return factors, np.concatenate([*everywhere, [mirrored + straight[0], straight[1]]]), bound

    exact_factors, exact, _ = read(None)
    views = slice(BANDS, None)
    found = [Order(exact_factors[0][views], exact_factors[1][views], 0.0, 0.0, 0.0, 0.0)]
    for order in orders:
        factors, intensities, bound = read(order)
        change = np.linalg.norm(intensities - exact)
        found.append(
            Order(
                factors[0][views],
                factors[1][views],
                float(change / np.linalg.norm(exact)),
                float(np.linalg.norm((intensities - exact)[:-2]) / np.linalg.norm(exact[:-2])),
                float(change / np.sqrt(exact.size)),
                bound,
            )
        )
    return found


def _kept(pieces) -> np.ndarray:
    """n sin(theta) of the nodes."""
    from glazejax.radiative.manyflux.media import shared_directions

    common = shared_directions(pieces)
    return np.sqrt(common.end**2 - common.beyond)
