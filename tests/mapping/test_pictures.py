"""Pictures of a map and the counts they are made from."""

from dataclasses import replace

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose, assert_array_equal

from glazefit.mapping.show.legend import (
    BLANK,
    MOST_SETS,
    OTHERS,
    STRIPES,
    legend_colours,
    seen_colours,
)
from glazefit.mapping.show.names import file_stems
from glazefit.mapping.show.overview import overview, pixel_area
from glazefit.mapping.show.pictures import (
    MapPicture,
    colour_numbers,
    false_colour,
    found_paints,
    legend_map,
    legend_places,
    numbers_of,
    paint_pictures,
)
from glazefit.mapping.store.layout import Status, status_counts
from glazejax.colour import delta_e_2000
from glazejax.plots import hex_colour
from tests.mapping import small

from .truth_map import painting, truth_map


@pytest.fixture(scope="module")
def scene():
    return painting((96, 128), seed=1)


@pytest.fixture(scope="module")
def made(scene):
    return truth_map(scene)


@pytest.fixture(scope="module")
def dataset(made):
    return made[0]


@pytest.fixture(scope="module")
def look(made):
    return overview(*made)


def rgb(colour):
    return list(bytes.fromhex(colour[1:]))


def test_every_pixel_is_counted_once(scene, dataset, look):
    truth = scene.truth(0, 96)
    mapped = dataset["status"].values == Status.MAPPED
    assert status_counts(dataset.attrs["tallies"]) == {
        "mapped": mapped.sum(),
        "left out by the mask": 3 * 128,
        "saturated": 24,
    }
    assert sum(sums.pixels for sums in look.sets.values()) == look.mapped == mapped.sum()
    assert look.sets[()].pixels == np.sum(mapped & truth["foreign"])
    assert look.explained == look.mapped - look.sets[()].pixels
    for members in look.ranked:
        wanted = np.array([*members, -1, -1][:3])
        there = mapped & (truth["members"] == wanted).all(axis=-1)
        assert look.sets[members].pixels == there.sum()
    areas = [look.sets[members].pixels for members in look.ranked]
    assert areas == sorted(areas, reverse=True)
    for paint in range(len(scene.paints)):
        count = np.sum(mapped & ~truth["foreign"] & (truth["members"] == paint).any(axis=-1))
        assert look.in_set[paint] == look.likely[paint] == count
    # Quarter of a millimetre a side.
    assert look.pixel_area == pytest.approx(0.25e-3**2)


@pytest.mark.parametrize(
    ("unit", "metres"),
    [
        ("Meters", 1.0),
        ("centimeters", 1e-2),
        ("millimeters", 1e-3),
        ("millimetre", 1e-3),
        ("micrometers", 1e-6),
        ("µm", 1e-6),
        ("pixel", None),
        ("degrees", None),
    ],
)
def test_a_pixel_has_an_area_in_units_of_length(unit, metres):
    places = {
        name: (name, [0.5, step + 0.5], {"units": unit}) for name, step in (("y", 2), ("x", 3))
    }
    area = pixel_area(xarray.Dataset(coords=places))
    assert area == (metres and pytest.approx(6 * metres**2))


def test_paints_in_another_order_are_the_same_set(made, look):
    dataset, sets = made
    turned = dataset.copy(deep=True)
    for name in ("members", "fraction"):
        values = turned[name].values
        values[::2] = values[::2, :, ::-1]
    again = overview(turned, sets)
    for members in look.ranked:
        assert look.where(members).sum() == look.sets[members].pixels
        assert_array_equal(again.where(members), look.where(members))
    assert_array_equal(again.examples["fraction"], look.examples["fraction"])
    assert_array_equal(again.paint_amount, look.paint_amount)


