"""Spectra of many bands, searched at fewer; and what is made once for a catalogue."""

import importlib

import numpy as np
import pytest

from glazefit import Identification, identify
from glazefit.film.model.response import film_response
from glazefit.film.shared_bands import FINEST, shared_bands
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher
from glazejax import Hemispherical, Pigment, catalogue

SEARCHER = importlib.import_module("glazefit.identify.search.searcher")
TABLE = importlib.import_module("glazefit.identify.search.table")
CONDITIONS = importlib.import_module("glazefit.identify.search.unstated_conditions")
NAMES = ("ZincWhite", "PrussianBlue", "Vermillion", "CobaltBlue", "ChromeYellow", "BoneBlack")


def _paints(bands: int):
    grid = np.linspace(400.0, 700.0, bands)
    known = catalogue.load()
    return grid, [known[name].resample(grid) for name in NAMES]


def test_many_bands_are_averaged_as_the_command_does():
    grid, paints = _paints(301)
    searcher = Searcher.of(grid, paints, IdentificationOptions(max_paints=2))
    assert searcher.averaged is not None
    few, step = searcher.averaged
    assert step == FINEST
    np.testing.assert_array_equal(few.task.wavelengths, shared_bands(grid, paints).wavelengths)
    thorough = IdentificationOptions(max_paints=2, thorough=True)
    assert Searcher.of(grid, paints, thorough).averaged is None
    grid, paints = _paints(100)
    assert Searcher.of(grid, paints).averaged is None


def test_a_wide_range_is_averaged_to_some_hundred_bands():
    grid = np.arange(400.0, 2401.0, 4.0)
    paint = Pigment("a", grid, np.full(grid.size, 2e4), np.full(grid.size, 4e4))
    searcher = Searcher.of(grid, [paint], IdentificationOptions(max_paints=1))
    assert searcher.averaged is not None
    assert searcher.averaged[0].task.wavelengths.size == 101


@pytest.fixture(scope="module")
def fine():
    """Films of two paints at many bands, and how they are sought."""
    grid, paints = _paints(121)
    rng = np.random.default_rng(2)
    k, s = (
        25e-6 * np.stack([np.asarray(getattr(paint, what)) for paint in paints])
        for what in ("absorption", "scattering")
    )
    share = np.array([[0.3, 0, 0.7, 0, 0, 0], [0.6, 0.4, 0, 0, 0, 0], [0, 0, 0, 0.8, 0.2, 0]])
    body = np.asarray(film_response(Hemispherical()).body(share @ k, share @ s, 0.9))
    spectra = body + 0.04 + 0.001 * rng.standard_normal(body.shape)

    def find(**options) -> Identification:
        return identify(grid, spectra, paints, ground=0.9, max_paints=2, **options)

    return find


@pytest.mark.slow
def test_a_search_at_few_bands_finds_what_all_find(fine, monkeypatch):
    few = fine()
    monkeypatch.setattr(SEARCHER, "_MANY", 1000)
    every = fine()
    np.testing.assert_array_equal(few.members[:, 0], every.members[:, 0])
    np.testing.assert_allclose(few.paint_probability, every.paint_probability, atol=0.05)
    np.testing.assert_allclose(few.none, every.none, atol=0.03)
    np.testing.assert_allclose(few.fitted[:, 0], every.fitted[:, 0], atol=3e-3)
    assert np.abs(few.fitted[:, 0] - every.fitted[:, 0]).max() > 0
    both = few.members[:, 0] >= 0
    # Amounts differ by far less than they are sure.
    low, high = np.log(every.amounts_90[:, 0][both]).T
    off = np.log(few.amounts[:, 0][both] / every.amounts[:, 0][both])
    assert np.abs(off / (high - low)).max() < 0.1


def test_films_are_computed_once_for_a_catalogue_and_an_instrument(fine, monkeypatch):
    fine()
    monkeypatch.setattr(TABLE, "film_table", lambda *given: pytest.fail("made again"))
    fine()
    with pytest.raises(pytest.fail.Exception, match="made again"):
        fine(instrument="45:0")


@pytest.mark.slow
def test_what_no_paint_reads_under_a_varnish_is_not_sought_under_it(monkeypatch):
    """A white that a yellowed varnish would have made yellow, beside a yellow that may lie under
    one.
    """
    grid, paints = _paints(16)
    sought: list[tuple[str, ...]] = []
    search = CONDITIONS.find_candidates

    def find(task, measured):
        sought.append(measured.names)
        return search(task, measured)

    monkeypatch.setattr(CONDITIONS, "find_candidates", find)
    yellow = np.linspace(0.12, 0.7, grid.size)
    found = identify(
        grid,
        np.stack([np.full(grid.size, 0.9), yellow]),
        paints,
        ground=0.9,
        max_paints=2,
        names=["white", "yellow"],
        varnish="yellowed",
    )
    # Under the varnish first; what both are sought as later is over other grounds.
    assert sought[0] == ("yellow",)
    assert (found.condition[0] != 2).all()
    assert (found.condition[1] == 2).any()
