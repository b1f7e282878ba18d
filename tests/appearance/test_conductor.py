"""Metals of scenes: how they reflect away from the normal."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from glazejax.appearance.scene.materials import Conductor, FresnelModel
from glazejax.radiative.common.fresnel import (
    conductor_reflectance,
    cook_torrance_reflectance,
    hall_extinction,
    hall_reflectance,
)

from .scenes import GRID


@pytest.mark.slow
def test_metals_reflect_as_the_estimate_says(unchecked):
    n, k = np.linspace(0.2, 1.2, GRID.size), np.linspace(3.5, 2.4, GRID.size)
    cosine = jnp.array([1.0, 0.5, 0.1])
    c, normal = np.array(cosine)[:, None], conductor_reflectance(1.0, n, k)
    wanted: dict[FresnelModel, Any] = {
        "exact": conductor_reflectance(c, n, k),
        "hall": hall_reflectance(c, normal, hall_extinction(normal.mean())),
        "cook-torrance": cook_torrance_reflectance(c, normal),
    }
    for model, exact in wanted.items():
        metal = Conductor(n, k, fresnel=model)
        np.testing.assert_allclose(metal.mirror(cosine), exact, rtol=1e-12)
    with pytest.raises(ValueError, match="fresnel 'schlick' is unknown"):
        Conductor(n, k, fresnel="schlick")  # type: ignore[arg-type]
