"""Spectra that no paints explain: the purest are offered as paints, and a second map reads them."""

import html
import re

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose, assert_array_equal

from glazefit.mapping.show.page_rows import PAINTS, share_words, spot_rows
from glazefit.mapping.solve.answers import Answers
from glazefit.mapping.solve.features import Features
from glazefit.mapping.solve.solver import _sums
from glazefit.mapping.solve.spots import SPOTS, choose_spots, gather, spot_pigment
from glazefit.mapping.spot_files import write_spots
from glazefit.mapping.store.chunk import Unexplained
from glazefit.page.templates import fill_template
from glazejax import Glaze, Hemispherical, Layer, Mixture, catalogue, reflectance
from glazejax.geometry import resolve_instrument
from tests.mapping import small

GRID = np.linspace(400.0, 700.0, 31)
BARE = np.full(GRID.size, 0.75)
FOREIGN = ("ViridianGreen", "Vermillion", "PrussianBlue")


@pytest.fixture(scope="module")
def unexplained() -> tuple[Unexplained, list[str]]:
    """Films of three paints, thin and thick, pure and with white, in any order; and of what each
    is, pure or not.
    """
    rng = np.random.default_rng(0)
    white = catalogue.pigment("ZincWhite").resample(GRID)
    thick = np.geomspace(4e-6, 60e-6, 24)
    readings, words = [], []
    for name in FOREIGN:
        paint = catalogue.pigment(name).resample(GRID)
        for share in (1.0, 0.1):
            coat = Layer(Mixture([paint, white], [share, 1.0 - share]), thick)
            film = np.asarray(reflectance(Glaze([coat], 0.8, 1.5), Hemispherical()))
            readings.append(film + 0.002 * rng.standard_normal(film.shape))
            words += [name if share == 1.0 else f"{name}, tinted"] * len(film)
    order = rng.permutation(len(words))
    whole = np.concatenate(readings)[order]
    places = np.stack([np.arange(len(words)), np.zeros(len(words), int)], axis=1)
    found = gather(whole, Features.of(whole)(whole), places)
    return found, [words[n] for n in order]


def test_groups_hold_every_spectrum_once(unexplained):
    found, words = unexplained
    assert found.pixels.sum() == len(words)
    assert len(found.pixels) <= 64
    assert not len(gather(np.zeros((0, 31)), np.zeros((0, 16)), np.zeros((0, 2))).pixels)


def test_each_paint_is_offered_pure(unexplained, monkeypatch):
    found, words = unexplained
    spots = choose_spots(found, BARE, len(words), paint_names=["Spot2"])
    assert len(spots) <= SPOTS
    assert [spot["name"] for spot in spots[:2]] == ["Spot1", "Spot3"]
    assert {words[spot["place"][0]] for spot in spots} >= set(FOREIGN)
    monkeypatch.setattr("glazefit.mapping.solve.spots.SPOTS", 2)
    assert len(choose_spots(found, BARE, len(words))) == 2


def test_thickness_of_a_set_that_was_rejected_counts_nowhere():
    answers = Answers.empty(4, 2, 3)
    answers.members[:, 0] = 1
    answers.amounts[:, 0] = np.log([1e-6, 2e-6, 4e-6, 8e-6])
    answers.explained[:3] = True
    answers.opaque[2] = True
    sums = _sums(answers, np.full((4, 3), 0.5, np.float32))
    assert {members: one.pixels for members, one in sums.items()} == {(1,): 3, (): 1}
    assert sums[1,].pixels_with_thickness == 2
    assert sums[1,].thickness_um == pytest.approx(1.5)
    assert sums[()].thickness_um is None


def test_few_pixels_are_no_paint(unexplained):
    found, _ = unexplained
    assert choose_spots(found, BARE, 1e9) == []
    assert choose_spots(Unexplained.nothing(), BARE, 100.0) == []


def test_spots_are_files_that_a_second_map_reads(tmp_path):
    readings = {"Spot1": np.linspace(0.01, 0.6, 11).tolist(), "Spot2": [0.4] * 11}
    bands = np.linspace(405.0, 695.0, 11)
    spots = [
        {"name": name, "pixels": 30, "place": [4, 7], "reading": reading}
        for name, reading in readings.items()
    ]
    found = xarray.Dataset(attrs={"spots": spots, "working_wavelengths": bands.tolist()})
    seen_with = resolve_instrument("d:8")
    files = write_spots(tmp_path, found, GRID, small.paints(), instrument=seen_with)
    table = np.loadtxt(files[0], delimiter=",", skiprows=1)
    assert_array_equal(table[:, 0], bands)
    assert_array_equal(table[:, 2], readings["Spot2"])
    known = catalogue.read(files[1])
    assert list(known) == [*small.PAINTS, "Spot1", "Spot2"]
    # As wide as the image, so that no band is lost, and a hiding film reads the spot.
    paint = known["Spot2"]
    assert (paint.wavelengths[0], paint.wavelengths[-1]) == (400.0, 700.0)
    film = reflectance(Glaze([Layer(paint, 0.01)], 0.0, 1.5), Hemispherical())
    assert_allclose(film, 0.4, atol=2e-3)
    none = found.assign_attrs(spots=[])
    assert write_spots(tmp_path, none, GRID, small.paints(), instrument=seen_with) == []


def test_the_page_says_how_to_add_each(unexplained):
    found, words = unexplained
    spots = choose_spots(found, BARE, len(words))
    page = _fill(list(spot_rows(spots, GRID)))
    said = html.unescape(re.sub(r"<[^>]*>", " ", page))
    assert said.count("Add this as a paint") == len(spots)
    assert page.count("<svg") == len(spots)
    names = [spot["name"] for spot in spots]
    assert f"--pigments paints_with_spots.csv --without {','.join(names[1:])}" in said
    assert _fill([]).strip() == ""


def _fill(rows):
    values = {"spots": rows, "grid": GRID, "mapped": 1000, "families": None}
    template = "mapping/show/spots.html"
    return "".join(fill_template(template, share=share_words, spots_file=PAINTS, **values))


def test_paints_of_spots_carry_that_scattering_is_not_told():
    reading = np.full(GRID.size, 0.3)
    made = spot_pigment("Spot1", GRID, reading, small.paints(), resolve_instrument("d:8"))
    share = np.asarray(made.scattering_sd) / np.asarray(made.scattering)
    assert (share > 0.3).all()
