"""Glazed pictures: equal to computing every pixel, whatever varies, and errors that help."""

import warnings

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax import (
    Bidirectional,
    Glaze,
    Hemispherical,
    Layer,
    Mixture,
    Pigment,
    colour,
    picture,
    reflectance,
)
from glazejax.radiative.plan.plan import ALL

from .checks import largest_difference
from .refusals import refusal

GRID = np.arange(400.0, 701.0, 30.0)
SIZE = (24, 32)
FLAT = np.full(SIZE, 1e-6)


@pytest.fixture(scope="module")
def paints():
    x = (GRID - 400) / 300
    blue = Pigment("blue", GRID, 5e5 * x + 2e4, 4e4 + 0 * x)
    yellow = Pigment("yellow", GRID, 4e5 * np.exp(-8 * x), 2e5 + 3e5 * x)
    return blue, yellow


@pytest.fixture(scope="module")
def maps():
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]] / 24
    return 4e-6 * x * (1 + 0.2 * rng.random(SIZE)), 2e-6 + 20e-6 * np.sin(
        3 * y
    ) ** 2 + 1e-6 * rng.random(SIZE)


def difference(one, two, white):
    return colour.delta_e_2000(*(colour.xyz_to_lab(image.xyz, white) for image in (one, two)))


def test_interpolated_picture_is_the_full_one(paints, maps):
    fast = picture(paints, maps, 0.85)
    full = picture(paints, maps, 0.85, full=True)
    assert fast.srgb.shape == fast.xyz.shape == (*SIZE, 3)
    assert fast.computed < full.computed == np.prod(SIZE)
    assert 0 < fast.delta_e <= 0.1
    assert full.delta_e == 0
    white = colour.white_point(GRID)
    assert difference(fast, full, white).max() <= 0.1
    assert_allclose(fast.srgb, colour.xyz_to_srgb(fast.xyz, white))
    assert "interpolated" in repr(fast)


def test_full_picture_is_that_of_each_glaze(paints, maps):
    corner = [m[:3, :1] for m in maps]
    for geometry in (
        Hemispherical(8, specular=True),
        Bidirectional(30, 30, specular=True),
        Bidirectional(45, 0),
    ):
        image = picture(paints, corner, 0.7, geometry, full=True)
        glaze = Glaze([Layer(p, m) for p, m in zip(paints, corner, strict=True)], 0.7)
        spectra = reflectance(glaze, geometry)
        assert_allclose(image.srgb, colour.srgb(GRID, spectra), rtol=0, atol=2e-5)
        assert_allclose(image.xyz, colour.xyz(GRID, spectra), rtol=0, atol=3e-6)


@pytest.mark.slow
def test_map_of_the_ground_and_a_constant_layer(paints, maps):
    ground = np.random.default_rng(1).uniform(0.1, 0.9, SIZE)
    fast = picture(paints, [maps[0], 3e-6], ground, delta_e=0.5)
    full = picture(paints, [maps[0], np.full(SIZE, 3e-6)], ground, full=True)
    assert "interpolated" in fast.report
    assert difference(fast, full, colour.white_point(GRID)).max() <= 0.5


def test_few_distinct_pixels_are_computed_one_by_one(paints):
    steps = np.repeat(np.arange(8), 64).reshape(16, 32) * 1e-6
    image = picture(paints, [steps, 2e-6], np.linspace(0.5, 0.9, GRID.size))
    assert (image.computed, image.delta_e) == (8, 0)
    assert "8 distinct" in image.report
    constant = picture(paints, [np.full(SIZE, 1e-6), 2e-6], 0.5)
    assert constant.computed == 1
    assert np.ptp(np.asarray(constant.srgb), axis=(0, 1)).max() == 0


@pytest.mark.slow
def test_more_than_three_maps_are_computed_pixel_by_pixel(paints, maps):
    small = [m[:17, :17] for m in (*maps, maps[0] / 2, maps[1] / 3)]
    image = picture([*paints, *paints], small, 0.5, delta_e=10, savings=ALL)
    assert image.computed == 17 * 17
    assert image.delta_e == 0


@pytest.mark.parametrize(("double", "delta_e"), [(False, 0.05), (True, 1e-6)])
def test_a_small_difference_is_no_tolerance_to_warn_of(double, delta_e):
    with jax.enable_x64(double), warnings.catch_warnings():
        warnings.simplefilter("error")
        grey = Pigment("grey", GRID, np.full(GRID.size, 1e4), np.full(GRID.size, 1e5))
        picture([grey], [np.full((2, 2), 1e-6)], 0.5, delta_e=delta_e)


def test_picture_is_written(paints, maps, tmp_path):
    path = tmp_path / "picture.png"
    image = picture(paints, maps, 0.85)
    image.save(path)
    from matplotlib.image import imread

    assert imread(path).shape[:2] == SIZE
    # The nearest of 256 levels.
    assert largest_difference(imread(path)[..., :3], image.srgb) < 0.501 / 255


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"thickness_maps": (np.full(SIZE, 12.0), 1e-6)}, "thickness is in metres"),
        (
            {"thickness_maps": (np.full(SIZE, np.nan), 1e-6)},
            "thickness of 'blue' must be finite|thickness of 'blue' must be in",
        ),
        ({"thickness_maps": (np.full(SIZE, -1e-6), 1e-6)}, "not -1e-06"),
        ({"thickness_maps": (FLAT, np.full((3, 3), 1e-6))}, "maps differ in shape"),
        (
            {"thickness_maps": (np.full(7, 1e-6), 1e-6)},
            r"shape \(7,\); it must be a number or a map \(h, w\)",
        ),
        ({"thickness_maps": (1e-6, 1e-6)}, "glazejax.reflectance"),
        ({"thickness_maps": (FLAT,)}, "2 coats and 1 thickness maps"),
        ({"ground": np.full(SIZE, 84.0)}, "percent"),
        ({"ground": np.full(5, 0.5)}, "bands"),
        ({"delta_e": 0.0}, "delta_e is 0"),
        ({"instrument": Bidirectional([10, 20], 0)}, "one angle"),
    ],
)
def test_what_is_wrong_is_named(paints, change, words):
    asked = {"thickness_maps": (FLAT, 1e-6), "ground": 0.5} | change
    with pytest.raises(ValueError, match=words):
        picture(paints, **asked)


def test_maps_of_one_paint_have_one_shape_too(paints):
    with pytest.raises(ValueError, match="maps differ in shape"):
        picture([paints[0], paints[0]], [np.full((3, 3), 1e-6), FLAT], 0.5)


def test_paints_are_of_one_glaze(paints):
    """Pixels are computed in an order of their own, in which a batch of fractions would not follow."""
    share = np.linspace(0, 1, 12)
    weights = np.stack([share, 1 - share], axis=-1)
    ramp = np.linspace(1e-6, 2e-5, 12).reshape(3, 4)
    batch = Pigment("batch", GRID, np.full((2, GRID.size), 1e4), np.full((2, GRID.size), 1e5))
    index = np.full((12, GRID.size), 1.5)
    for coat, refractive_index in (
        (Mixture(paints, weights), 1.5),
        (Mixture(paints, weights.reshape(3, 4, 2)), 1.5),
        (batch, 1.5),
        (paints[0], index),
    ):
        with refusal("only thickness and ground may differ"):
            picture([coat], [ramp], 0.8, refractive_index=refractive_index)
