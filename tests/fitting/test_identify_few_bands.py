"""Spectra of many bands, searched at fewer; and what is made once for a catalogue."""

import numpy as np
import pytest

from glazefit import identify
from glazefit.film.model.response import film_response
from glazefit.identify.search import screen, unstated_conditions
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher
from glazejax import Hemispherical, Pigment, catalogue

from ..slow import slow
from .palette import optical_depths

NAMES = ("ZincWhite", "PrussianBlue", "Vermillion", "CobaltBlue", "ChromeYellow", "BoneBlack")


def _paints(bands):
    grid = np.linspace(400.0, 700.0, bands)
    return grid, [catalogue.pigment(name).resample(grid) for name in NAMES]


def test_a_wide_range_is_averaged_to_some_hundred_bands():
    grid = np.arange(400.0, 2401.0, 4.0)
    paint = Pigment("a", grid, np.full(grid.size, 2e4), np.full(grid.size, 4e4))
    searcher = Searcher.of(grid, [paint], IdentificationOptions(max_paints=1))
    assert searcher.averaged is not None
    assert searcher.averaged[0].task.wavelengths.size == 101


def test_bands_within_one_step_are_searched_as_they_are():
    """The line between means was not a number where there was one mean."""
    grid = np.array([550.0, 551.0, 552.0])
    paints = [catalogue.pigment(name).resample(grid) for name in NAMES[:2]]
    answer = identify(grid, np.full(3, 0.4), paints, ground=0.9, max_paints=1)
    assert np.isfinite(answer.fitted).all()
    assert np.isfinite(answer.probability).all()


def find(bands, **options):
    """Films of two paints that were read at so many bands, with as much noise in all."""
    grid, paints = _paints(bands)
    share = np.array([[0.3, 0, 0.7, 0, 0, 0], [0.6, 0.4, 0, 0, 0, 0], [0, 0, 0, 0.8, 0.2, 0]])
    depths = optical_depths(paints, 25e-6 * share)
    body = np.asarray(film_response(Hemispherical()).body(*depths, 0.9))
    noise = np.random.default_rng(2).standard_normal(body.shape)
    spectra = body + 0.04 + 0.0005 * np.sqrt((bands - 1) / 30) * noise
    return identify(grid, spectra, paints, ground=0.9, max_paints=2, **options)


@pytest.mark.parametrize("bands", [31, slow(61), 121])
def test_paints_are_as_sure_at_fine_bands(bands):
    answer = find(bands)
    assert answer.members[:, 0, :2].tolist() == [[0, 2], [0, 1], [3, 4]]
    assert answer.probability[:, 0].min() > 0.85
    # Between the means, and beyond them, lines.
    assert np.abs(answer.residual[:, 0]).max() < 0.02


def test_films_are_computed_once_for_a_catalogue_and_an_instrument(monkeypatch):
    find(31)
    monkeypatch.setattr(screen, "film_table", lambda *given: pytest.fail("made again"))
    find(31)
    with pytest.raises(pytest.fail.Exception, match="made again"):
        find(31, instrument="45:0")


@pytest.mark.slow
def test_what_no_paint_reads_under_a_varnish_is_not_sought_under_it(monkeypatch):
    """A white that a yellowed varnish would have made yellow, beside a yellow that may lie under
    one.
    """
    grid, paints = _paints(16)
    sought: list[tuple[str, ...]] = []
    search = unstated_conditions.find_candidates

    def find(films):
        sought.append(films.spectra.names)
        return search(films)

    monkeypatch.setattr(unstated_conditions, "find_candidates", find)
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