def test_a_large_map_is_seen_in_squares_of_few_rows_at_a_time(made, look, monkeypatch):
    dataset = made[0]
    monkeypatch.setattr("glazefit.mapping.show.overview.MOST", (30, 30))
    whole = overview(*made)
    assert whole.step == 5
    monkeypatch.setattr("glazefit.mapping.show.overview._PIXELS", 1)
    pieces = overview(*made)
    assert (pieces.likely == whole.likely).all()
    assert (pieces.likely == look.likely).all()
    for name, values in whole.means.items():
        assert_allclose(pieces.means[name], values, rtol=1e-6)
        assert values.shape == (20, 26)
    assert_array_equal(pieces.examples["members"], whole.examples["members"])
    # The upper left square of the rows that are not masked, by hand.
    status, thickness = dataset["status"].values[5:10, :5], dataset["thickness"].values[5:10, :5]
    mean = np.nanmean(np.where(status == Status.MAPPED, thickness, np.nan))
    assert whole.means["thickness"][1, 0] == pytest.approx(mean, rel=1e-5)
    monkeypatch.setattr("glazefit.mapping.show.overview.MOST", (48, 64))
    assert np.isnan(overview(*made).means["thickness"][0, 0])


def test_amounts_are_those_of_the_truth(scene, look):
    truth = scene.truth(0, 96)
    known = (look.examples["status"] == Status.MAPPED) & ~truth["foreign"]
    for paint in found_paints(look):
        amount = np.where(truth["members"] == paint, truth["amounts"], 0.0).sum(axis=-1)
        assert_allclose(look.paint_amount[known][:, paint], amount[known], rtol=1e-5, atol=1e-12)
    assert np.isnan(look.paint_amount[~known]).all()


def test_a_pixel_that_nothing_explains_shows_no_thickness(made):
    """Though the map has that of the set that comes nearest."""
    dataset, sets = made
    rejected = dataset.copy(deep=True)
    explained = dataset["explained"].values == 1
    none = (dataset["status"].values == Status.MAPPED) & ~explained
    assert none.any()
    for name in ("thickness", "thickness_sd"):
        rejected[name].values[none] = 3e-6
    means = overview(rejected, sets).means
    for name in ("thickness", "thickness_sd"):
        assert_array_equal(np.isfinite(means[name]), explained)
    # How far off the set is, is shown.
    assert np.isfinite(means["misfit"][none]).all()


def test_a_film_that_hides_its_ground_shows_shares_and_no_amounts(made):
    dataset, sets = made
    hidden = dataset.copy(deep=True)
    hidden["thickness"][:] = np.nan
    seen = overview(hidden, sets)
    paint = found_paints(seen)[0]
    probability, share = paint_pictures(seen, paint)
    assert probability.key.endswith("_probability")
    assert share.key.endswith("_share")
    assert np.nanmax(share.values) <= 1.0
    # Nothing of a paint is known to be nothing.
    assert (seen.paint_amount[..., paint][seen.paint_share[..., paint] == 0] == 0).all()
    assert np.isfinite([each.high for each in numbers_of(seen)]).all()
    # Its thickness is nowhere known: no picture that is grey all over.
    assert {"thickness", "probability"} & {each.key for each in numbers_of(seen)} == {"probability"}
    assert all(np.isfinite(each.values).any() for each in numbers_of(seen))


