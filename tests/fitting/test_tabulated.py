"""Results as tables of pandas and data sets of xarray."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import glazejax as gj
from glazefit.film.films import Films
from glazefit.film.model.variation import Variation
from glazefit.identify.identify import identify
from glazefit.recipe.recipe import Recipe
from glazefit.recipe.report import screen_colours
from glazefit.recipe.targets import lab_target, spectral_target
from glazefit.recover.films.film_by_film import recover_films
from glazefit.recover.predict.prediction import Prediction
from glazejax import colour
from glazejax.paint.describe import Coat
from glazejax.plots import hex_colour

GRID = np.arange(400.0, 701.0, 100.0)
FILMS = Films(
    ("blue", "red"),
    GRID,
    bare_black=np.full((2, 4), 0.04),
    bare_white=np.full((2, 4), 0.9),
    over_black=np.linspace(0.1, 0.3, 8).reshape(2, 4),
    over_white=np.linspace(0.4, 0.7, 8).reshape(2, 4),
    seen=np.array([[True, True], [False, True]]),
)


def check_units(result):
    data = result.to_xarray()
    assert data.wavelength.units == "nm"
    assert {values.units for values in data.data_vars.values()} == {"1"}
    return data


def test_films():
    data = check_units(FILMS)
    assert_array_equal(data.over_white.sel(film="red"), FILMS.over_white[1])
    # What was not measured is no number.
    assert np.isnan(data.over_black.sel(film="red")).all()
    frame = FILMS.to_dataframe()
    assert list(frame) == ["film", "wavelength_nm", *data.data_vars]
    one = frame[(frame.film == "blue") & (frame.wavelength_nm == 600)]
    assert one.over_black.item() == FILMS.over_black[0, 2]


def test_a_recovery():
    found = recover_films(FILMS.take([0]))
    data = check_units(found)
    assert_array_equal(data.absorption[0], found.absorption[0])
    assert_array_equal(data.over_black[0], FILMS.over_black[0])
    frame = found.to_dataframe()
    assert len(frame) == 4
    assert_array_equal(frame.scattering_sd, found.scattering_sd[0])
    assert frame.identifiable.dtype == bool


def test_a_prediction():
    noise = np.random.default_rng(0).normal(0, 0.01, (50, 2, 4))
    found = Prediction(
        name="mixed",
        wavelengths=GRID,
        over_black=np.linspace(0.1, 0.4, 4),
        over_white=np.linspace(0.5, 0.8, 4),
        paints=("a", "b"),
        deviations={"scale": noise, "paint": noise, "film": noise},
        variation=Variation(),
    )
    data = check_units(found)
    assert_array_equal(data.reflectance.sel(over="white"), found.over_white)
    assert_array_equal(data.upper_90, found.interval()[1])
    frame = found.to_dataframe()
    assert list(frame) == ["over", "wavelength_nm", "reflectance", "lower_90", "upper_90"]
    assert (frame.lower_90 < frame.reflectance).all()


def a_recipe():
    paints = gj.catalogue.load()
    blue, white = paints["CobaltBlue"], paints["ZincWhite"]
    mixture = gj.Mixture([blue, white], [0.25, 0.75])
    glaze = gj.Glaze([gj.Layer(blue, 5e-6), gj.Layer(mixture, 2e-5)], 0.9)
    mixed = ((0.75, "ZincWhite"), (0.25, "CobaltBlue"))
    return Recipe(
        target=lab_target([50, 0, 0]),
        coats=(Coat(((1.0, "CobaltBlue"),), 5e-6, 1), Coat(mixed, 2e-5, 1)),
        glaze=glaze,
        wavelengths=blue.wavelengths,
        reflectance=np.linspace(0.2, 0.5, 31),
        lab={"D65": np.array([50.0, 0.0, 0.0])},
        delta_e={"D65": 1.5},
        unrounded=1.4,
        metamerism=None,
        test_illuminant="A",
        rmse=None,
        sensitivity=(0.5, 0.1),
        between_mixings=2.0,
    )


def test_a_recipe():
    found = a_recipe()
    assert check_units(found).reflectance.sel(wavelength=700) == 0.5
    frame = found.to_dataframe()
    assert frame.thickness_um.tolist() == pytest.approx([5, 20, 20])
    assert frame.paint.tolist() == ["CobaltBlue", "ZincWhite", "CobaltBlue"]
    assert frame.share.tolist() == [1.0, 0.75, 0.25]
    assert frame.parts.tolist() == [1, 3, 1]


def test_the_swatches_of_a_recipe_are_what_its_observer_sees():
    found = a_recipe()
    ten = colour.find_observer("10")
    grid, values = found.wavelengths, np.linspace(0.9, 0.05, 31)
    target = spectral_target(grid, values, name="sky")
    found = replace(found, target=target, reflectance=values, observer=ten)
    shade = hex_colour(colour.srgb(grid, values, observer=ten))
    assert screen_colours(found) == (shade, shade)
    assert shade != hex_colour(colour.srgb(grid, values))


@pytest.mark.slow
def test_an_identification():
    shelf = gj.catalogue.load()
    paints = {name: shelf[name] for name in ("CobaltBlue", "ZincWhite", "Vermillion")}
    glaze = gj.Glaze([gj.Layer(paints["CobaltBlue"], 5e-6)], 0.9)
    spectrum = gj.reflectance(glaze, "d:8")
    grid = paints["CobaltBlue"].wavelengths
    found = identify(grid, spectrum[None], paints, ground=0.9, names=["spot"])
    data = check_units(found)
    assert_array_equal(data.measured.sel(spectrum="spot", ground=1), spectrum)
    assert_array_equal(data.fitted, found.fitted)
    frame = found.to_dataframe(top=2)
    assert frame["rank"].tolist() == [1, 2]
    first = found.ranked(0, 1)[0]
    assert frame.paint_1[0] == first.paints[0]
    assert frame.thickness_um[0] == pytest.approx(first.thickness * 1e6)
    # A pure paint has no second one.
    pure = found.to_dataframe().query("paint_2.isna()")
    assert pure.fraction_2.isna().all()
