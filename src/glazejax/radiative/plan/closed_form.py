"""Reflectance of layers that scatter so little that no system of equations is needed (numpy).

Light absorbed on straight ways (Beer and Lambert), scattered at most once in the layers, and thrown
back and forth between the Lambertian ground and the interface as often as it likes. How much that
leaves out is bounded by
`glazejax.radiative.plan.bounds.scattered_beyond_first`.
"""

import functools
from typing import NamedTuple

import numpy as np

from ..common.directions import NEAR_ONE, Resolution, half_range
from ..common.fresnel import cos_refracted, dielectric_reflectance
from ..common.quadrature import Directions, gauss, graded_gauss
from .bounds import End, PerLayer, PerStack

# Enough for 1e-11; the index is a number here, and each node costs one exponential a stack.
_INSIDE = Resolution(cone=24, total=40, crowded=False)
_INSIDE_NEAR_ONE = Resolution(cone=48, total=40, crowded=True)


class FirstOrder(NamedTuple):
    """Reflectance without multiple scattering in the layers."""

    reflectance: PerStack
    ground_radiosity: tuple[PerStack, PerStack]
    """Radiance that leaves the ground for unit irradiance by incidence and by viewing."""


def end(cosine_air: PerStack | None, refractive_index: PerStack) -> End:
    """The incident beam or the view, by its cosine in air; None for all viewing directions
    together.
    """
    if cosine_air is None:
        # Integrals over 2 mu dmu in air; the cosine inside is never the smaller one.
        ones = np.ones(np.shape(refractive_index))
        return End(ones, ones, ones / (2.0 * np.pi))
    cosine = cos_refracted(cosine_air, refractive_index)
    flux = 1.0 - dielectric_reflectance(cosine_air, refractive_index)
    return End(cosine, flux, flux / (4.0 * np.pi * cosine))


@functools.lru_cache(maxsize=32)
def _inside(index: float) -> Directions:
    resolution = _INSIDE_NEAR_ONE if index < NEAR_ONE else _INSIDE
    return half_range(index, resolution if index > 1 else resolution._replace(total=0))


@functools.lru_cache(maxsize=32)
def _outside(index: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cosines inside, transmittance, and weights 2 mu dmu, of directions of view in air."""
    rule = graded_gauss if index < NEAR_ONE else gauss
    mu, weights = rule(32)
    transmittance = 1.0 - dielectric_reflectance(mu, index)
    return cos_refracted(mu, index), transmittance, 2.0 * mu * weights


def internal_reflection(depth: PerStack, index: float) -> PerStack:
    """K = 2 int R mu exp(-2 h/mu) dmu: what the interface sends back to the ground.

    Args:
        depth: optical thickness h of all layers, (stacks,).
        index: refractive index, a number.

    Source: paper A, eq. (20).
    """
    mu, weights, reflectance = _inside(index)
    return np.exp(-2.0 * depth[:, None] / mu) @ (2.0 * reflectance * mu * weights)


def without_multiple_scattering(
    albedo: PerLayer,
    optical_thickness: PerLayer,
    ground: PerStack,
    index: float,
    cos_incidence: PerStack,
    cos_viewing: PerStack | None,
) -> FirstOrder:
    """Ground seen through absorbing layers, plus light scattered once on a straight way.

    Args:
        albedo, optical_thickness: layers top first, (stacks, layers).
        ground: reflectance of the Lambertian ground, (stacks,).
        index: refractive index, a number.
        cos_incidence, cos_viewing: in air, (stacks,); cos_viewing None for the hemispherical
            reflectance.

    Source: paper A, eqs (19), (20), (22) with f = 0; single scattering as in S. Chandrasekhar,
    Radiative Transfer.
    """
    depth = np.pad(np.cumsum(optical_thickness, axis=1), [(0, 0), (1, 0)])
    total = depth[:, -1]
    # The ground: lit by the beam and by itself through the surface, seen through all layers.
    lit = ground / (1.0 - ground * internal_reflection(total, index)) / np.pi
    indices = np.full(total.shape, index)
    beam = end(cos_incidence, indices)
    incoming = lit * beam.flux * np.exp(-total / beam.cosine)
    if cos_viewing is None:
        cosine, transmittance, weights = _outside(index)
    else:
        view = end(cos_viewing, indices)
        cosine = view.cosine[:, None]
        transmittance = view.flux[:, None]
        weights = np.ones(1)
    share = (transmittance * np.exp(-total[:, None] / cosine)) @ weights
    by_ground = np.pi / index**2 * incoming * share
    # Single scattering: T_I T_F/(4 n^2 mu_I mu_F) times the integral of q exp(-tau (1/mu_I +
    # 1/mu_F)).
    decay = 1.0 / beam.cosine[:, None] + 1.0 / cosine
    once = np.zeros(decay.shape)
    for layer in range(albedo.shape[1]):
        passed = np.exp(-decay * depth[:, layer, None]) * -np.expm1(
            -decay * optical_thickness[:, layer, None]
        )
        once += albedo[:, layer, None] * passed
    once *= (
        beam.flux[:, None]
        * transmittance
        / (4.0 * index**2 * beam.cosine[:, None] * cosine * decay)
    )
    return FirstOrder(by_ground + once @ weights, (incoming, lit * share))
