import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

import glazejax
from glazejax import (
    Bidirectional,
    Glaze,
    Hemispherical,
    Layer,
    Mixture,
    Pigment,
    appearance,
    reflectance,
)
from tests.reference import isotropic_stacks

from .checks import check_slopes
from .fresh import run_python
from .refusals import refusal
from .slow import slow
from .test_media import BLUE, GRID, RED


def fresnel(degrees, n):
    """Unpolarised reflectance by the sines and tangents of the textbook."""
    if degrees == 0:
        return ((n - 1) / (n + 1)) ** 2
    i = np.deg2rad(degrees)
    t = np.arcsin(np.sin(i) / n)
    return (np.sin(i - t) ** 2 / np.sin(i + t) ** 2 + np.tan(i - t) ** 2 / np.tan(i + t) ** 2) / 2


def inner_reflectance(n):
    """Reflectance of the surface from inside for diffuse light, by adaptive quadrature."""
    outside = quad(lambda i: np.sin(2 * i) * fresnel(np.rad2deg(i), n), 0, np.pi / 2, epsabs=1e-12)[
        0
    ]
    return 1 - (1 - outside) / n**2


@pytest.mark.parametrize("angle", [-1, 90, 91, np.nan, [10, 100]])
def test_wrong_angles(angle):
    with refusal(r"incidence must lie in \[0, 90\)"):
        Bidirectional(incidence=angle)
    with refusal(r"viewing must lie in \[0, 90\)"):
        Bidirectional(viewing=angle)
    with refusal("incidence"):
        Hemispherical(angle)


def test_angle_must_be_a_number():
    with refusal("number of degrees"):
        Hemispherical("8")  # pyright: ignore[reportArgumentType]


def test_traced_angles_are_not_checked():
    assert jax.jit(lambda a: Hemispherical(a).cos_incidence)(120.0) == pytest.approx(-0.5)


@pytest.mark.parametrize("n", [1.5, slow(2.0)])
@pytest.mark.parametrize("ground", [0.0, 0.025, 1.0])
def test_bare_ground_in_closed_form(ground, n):
    inside = inner_reflectance(n)
    escape = ground * (1 - inside) / (1 - ground * inside)
    surface = fresnel(8, n)
    glaze = Glaze([], np.full(3, ground), n)
    found = reflectance(glaze, Hemispherical())
    assert found.shape == (3,)
    assert_allclose(found, surface + (1 - surface) * escape, atol=2e-6)
    through = (1 - fresnel(45, n)) * (1 - fresnel(10, n)) / n**2
    assert_allclose(
        reflectance(glaze, Bidirectional(45, 10)),
        through * ground / (1 - ground * inside),
        atol=2e-6,
    )


def test_pure_absorber_without_surface_is_beer_lambert():
    glass = Pigment("glass", GRID, [1e3, 1e4, 1e5], [0.0, 0.0, 0.0])
    glaze = Glaze([Layer(glass, 1e-5), Layer(glass, 2e-5)], [0.9, 0.5, 1.0], 1.0)
    path = 3e-5 * (1 / np.cos(np.deg2rad(30)) + 1 / np.cos(np.deg2rad(60)))
    expected = np.array([0.9, 0.5, 1.0]) * np.exp(-np.array([1e3, 1e4, 1e5]) * path)
    assert_allclose(reflectance(glaze, Bidirectional(30, 60)), expected, atol=1e-6)


@pytest.mark.parametrize("count", [slow(1), 2])
def test_stacks_of_the_reference(count):
    cases = [
        case
        for case in isotropic_stacks()
        if case["refractive_index"] == 1.5 and len(case["albedo"]) == count
    ]
    assert len(cases) > 10

    def column(key):
        return np.array([case[key] for case in cases])

    thickness = 1e-5
    layers = []
    for q, depth in zip(column("albedo").T, column("optical_thickness").T, strict=True):
        extinction = depth / thickness
        medium = Pigment("p", [550.0], ((1 - q) * extinction)[:, None], (q * extinction)[:, None])
        layers.append(Layer(medium, thickness))
    glaze = Glaze(layers, column("substrate_reflectance")[:, None])
    i, v = (np.rad2deg(np.arccos(column(key))) for key in ("cos_incidence", "cos_viewing"))
    for geometry, key in (
        (Bidirectional(i, v), "reflectance_factor"),
        (Hemispherical(i, specular=False), "hemispherical_reflectance"),
    ):
        assert_allclose(reflectance(glaze, geometry)[:, 0], column(key), atol=2e-6, rtol=0)


