"""The position-free paths against closed forms, and both solvers of paint that no other program
computes against the paths.
"""

from typing import Any

import numpy as np
import pytest

from glazejax.radiative import rough
from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.manyflux.free import free_hemispherical
from glazejax.radiative.manyflux.reflectance import (
    manyflux_hemispherical_reflectance,
    manyflux_reflectance_factor,
)

from . import position_free, rough_surface
from .monte_carlo import Indexed, simulate_fluxes
from .position_free import Stack, Views

pytestmark = pytest.mark.slow

COS = np.cos(np.deg2rad([0.0, 20.0, 45.0, 70.0]))


def _stack(
    scattering, absorption, *, g: Any = 0.0, index: Any = 1.5, ground=0.6, roughness=0.0
) -> Stack:
    count = len(scattering)
    return Stack(
        np.array(scattering, float),
        np.array(absorption, float).reshape(count, -1),
        np.broadcast_to(np.array(g, float), count),
        np.broadcast_to(np.array(index, float), count),
        ground,
        roughness,
    )


def _close(tally: position_free.Tally, expected, sigmas: float = 4.0) -> bool:
    return bool(np.all(np.abs(tally.mean - expected) < sigmas * tally.error + 1e-4))


@pytest.mark.parametrize(
    ("alpha", "index"), [(0.0, 1.5), (0.1, 1.5), (0.5, 1.5), (0.4, 1.7), (0.3, 1.3)]
)
def test_a_ground_under_a_surface_has_a_closed_form(alpha, index):
    """Light inside is even, so by reciprocity the surface's albedo says all: also of a rough one,
    lobe included.
    """
    albedo = rough_surface.surface_albedo(COS, alpha, index)
    y, w = np.polynomial.legendre.leggauss(16)
    t = 0.5 * (1.0 + y)
    even = 2.0 * np.sum(w * t**3 * rough_surface.surface_albedo(t**2, alpha, index))
    ground = 0.7
    stack = _stack([0.0], [[0.0]], index=index, ground=ground, roughness=alpha)
    inside = 1.0 - (1.0 - even) / index**2
    rng = np.random.default_rng(1)
    views = Views(COS, np.array([0.0, 0.0, 90.0, 180.0]))
    factor = position_free.reflectance_factor(stack, float(COS[2]), views, 20_000, rng)
    expected = (1 - albedo[2]) * (1 - albedo) * ground / (1 - ground * inside) / index**2
    assert _close(factor, expected[:, None])
    flux = position_free.albedo(stack, float(COS[3]), 40_000, rng)
    assert _close(flux, (1 - albedo[3]) * ground * (1 - inside) / (1 - ground * inside))
    assert factor.error.max() < 6e-3
    assert flux.error.max() < 3e-3


@pytest.mark.parametrize(
    ("alpha", "index", "scattering", "absorption", "ground", "cosine", "paths"),
    [
        *(
            (alpha, 1.5, [0.3, 2.0], [[0.2, 0.02], [0.4, 0.03]], 0.5, float(COS[3]), paths)
            for alpha, paths in ((0.3, 40_000), (0.05, 1_000_000), (0.5, 1_000_000))
        ),
        (0.1, 1.5, [0.8], [[0.2]], 0.5, 0.8, 200_000),
        (1.0, 1.5, [3.5], [[1.5]], 0.0, 1.0, 200_000),
        (0.05, 1.7, [0.18], [[0.02]], 0.8, 0.15, 200_000),
    ],
)
def test_paint_under_a_rough_surface(alpha, index, scattering, absorption, ground, cosine, paths):
    """The solver's albedo and reflection factors within the errors of paths; each makes the surface
    in its own way.
    """
    stack = _stack(scattering, absorption, index=index, ground=ground, roughness=alpha)
    s, k = stack.scattering, stack.absorption.T
    rng, azimuth = np.random.default_rng(10), np.array([0.0, 0.0, 90.0, 180.0])
    flux = position_free.albedo(stack, cosine, paths, rng)
    factor = position_free.reflectance_factor(stack, cosine, Views(COS, azimuth), paths // 4, rng)
    surface: dict = {"roughness": alpha, "refractive_index": index}
    given = surface | {"cos_incidence": cosine, "tolerance": 1e-4}
    paint = s / (s + k), s + k, ground
    assert _close(flux, rough.rough_hemispherical_reflectance(*paint, **given))
    assert _close(factor, rough.rough_reflectance_factor(*paint, cos_viewing=COS[:, None], **given))
    # The surface itself, by quadrature over its facets.
    albedo = rough_surface.surface_albedo(COS, alpha, index)
    np.testing.assert_allclose(rough.surface_albedo(COS, **surface), albedo, atol=3e-5)
    lost = rough_surface.lost_light(alpha, index).total
    assert rough.loss_constant(**surface) == pytest.approx(lost, rel=2e-3)


_FORWARD = _stack([0.485, 1.8], [[0.015], [0.2]], g=[0.7, 0.3])
PAINTS = {
    "forward": _FORWARD,
    "forward, no surface": _FORWARD._replace(refractive_index=np.ones(2)),
    "back over forward, thick": _stack(
        [0.297, 7.96], [[0.003], [0.04]], g=[-0.5, 0.7], index=1.33, ground=0.2
    ),
}


@pytest.mark.optimised
@pytest.mark.parametrize("name", PAINTS)
def test_layers_that_scatter_forward_or_back(name):
    stack, rng, azimuth = PAINTS[name], np.random.default_rng(11), np.array([0.0, 60.0, 180.0])
    cosine = float(COS[2])
    factor = position_free.reflectance_factor(
        stack, cosine, Views(COS[[1, 1, 1]], azimuth), 700_000, rng
    )
    flux = position_free.albedo(stack, cosine, 700_000, rng)
    s, depth = stack.scattering, stack.scattering + stack.absorption[:, 0]
    given: dict = {
        "phase": henyey_greenstein(stack.g, 60),
        "refractive_index": float(stack.refractive_index[0]),
        "cos_incidence": cosine,
        "tolerance": 1e-4,
    }
    paint = s / depth, depth, stack.ground
    expected = manyflux_reflectance_factor(*paint, cos_viewing=COS[1], azimuth=azimuth, **given)
    assert _close(factor, expected[:, None], sigmas=3)
    assert _close(flux, manyflux_hemispherical_reflectance(*paint, **given), sigmas=3)
    assert max(factor.error.max(), flux.error.max()) < 1e-3


@pytest.mark.optimised
def test_layers_of_different_index():
    """Refraction and reflection between layers, in both senses, and a medium below: fluxes on both
    sides.
    """
    paint = Indexed(
        np.array([0.95, 0.99, 0.9]),
        np.array([0.4, 1.5, 0.3]),
        np.array([0.6, -0.3, 0.0]),
        np.array([1.4, 1.7, 1.3]),
        1.2,
    )
    cos_incidence = np.cos(np.deg2rad(50.0))
    found = simulate_fluxes(paint, cos_incidence, 1_500_000)
    for transmitted, (mean, error) in zip((False, True), found, strict=True):
        flux = free_hemispherical(
            paint.albedo,
            paint.optical_thickness,
            transmitted=transmitted,
            phase=henyey_greenstein(paint.g, 40),
            refractive_index=tuple(paint.refractive_index),
            index_below=paint.below,
            cos_incidence=cos_incidence,
            tolerance=1e-4,
        )
        assert abs(flux - mean) < 3 * error + 1e-4
        assert error < 1e-3