def test_the_legend_map_has_the_colour_of_each_set_and_stripes_for_none(look):
    image = legend_map(look)
    times = image.shape[1] // 128
    small = image[times // 2 :: times, times // 2 :: times]
    for members, colour in zip(look.shown, look.legend_colours, strict=True):
        assert (small[look.where(members)] == rgb(colour)).all()
    rest = np.any([look.where(members) for members in look.ranked[len(look.shown) :]], axis=0)
    assert (small[rest] == rgb(OTHERS)).all()
    assert rest.any()
    assert (small[look.examples["status"] != Status.MAPPED] == rgb(BLANK)).all()
    none = image[look.where(()).repeat(times, axis=0).repeat(times, axis=1)]
    assert np.unique(none, axis=0).tolist() == sorted(map(rgb, STRIPES))


def test_numbers_of_sets_stand_within_them(look):
    places = legend_places(look)
    assert [*places] == [*range(1, len(look.shown) + 1)]
    for members, (x, y) in zip(look.shown, places.values(), strict=True):
        assert look.where(members)[int(y * 96), int(x * 128)]


def apart(colours):
    """The least CIEDE2000 between two colours, whoever looks."""
    shades = np.array([rgb(colour) for colour in colours]) / 255.0
    one, other = np.triu_indices(len(colours), 1)
    seen = seen_colours(shades)
    assert len(seen) == 4
    return float(delta_e_2000(seen[:, one], seen[:, other]).min())


def test_colours_of_the_legend_differ_for_everybody(look):
    rng = np.random.default_rng(0)
    painted = [hex_colour(shade) for shade in rng.uniform(0, (1.0, 0.7, 0.5), (MOST_SETS, 3))]
    for own in (look.own_colours, painted, ["#d8d2c0"] * MOST_SETS):
        assert apart([*legend_colours(own), OTHERS, BLANK]) > 10
    assert legend_colours([]) == []


def test_colours_of_the_legend_take_after_the_paints(look):
    """The largest sets have their own colours; of further ones most keep their hue."""
    own = look.own_colours
    assert look.legend_colours == legend_colours(own)
    for colours in (["#b32e25", "#160959", "#009d54", "#f7b300"], ["#010101", "#5a2d0c"]):
        assert apart(colours) > 10
        assert legend_colours(colours) == colours
    oils = ["#b32e25", "#d42a00", "#f05100", "#002e8c", "#160959", "#00352e", "#009d54", "#ebeded"]
    shades, made = (
        np.array([rgb(colour) for colour in each]) for each in (oils, legend_colours(oils))
    )
    # The strongest of red, green and blue is that of the paint, but for white.
    assert (shades.argmax(axis=1) == made.argmax(axis=1))[:-1].all()


def test_own_colours_are_those_of_the_paint(look):
    own = look.own_colours
    assert len(set(own)) > 5
    for members, colour in zip(look.shown, own, strict=True):
        mean = look.colour[look.where(members)].mean(axis=0)
        assert np.abs(mean - rgb(colour)).max() < 15


def test_each_paint_has_files_of_its_own(look):
    names = ["Red (light)", "Red [light]", "red {light}", "Blau-Grün", "Red__light__2"]
    stems = ["Red__light_", "Red__light__2", "red__light__3", "Blau-Grün", "Red__light__2_2"]
    assert file_stems(names) == stems
    renamed = replace(look, paints=(*names, *look.paints[len(names) :]))
    keys = [paint_pictures(renamed, paint)[0].key for paint in range(len(names))]
    assert keys == [f"{stem}_probability" for stem in stems]


def test_a_number_is_its_colour_and_grey_where_it_is_not_known():
    from matplotlib import colormaps

    values = np.array([[0.0, 5.0], [20.0, np.nan]])
    image = colour_numbers(MapPicture("a", "A", values, high=10.0))
    side = image.shape[1] // 2
    corners = image[:: 2 * side - 1, :: 2 * side - 1]
    for at, level in (((0, 0), 0.0), ((0, 1), 0.5), ((1, 0), 1.0)):
        assert_allclose(corners[at], np.array(colormaps["viridis"](level)[:3]) * 255, atol=1)
    assert len(set(corners[1, 1])) == 1


def test_false_colour_takes_infrared_where_there_is_some(scene):
    grid = np.linspace(400.0, 1000.0, 61)
    values = np.zeros((4, 5, 61), np.float32)
    values[..., grid > 850] = np.linspace(0, 1, 20).reshape(4, 5, 1)
    image, words = false_colour(small.image(values, grid))
    assert words == "red 900 nm, green 650 nm, blue 550 nm"
    assert image[..., 0].max() == 255
    assert image[..., 1:].max() == 0
    _, words = false_colour(small.image(scene.rows(0, 9), scene.wavelengths), 3)
    assert "red 690 nm" in words.replace("680", "690")
