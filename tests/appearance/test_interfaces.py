"""Fresnel reflectance of metals, and its two approximations."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax import colour
from glazejax.appearance.metals import SOURCES, metal
from glazejax.radiative.common.fresnel import (
    conductor_reflectance,
    cook_torrance_reflectance,
    dielectric_reflectance,
    hall_extinction,
    hall_reflectance,
)

from ..checks import check_slopes
from ..refusals import refusal

GRID = np.arange(400.0, 701.0, 5.0)
ANGLES = np.deg2rad(np.arange(0.0, 87.6, 2.5))


def test_conductors_against_complex_amplitudes():
    rng = np.random.default_rng(0)
    n, k = rng.uniform(0.02, 4, 3000), 10 ** rng.uniform(-8, 2, 3000)
    c = rng.uniform(0, 1, 3000)
    index = n + 1j * k
    inside = np.sqrt(1.0 - (1.0 - c**2) / index**2)
    s = (c - index * inside) / (c + index * inside)
    p = (index * c - inside) / (index * c + inside)
    for given in ((c, n, k), map(jnp.asarray, (c, n, k))):
        found = conductor_reflectance(*given)
        assert_allclose(found, 0.5 * (abs(s) ** 2 + abs(p) ** 2), rtol=0, atol=1e-13)


def test_limits_of_conductors():
    cosine = np.linspace(0.0, 1.0, 11)
    assert_allclose(
        conductor_reflectance(cosine, 1.5, 0.0), dielectric_reflectance(cosine, 1.5), atol=1e-15
    )
    assert conductor_reflectance(0.0, 0.2, 3.0) == pytest.approx(1.0, abs=1e-15)
    # An index below one without absorption reflects everything beyond the critical angle.
    assert conductor_reflectance(np.cos(np.deg2rad(60.0)), 0.5, 0.0) == pytest.approx(
        1.0, abs=1e-15
    )
    normal = ((0.3 - 1) ** 2 + 3.0**2) / ((0.3 + 1) ** 2 + 3.0**2)
    assert conductor_reflectance(1.0, 0.3, 3.0) == pytest.approx(normal, abs=1e-15)


@pytest.mark.parametrize(
    ("c", "n", "k"), [(0.3, 0.3, 3.2), (0.9, 1.2, 0.0), (1.0, 0.2, 3.0), (0.0, 1.0, 2.0)]
)
def test_slopes_of_conductors(c, n, k):
    """Finite at the ends of the cosine, too, and against differences inside."""
    slopes = jax.jit(jax.grad(conductor_reflectance, (0, 1, 2)))(c, n, k)
    assert np.all(np.isfinite(slopes))

    def one(n, c=c, k=k):
        return conductor_reflectance(c, n, k)

    # By what may be moved to both sides.
    at = (n, c, k)[: 1 + (0 < c < 1) * (1 + (k > 0))]
    check_slopes(jax.jit(one), at, eps=1e-6, rtol=1e-5, atol=1e-8)


def test_cook_torrance_as_printed():
    """(16)-(18) of paper B, term by term."""
    f0, c = np.array([0.04, 0.3, 0.6, 0.95]), np.cos(ANGLES)[:, None]
    n = (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    g = np.sqrt(n**2 + c**2 - 1)
    bracket = 1 + ((c * (g + c) - 1) / (c * (g - c) + 1)) ** 2
    printed = 0.5 * ((g - c) / (g + c)) ** 2 * bracket
    assert_allclose(cook_torrance_reflectance(c, f0), printed, atol=1e-14)
    assert_allclose(cook_torrance_reflectance(1.0, f0), f0, atol=1e-15)


def test_hall_as_printed():
    """(19)-(23) of paper B, term by term."""
    f0, c = np.array([0.5, 0.6, 0.95]), np.cos(ANGLES)[:, None]
    mean = f0.mean()
    k = 2 * np.sqrt(mean) / np.sqrt(1 - mean)

    def average(c):
        s = ((1 + k**2) - 2 * c + c**2) / ((1 + k**2) + 2 * c + c**2)
        p = ((1 + k**2) * c**2 - 2 * c + 1) / ((1 + k**2) * c**2 + 2 * c + 1)
        return 0.5 * (s + p)

    printed = f0 + (1 - f0) * (average(c) - average(1.0)) / (1 - average(1.0))
    assert average(1.0) == pytest.approx(mean)
    assert hall_extinction(mean) == pytest.approx(k, rel=1e-15)
    assert_allclose(hall_reflectance(c, f0, k), printed, atol=1e-14)
    assert_allclose(hall_reflectance(1.0, f0, k, 0.5), f0, atol=1e-15)
    assert_allclose(hall_reflectance(0.0, f0, k, 0.5), 1.0, atol=1e-15)
    # Ditchburn's (20)-(22) neglect sin^2 beside n^2 + k^2, so a strong metal is met by its own mean
    # n and k.
    exact = conductor_reflectance(c, 3.0, 60.0)
    assert_allclose(hall_reflectance(c, exact[:1], 60.0, 3.0), exact, atol=1e-4)


def chromaticity(spectra, illuminant="D65"):
    values = np.asarray(spectra) @ colour.colour_weights(GRID, illuminant)
    return values[..., :2] / values.sum(axis=-1, keepdims=True)


@pytest.mark.parametrize("name", ["copper", "copper-hagemann"])
@pytest.mark.parametrize("illuminant", ["D65", "D55"])
def test_hall_follows_the_locus_of_copper_and_cook_torrance_leaves_it(name, illuminant):
    """Paper B, section 6.2 and figure 12, incidence 0 to 87.5 degrees under sunlight."""
    copper, c = metal(name, GRID), np.cos(ANGLES)[:, None]

    def fresnel(cosine):
        return conductor_reflectance(cosine, copper.refractive_index, copper.extinction)

    f0 = fresnel(1.0)
    cook = cook_torrance_reflectance(c, f0)
    hall = hall_reflectance(c, f0, hall_extinction(f0.mean()))
    known = hall_reflectance(c, f0, copper.extinction.mean(), copper.refractive_index.mean())
    locus = chromaticity(fresnel(np.cos(np.linspace(0, np.pi / 2, 2001))[:, None]), illuminant)
    exact = chromaticity(fresnel(c), illuminant)

    def off_locus(reflectance):
        gap = chromaticity(reflectance, illuminant)[:, None] - locus
        return np.linalg.norm(gap, axis=-1).min(axis=1).max()

    def off_same_angle(reflectance):
        return np.linalg.norm(chromaticity(reflectance, illuminant) - exact, axis=1).max()

    assert off_locus(hall) < off_locus(cook) / 5
    # At the same angle Hall runs ahead along the locus; with n and k known it does so less.
    assert off_same_angle(hall) < off_same_angle(cook) / 2.5
    assert off_same_angle(known) < off_same_angle(cook) / 4


@pytest.mark.parametrize("name", SOURCES)
def test_metals(name):
    bare = metal(name)
    assert np.all(np.diff(bare.wavelengths) > 0)
    assert bare.wavelengths[0] < 380 < 780 < bare.wavelengths[-1]
    same = bare.resample(bare.wavelengths)
    assert_allclose(same.refractive_index, bare.refractive_index, atol=1e-12)
    fine = bare.resample(GRID)
    reflectance = conductor_reflectance(1.0, fine.refractive_index, fine.extinction)
    assert_allclose(fine.reflectance([1.0, 0.5])[0], reflectance, rtol=1e-14)
    assert np.all((reflectance > 0.3) & (reflectance < 1))


def test_colours_of_metals():
    """Copper and gold reflect red light better than blue; silver and aluminium nearly all alike."""
    for name, least, most in (
        ("copper", 1.5, 3),
        ("gold", 1.8, 4),
        ("silver", 0.98, 1.05),
        ("aluminium", 0.9, 1.02),
    ):
        blue, red = np.asarray(metal(name, [450.0, 650.0]).reflectance(1.0))
        assert least < red / blue < most, name


def test_what_metals_refuse():
    with refusal("unknown metal 'tin': there are copper"):
        metal("tin")
    with refusal("copper is known from"):
        metal("copper", [200.0, 700.0])
    assert metal(" Aluminum ").name == "aluminium"