@pytest.mark.parametrize("angle", [60.0, slow(0.0)])
def test_specular_part_is_fresnel(angle):
    glaze = Glaze([Layer(RED, 2e-5)], 0.8, [1.4, 1.5, 1.6])
    expected = [fresnel(angle, n) for n in (1.4, 1.5, 1.6)]
    added = reflectance(glaze, Hemispherical(angle)) - reflectance(
        glaze, Hemispherical(angle, specular=False)
    )
    assert_allclose(added, expected, atol=1e-12)
    with_mirror = reflectance(glaze, Bidirectional(angle, angle, specular=True))
    assert_allclose(
        with_mirror - reflectance(glaze, Bidirectional(angle, angle)), expected, atol=1e-12
    )


def test_every_azimuth_has_its_entry():
    """Isotropic paint looks the same from all sides, in as many spectra as a phase function has."""
    glaze = Glaze([Layer(RED, 2e-5)], 0.8)
    turned = reflectance(glaze, Bidirectional(45.0, 10.0, azimuth=[0.0, 90.0]))
    assert turned.shape == (2, GRID.size)
    assert_allclose(turned, [reflectance(glaze, Bidirectional(45.0, 10.0))] * 2, rtol=1e-12)
    angles = np.array([[10.0], [20.0], [30.0]])
    fan = Bidirectional(45.0, angles, azimuth=[0.0, 90.0])
    assert reflectance(glaze, fan).shape == (3, 2, GRID.size)


@pytest.mark.parametrize(
    "geometry",
    [slow(Bidirectional(45, 0)), Hemispherical()],
    ids=repr,
)
def test_slopes_are_those_of_finite_differences(geometry):
    def mean(thickness, k, s, weight, ground):
        mixture = Mixture(
            [Pigment("a", GRID, 1e4 * k, 1e4 * s), BLUE], jnp.stack([weight, 1 - weight])
        )
        return reflectance(Glaze([Layer(mixture, 1e-5 * thickness)], ground), geometry).mean()

    point = 1.0, RED.absorption / 1e4, RED.scattering / 1e4, 0.4, 0.7
    check_slopes(jax.jit(mean), point, eps=1e-4, rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize("glaze", [Bidirectional(45, 0), [], "CobaltBlue"])
def test_what_is_no_glaze_is_refused(unchecked, glaze):
    with refusal(r"glaze must be a Glaze, not .*: write Glaze\(", TypeError):
        reflectance(glaze, Bidirectional(45, 0))
    with refusal("glaze must be a Glaze", TypeError):
        appearance.glaze_table(glaze, [400.0, 500.0])
    with refusal("glaze must be a Glaze", TypeError):
        appearance.exports.fit_openpbr(glaze)


@pytest.mark.parametrize("package", [glazejax, appearance], ids=lambda package: package.__name__)
def test_public_names(package):
    for name in package.__all__:
        assert getattr(package, name) is not None
    assert set(package.__all__) <= set(dir(package))
    with refusal("color", AttributeError):
        _ = package.color


def test_import_is_light():
    code = """
import sys, glazejax, glazejax.appearance, jax
assert callable(glazejax.reflectance) and glazejax.colour and glazejax.io
import glazejax.reflectance as again
assert not jax.config.jax_enable_x64
heavy = 'colour', 'matplotlib', 'emcee', 'optimistix', 'scipy.optimize', 'typer'
print([m for m in heavy if m in sys.modules]
      + [m for m in sys.modules if 'manyflux.' in m or 'appearance.' in m])
"""
    # The solver's class is there under its name; what it computes with is not.
    assert run_python(code).stdout.strip() == "['glazejax.radiative.manyflux.method']"
