"""Spectra of many bands, gathered at few; and what is made once for a catalogue."""

import importlib

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from glazefit import Identification, ModelError, identify
from glazefit.film.model.response import film_response
from glazefit.identify.search.few_bands import (
    MISSED,
    FewBands,
    can_gather,
    choose_bands,
    few_bands_of,
    gather,
)
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher
from glazefit.identify.search.table import films_at_random
from glazefit.identify.search.task import Measured
from glazejax import Hemispherical, catalogue

FEW_BANDS = importlib.import_module("glazefit.identify.search.few_bands")
TABLE = importlib.import_module("glazefit.identify.search.table")
CONDITIONS = importlib.import_module("glazefit.identify.search.unstated_conditions")
NAMES = ("ZincWhite", "PrussianBlue", "Vermillion", "CobaltBlue", "ChromeYellow", "BoneBlack")


def _measured(readings: np.ndarray, noise_sd: np.ndarray, ground: float = 0.8) -> Measured:
    spectra, grounds, bands = readings.shape
    return Measured(
        names=tuple(map(str, range(spectra))),
        wavelengths=np.linspace(400.0, 700.0, bands),
        readings=readings,
        grounds=np.full(readings.shape, ground),
        noise_sd=noise_sd,
        doubt=np.empty((spectra, 0, grounds, bands)),
    )


def _paints(bands: int):
    grid = np.linspace(400.0, 700.0, bands)
    known = catalogue.load()
    return grid, [known[name].resample(grid) for name in NAMES]


def test_what_is_gathered_has_the_likelihood_of_all_readings():
    """Against the density of all bands, for films in the span of few and errors in it too."""
    rng = np.random.default_rng(3)
    bands, few, grounds = 14, 4, 2
    spread = rng.standard_normal((bands, few))
    place = np.array([0, 4, 9, 13])
    told = FewBands(place, spread, np.zeros(bands), np.zeros(bands))
    noise_sd = rng.uniform(0.01, 0.05, (1, grounds, bands))
    wide = np.kron(np.eye(grounds), spread)
    root = 0.1 * rng.standard_normal((grounds * few, grounds * few))
    films = rng.uniform(0.2, 0.6, (3, grounds * few))
    spectrum = wide @ (
        films[0] + root @ rng.standard_normal(grounds * few)
    ) + noise_sd.ravel() * rng.standard_normal(grounds * bands)
    measured = _measured(spectrum.reshape(1, grounds, bands), noise_sd)
    found = gather(told, measured, ModelError(amplitude=0.0))
    assert found.all_bands is not None
    assert found.readings.shape == (1, grounds, few)
    assert found.all_bands.in_all[0] == grounds * bands
    whole = np.diag(noise_sd.ravel() ** 2) + wide @ root @ root.T @ wide.T
    small = found.all_bands.noise[0] + root @ root.T
    for film in films:
        exact = multivariate_normal(wide @ film, whole).logpdf(spectrum)  # pyright: ignore
        here = multivariate_normal(film, small).logpdf(found.flat[0])  # pyright: ignore
        here += found.all_bands.height[0] - 0.5 * found.all_bands.outside[0]
        # Products of G are in single precision.
        assert here == pytest.approx(exact, rel=1e-4, abs=1e-3)


def test_films_are_missed_between_the_bands_by_no_more_than_is_told():
    grid, paints = _paints(301)
    searcher = Searcher.of(grid, paints, IdentificationOptions(max_paints=2))
    on_few = few_bands_of(searcher.task)
    assert on_few is not None
    few, task = on_few
    assert 10 < len(few.index) < 64
    assert few.index[0] == 0
    assert few.index[-1] == grid.size - 1
    assert few.missed.max() <= MISSED
    np.testing.assert_array_equal(task.wavelengths, grid[few.index])
    np.testing.assert_array_equal(task.modes, searcher.task.modes[:, :, few.index])
    # Films that nobody chose the bands by: other amounts, over another ground.
    rng = np.random.default_rng(5)
    amounts = rng.lognormal(-0.7, 0.7, (60, 2))
    pairs = np.array([rng.choice(len(paints), 2, replace=False) for _ in range(60)])
    k, s = (
        np.einsum("nm,nmb->nb", amounts, np.asarray(part)[pairs]) for part in searcher.task.paints
    )
    films = np.asarray(film_response(Hemispherical()).body(k, s, 0.7))
    missed = films - films[:, few.index] @ few.spread.T
    assert np.sqrt(np.mean(missed**2)) < 1.5 * MISSED


def test_the_length_of_the_models_error_counts():
    grid, paints = _paints(121)
    task = Searcher.of(grid, paints, IdentificationOptions(max_paints=1)).task
    films = films_at_random(*task.tables.single, 0.7, np.array([0.03, 0.9]), grid.size)
    short, long = (choose_bands(films, grid, length).rough for length in (20.0, 200.0))
    assert short.max() > 2.0 * long.max()


def test_smooth_errors_count_as_noise_as_far_as_they_are_missed():
    """The model's own errors between the bands, drawn and compared with what is foretold."""
    grid, paints = _paints(121)
    task = Searcher.of(grid, paints, IdentificationOptions(max_paints=2)).task
    films = films_at_random(*task.tables.single, 0.7, np.array([0.03, 0.9]), grid.size)
    few = choose_bands(films, grid, 60.0)
    apart = np.sqrt(3.0) * np.abs(grid[:, None] - grid) / 60.0
    root = np.linalg.cholesky((1.0 + apart) * np.exp(-apart) + 1e-10 * np.eye(grid.size))
    errors = np.random.default_rng(1).standard_normal((4000, grid.size)) @ root.T
    missed = np.sqrt(np.mean((errors - errors[:, few.index] @ few.spread.T) ** 2, axis=0))
    np.testing.assert_allclose(missed, few.rough, atol=0.01)
    assert few.rough.max() > 0.02


def test_a_ground_that_few_bands_do_not_tell_is_taken_at_all():
    grid, paints = _paints(101)
    on_few = few_bands_of(Searcher.of(grid, paints, IdentificationOptions(max_paints=2)).task)
    assert on_few is not None
    few, _ = on_few
    readings = np.full((1, 1, grid.size), 0.5)
    measured = _measured(readings, np.full(readings.shape, 0.001))
    assert can_gather(few, measured)
    left_out = np.setdiff1d(np.arange(grid.size), few.index)[5]
    measured.grounds[..., left_out] = 0.2
    assert not can_gather(few, measured)


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
    monkeypatch.setattr(FEW_BANDS, "_MANY", 1000)
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
