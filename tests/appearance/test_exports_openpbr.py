"""OpenPBR in numbers, and its fit to a glaze: energy, reciprocity, closed forms, and parameters
found again.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import glazejax as gj
from glazejax.appearance.exports import (
    OpenPBR,
    angular_colour,
    directional_albedo,
    fit_openpbr,
    material_errors,
    reflectance_factor,
    surface_albedo,
)
from glazejax.appearance.exports.openpbr import diffuse_factor
from glazejax.appearance.exports.rgb import delta_e, lab_of_rgb, outside, rgb_of_xyz
from glazejax.appearance.exports.spaces import LAYERINGS
from glazejax.radiative.rough.lobes import lobe_albedo, lobe_factor

from ..refusals import refusal
from ..slow import slow
from .scenes import GRID, blue_glaze, half_range

COSINES = np.array([0.05, 0.3, 0.6, 0.95, 1.0])
WHITE = (1.0, 1.0, 1.0)
body_factor = partial(reflectance_factor, gloss=False)


@pytest.fixture(scope="module")
def truth():
    return angular_colour(blue_glaze(), space="acescg")


def hemisphere(function, cos_out: float) -> np.ndarray:
    """Albedo of a reflectance factor towards an angle, by a rule of its own."""
    light, weights = half_range(160)
    turns = np.arange(0.5, 180.0)
    values = function(*np.broadcast_arrays(light[:, None], np.array(cos_out), turns))
    return np.tensordot(weights * light, values.mean(axis=1), 1)


@pytest.mark.parametrize("roughness", [0.0, 0.3, slow(1.0)])
def test_a_white_rough_body_keeps_all_light(roughness):
    for cos_out in (0.2, 0.9):
        found = hemisphere(lambda *at: diffuse_factor(np.ones(3), roughness, *at), cos_out)
        assert_allclose(found, 1.0, atol=1e-4)


@pytest.mark.parametrize("roughness", [slow(0.3), 1.0])
def test_light_that_facets_send_to_facets_is_coloured_by_each(roughness):
    """Of light from all sides a share m leaves after each bounce: c m (1 + c (1 - m) + ...)."""
    colour = np.array([0.2, 0.5, 0.9])
    cosines, weights = half_range(8)

    def albedo(colour, *, bounces: bool) -> np.ndarray:
        # What is given back of a nearly black body is nothing.
        scale = 1.0 if bounces else 1e-9
        towards = [
            hemisphere(lambda *at: diffuse_factor(scale * colour, roughness, *at), cosine) / scale
            for cosine in cosines
        ]
        return (weights * cosines) @ np.array(towards)

    leaving = albedo(np.ones(3), bounces=False)[0]
    assert 0.5 < leaving < 0.99
    assert_allclose(
        albedo(colour, bounces=True), colour * leaving / (1.0 - colour * (1.0 - leaving)), atol=1e-3
    )


@pytest.mark.parametrize("alpha", [0.15, 0.5, 1.0])
@pytest.mark.parametrize("index", [1.3, 1.8])
def test_the_albedo_of_a_rough_surface_is_that_of_its_lobe(alpha, index):
    for cos_out in (0.25, 0.9):
        brute = hemisphere(lambda i, o, turn: lobe_factor(i, o, turn, alpha, index), cos_out)
        assert_allclose(lobe_albedo(np.array([cos_out]), alpha, index)[0], brute, rtol=2e-3)


def test_a_surface_that_gets_smooth_reflects_as_fresnel_says():
    # n = 1.5 straight on: ((n - 1)/(n + 1))^2.
    smooth, rough = (lobe_albedo(COSINES[1:], alpha, 1.5) for alpha in (0.0, 1e-3))
    assert_allclose(smooth[-1], 0.04, rtol=1e-12)
    assert_allclose(rough, smooth, rtol=2e-4)


@pytest.mark.parametrize("layering", LAYERINGS)
def test_a_white_material_reflects_everything(layering):
    plain = OpenPBR(base_color=WHITE, specular_roughness=0.0)
    mean = directional_albedo(plain, COSINES, layering=layering)
    if layering == "reciprocal":
        # What goes in grazing is less, what goes in steep is more: only the whole is kept.
        mu, weights = half_range(16)
        mean = np.array([weights * mu @ directional_albedo(plain, mu, layering=layering)])
    assert_allclose(mean, 1.0, atol=2e-4)


# MaterialX darkens by the colour alone.
@pytest.mark.parametrize("layering", [name for name in LAYERINGS if name != "materialx"])
def test_the_weight_of_the_base_is_a_factor_of_its_colour(layering):
    """Below a coat that darkens it, too."""
    half = OpenPBR(base_color=(0.8, 0.4, 0.2), base_weight=0.5, coat_weight=0.7)
    whole = OpenPBR(base_color=(0.4, 0.2, 0.1), coat_weight=0.7)
    seen = [
        reflectance_factor(material, COSINES, np.full(5, 0.7), np.full(5, 120.0), layering=layering)
        for material in (half, whole)
    ]
    assert_allclose(*seen, rtol=1e-12)


@pytest.mark.parametrize("layering", LAYERINGS)
def test_a_coat_adds_its_mirror_and_takes_light_away(layering):
    coated = OpenPBR(base_color=(0.5, 0.5, 0.5), coat_weight=1.0, coat_ior=1.5)
    body = partial(body_factor, layering=layering)
    covered = body(coated, 1.0, 1.0)
    assert np.all(covered < body(replace(coated, coat_weight=0.0), 1.0, 1.0))
    assert_allclose(surface_albedo(coated, 1.0, layering=layering), 0.04, rtol=1e-6)
    tinted = replace(coated, coat_color=(0.25, 1.0, 1.0))
    assert_allclose(body(tinted, 1.0, 1.0) / covered, [0.25, 1.0, 1.0])
    slanted = body(tinted, 0.5, 0.5) / body(coated, 0.5, 0.5)
    inside = np.sqrt(1 - 0.75 / 1.5**2)
    expected = 0.25 if layering == "materialx" else 0.25 ** (1 / inside)
    assert_allclose(slanted[0], expected, rtol=1e-9)


def test_layers_that_are_reciprocal_are():
    material = OpenPBR(
        base_color=(0.2, 0.5, 0.9),
        base_diffuse_roughness=0.4,
        specular_roughness=1.0,
        coat_weight=1.0,
        coat_color=(0.9, 0.5, 0.2),
        coat_ior=1.5,
        coat_darkening=0.0,
    )
    pairs = (0.3, 0.9), (0.9, 0.3)
    there, back = (body_factor(material, *pair, 40.0, layering="reciprocal") for pair in pairs)
    assert_allclose(there, back, rtol=1e-12)
    one, other = (body_factor(material, *pair, layering="materialx") for pair in pairs)
    assert np.all(np.abs(one - other) > 0.01 * one)


@pytest.mark.parametrize("index", [1.3, 1.7])
def test_reciprocal_layers_of_a_clear_coat_are_what_the_solver_computes(index):
    """A Lambertian ground under a smooth surface has a closed form, and the solver computes it
    without OpenPBR.
    """
    ground = np.array([0.1, 0.5, 0.95])
    material = OpenPBR(
        base_color=tuple(ground),
        specular_ior=index,
        specular_roughness=1.0,
        coat_weight=1.0,
        coat_ior=index,
    )
    for pair in ((1.0, 1.0), (0.2, 0.7)):
        solved = gj.stack_reflectance_factor(
            np.zeros((3, 1)),
            np.zeros((3, 1)),
            ground,
            refractive_index=index,
            cos_incidence=pair[0],
            cos_viewing=pair[1],
            tolerance=1e-8,
        )
        found = body_factor(material, *pair, layering="reciprocal")
        assert_allclose(found, solved, atol=1e-6)


def test_a_material_is_found_again(truth):
    """What OpenPBR can show is fitted to nothing left."""
    colour = (0.1, 0.6, 0.3)
    body = np.broadcast_to((1 - truth.surface)[:, None] * colour, truth.body.shape)
    fit = fit_openpbr(replace(truth, body=body))
    assert_allclose(fit.material.base_color, colour, atol=2e-5)
    assert fit.material.base_diffuse_roughness < 1e-3
    assert fit.material.coat_weight == 0
    assert max(fit.errors) < 1e-2


@pytest.mark.parametrize("layering", ["specification", "reciprocal"])
def test_a_coat_is_found_again(truth, layering):
    tint = (0.3, 0.6, 0.9)
    material = OpenPBR(
        base_color=(0.9, 0.5, 0.7),
        specular_roughness=0.0,
        coat_weight=1.0,
        coat_color=tint,
        coat_ior=1.5,
    )
    seen = body_factor(material, truth.cosines[:, None], truth.cosines, layering=layering)
    fit = fit_openpbr(replace(truth, body=seen), layering=layering)
    assert_allclose(fit.material.coat_color, tint, atol=5e-3)
    assert fit.errors.rms < 2e-4


def test_the_fit_is_nearer_than_no_fit_and_reciprocal_layers_are_nearer_still(truth):
    fit = fit_openpbr(truth, layering="materialx", coat=False)
    better = fit_openpbr(truth, layering="reciprocal", coat=True)
    assert fit.errors.albedo < 0.5 * fit.naive_errors.albedo
    assert fit.errors.sky < 0.5 * fit.naive_errors.sky
    assert fit.errors.rms < fit.naive_errors.rms
    assert better.errors.rms < 0.1 * fit.errors.rms
    # Without a coat it is the same material wherever layers weaken light on the eye's side.
    assert fit.errors_with("specification") == fit.errors
    assert fit.material.specular_ior == 1.5
    assert "rms" in repr(fit)


def test_errors_are_what_they_say(truth):
    material = OpenPBR(base_color=(0.1, 0.1, 0.5), specular_roughness=0.0)
    errors = material_errors(material, truth)
    mu, weights = half_range(truth.weights.size)
    share = (weights * mu)[:, None] * weights * mu
    seen = np.array([[reflectance_factor(material, i, o) for o in mu] for i in mu])
    square = ((seen - truth.body[truth.nodes, truth.nodes]) ** 2).mean(axis=-1)
    assert_allclose(errors.rms, np.sqrt((share * square).sum()), rtol=1e-9)
    sky = np.array([directional_albedo(material, c) for c in truth.cosines[truth.views]])
    expected = truth.directional_albedo()[truth.views]
    assert_allclose(errors.albedo, np.abs(sky - expected).max(), rtol=1e-9)
    assert_allclose(errors.sky_most, delta_e(sky, expected, "acescg").max(), rtol=1e-9)


def test_the_computed_glaze_is_the_solvers(truth):
    glaze = blue_glaze()

    def seen(geometry):
        xyz = gj.colour.xyz(GRID, gj.reflectance(glaze, geometry))
        return rgb_of_xyz(np.asarray(xyz), gj.colour.white_point(GRID), "acescg")

    assert_allclose(truth.cosines[truth.views][4], 0.5)
    body = truth.body[truth.views, truth.views][4, 0]
    assert_allclose(body, seen(gj.Bidirectional(60.0, 0.0)), atol=2e-4)
    # The mirror's share and the body's together are what a sphere sees.
    whole = truth.directional_albedo()[truth.views][3]
    assert_allclose(whole, seen(gj.Hemispherical(45.0)), atol=2e-4)


def test_colour_spaces():
    white = gj.colour.white_point(GRID, "A")
    for space in ("lin_rec709", "acescg"):
        assert_allclose(rgb_of_xyz(white, white, space), 1.0, atol=1e-12)
        assert_allclose(lab_of_rgb(np.ones(3), space), [100, 0, 0], atol=1e-9)
    # ACES: AP1's red, green and blue in linear sRGB, as colour-science has them (Bradford).
    colour = gj.colour.colour_science()
    expected = colour.RGB_to_RGB(np.eye(3), "ACEScg", "sRGB", "Bradford")
    d65 = gj.colour.srgb_to_xyz(np.ones(3))
    aces, srgb = (rgb_of_xyz(np.eye(3), d65, space) for space in ("acescg", "lin_rec709"))
    ours = np.linalg.solve(aces, srgb)
    assert_allclose(ours, expected, atol=2e-4)
    assert_array_equal(outside(np.array([[0.5, 0, 1], [-0.01, 0, 0], [0, 1.2, 0]])), [0, 1, 1])


@pytest.mark.slow
def test_a_fit_says_how_much_its_space_cannot_hold(truth):
    assert truth.space == "acescg"
    assert fit_openpbr(truth).outside == 0
    assert fit_openpbr(blue_glaze()).outside > 0.5


def test_the_error_under_a_rough_surface_is_the_one_the_solver_was_asked_for(monkeypatch):
    asked = set()

    def factor(albedo, *_, cos_incidence, tolerance, **__):
        asked.add(tolerance)
        return np.zeros((len(cos_incidence), len(albedo)))

    monkeypatch.setattr("glazejax.radiative.rough.reflectance.rough_reflectance_factor", factor)
    for tolerance in (1e-6, 1e-2):
        asked.clear()
        rough = angular_colour(blue_glaze(), roughness=0.3, tolerance=tolerance)
        assert asked == {rough.error}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: OpenPBR(base_color=(0.5, 1.2, 0.1)), "base_color is .*; OpenPBR takes 0 to 1"),
        (lambda: OpenPBR(coat_ior=0.5), "coat_ior is 0.5; OpenPBR takes 1 to 3"),
        (lambda: OpenPBR(base_weight=(1.0, 1.0, 1.0)), "a colour has three numbers"),  # pyright: ignore[reportArgumentType]
        (
            lambda: fit_openpbr(blue_glaze(), layering="arnold"),  # pyright: ignore[reportArgumentType]
            "layering is 'arnold'; choose materialx",
        ),
        (
            lambda: fit_openpbr(blue_glaze(), space="adobe"),
            "colour space 'adobe' is not known: choose srgb",
        ),
        (
            lambda: fit_openpbr(blue_glaze(), roughness=2.0),
            "roughness is 2.0; it is alpha of GGX, from 0",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused(unchecked, call, words):
    with refusal(words):
        call()
