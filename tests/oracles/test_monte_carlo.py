"""Layers that scatter forward or back under a refracting surface, which no other program computes:
paths by chance.
"""

from typing import Any

import numpy as np
import pytest

from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.manyflux.free import free_hemispherical
from glazejax.radiative.manyflux.reflectance import (
    manyflux_hemispherical_reflectance,
    manyflux_reflectance_factor,
)

from .monte_carlo import Indexed, Paint, simulate, simulate_fluxes

pytestmark = [pytest.mark.optimised, pytest.mark.slow]

FORWARD = Paint(np.array([0.97, 0.9]), np.array([0.5, 2.0]), np.array([0.7, 0.3]), 0.6, 1.5)
PAINTS = {
    "forward": FORWARD,
    "forward, no surface": FORWARD._replace(refractive_index=1.0),
    "back over forward, thick": Paint(
        np.array([0.99, 0.995]), np.array([0.3, 8.0]), np.array([-0.5, 0.7]), 0.2, 1.33
    ),
}
AZIMUTH = np.array([0.0, 60.0, 180.0])


@pytest.mark.parametrize(
    ("name", "paths"),
    [
        ("forward", 3_000_000),
        ("forward, no surface", 2_000_000),
        ("back over forward, thick", 1_000_000),
    ],
)
def test_within_three_standard_errors(name, paths):
    paint = PAINTS[name]
    cos_incidence, cos_viewing = np.cos(np.deg2rad(45.0)), np.cos(np.deg2rad(30.0))
    found = simulate(paint, cos_incidence, cos_viewing, AZIMUTH, paths)
    stack = paint.albedo, paint.optical_thickness, paint.ground
    given: dict[str, Any] = {
        "phase": henyey_greenstein(paint.g, 60),
        "refractive_index": paint.refractive_index,
        "cos_incidence": cos_incidence,
        "tolerance": 1e-4,
    }
    factor = manyflux_reflectance_factor(*stack, cos_viewing=cos_viewing, azimuth=AZIMUTH, **given)
    flux = manyflux_hemispherical_reflectance(*stack, **given)
    assert np.all(np.abs(factor - found.reflectance_factor) < 3 * found.factor_error + 1e-4)
    assert abs(flux - found.flux) < 3 * found.flux_error + 1e-4
    assert max(*found.factor_error, found.flux_error) < 1e-3


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
