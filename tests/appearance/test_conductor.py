"""Metals of scenes: how they reflect away from the normal."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.appearance.scene.materials import Conductor
from glazejax.radiative.common.fresnel import (
    conductor_reflectance,
    cook_torrance_reflectance,
    hall_extinction,
    hall_reflectance,
)

from ..refusals import refusal
from .scenes import rising


@pytest.mark.slow
def test_metals_reflect_as_the_estimate_says(unchecked):
    n, k = rising(0.2, 1.2), rising(3.5, 2.4)
    cosine = jnp.array([1.0, 0.5, 0.1])
    c, normal = np.array(cosine)[:, None], conductor_reflectance(1.0, n, k)
    for model, expected in (
        ("exact", conductor_reflectance(c, n, k)),
        ("hall", hall_reflectance(c, normal, hall_extinction(normal.mean()))),
        ("cook-torrance", cook_torrance_reflectance(c, normal)),
    ):
        made = Conductor(n, k, fresnel=model)  # type: ignore[arg-type]
        assert_allclose(made.mirror(cosine), expected, rtol=1e-12)
    with refusal("fresnel 'schlick' is unknown"):
        Conductor(n, k, fresnel="schlick")  # type: ignore[arg-type]
