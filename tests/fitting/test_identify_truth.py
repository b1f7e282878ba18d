"""Identification says what is so: simple answers, errors that go together, what nobody told, and
none of these.
"""

import numpy as np
import pytest
from benchmarks.results import read
from numpy.testing import assert_allclose

from glazefit import Identification, identify
from glazefit.film.model.errors import error_modes, modes_covariance, relative_errors
from glazefit.film.model.response import film_response
from glazefit.film.model.varnish import under_varnish, yellow
from glazefit.film.noise import noise_of_each
from glazefit.identify.search.searcher import find_extenders
from glazefit.identify.search.table import paints_of
from glazefit.identify.search.weigh import log_odds_of_none
from glazejax import Bidirectional, Hemispherical, Pigment, catalogue

from .palette import optical_depths
from .test_identify import BETWEEN_FILMS, GRID, GROUNDS, UNIT

NAMES = (
    "ZincWhite",
    "ZincWhiteLinseed",
    "PrussianBlue",
    "Vermillion",
    "CobaltBlue",
    "BoneBlack",
    "BariumSulphate",
)


def read_film(recipe, units=1.0, grounds=GROUNDS, geometry=None):
    """What a film of the catalogue's paints reads, without error, (grounds, bands)."""
    known, geometry = catalogue.load(), geometry or Hemispherical()
    amounts = units * UNIT * np.array([*recipe.values()])
    k, s = optical_depths([known[paint] for paint in recipe], amounts)
    surface = 0.04 if isinstance(geometry, Hemispherical) else 0.0
    return np.asarray(film_response(geometry).body(k, s, grounds)) + surface


@pytest.fixture(scope="module")
def shelf():
    """Paints of the catalogue; the second zinc white is the first one by another name."""
    known = catalogue.load()
    white = known["ZincWhite"]
    twin = Pigment(
        "ZincWhiteLinseed",
        GRID,
        white.absorption,
        white.scattering,
        error_modes=white.error_modes,
        provenance=white.provenance,
    )
    return [twin if name == twin.name else known[name] for name in NAMES]


@pytest.fixture(scope="module")
def found(shelf):
    """Four films, as told: a pure one, a tint, a tint under varnish, and one whose paint is taken
    off the shelf; then three readings that no paint gives, over both grounds.
    """
    tint = read_film({"CobaltBlue": 0.2, "ZincWhite": 0.8})
    coat = film_response(Hemispherical())
    yellowed = under_varnish(coat, tint - 0.04, 0.45 * yellow(GRID)) + 0.04
    green = read_film({"EmeraldGreen": 0.5, "ZincWhite": 0.5}, 2.0)
    odd = np.stack([np.arange(GRID.size) % 2.0, GRID == 550.0, GRID >= 550.0])[:, None] * np.ones(
        (2, 1)
    )
    films = read_film({"Vermillion": 1.0}), tint, yellowed, green
    return identify(
        GRID,
        np.stack([*films, *odd]),
        shelf,
        ground=GROUNDS,
        names=["pure", "tint", "yellowed", "stranger", "comb", "spike", "step"],
        max_paints=2,
    )


def test_a_pure_paint_is_called_pure(found):
    """An extender that the spectrum cannot see is not added to it."""
    assert found.ranked(0)[0].paints == ("Vermillion",)
    assert found.explained[0]


def test_a_tint_is_found_and_its_white_left_open(found):
    """Two zinc whites that are alike: the pigments are sure, which of the whites is not."""
    pigments, chance = found.families(1)[0]
    assert set(pigments) == {"CobaltBlue", "ZincWhite"}
    assert chance > 0.8
    whites = {"ZincWhite", "ZincWhiteLinseed"}
    first = set(found.ranked(1)[0].paints)
    assert set(found.not_told(1)) == first & whites
    assert set(*found.not_told(1).values()) == whites - first


def test_a_varnish_that_nobody_mentioned_is_said(found):
    first = found.ranked(2)[0]
    assert set(found.families(2)[0][0]) == {"CobaltBlue", "ZincWhite"}
    assert first.condition == "under a yellowed varnish"
    assert first.words.endswith(", under a yellowed varnish")
    assert found.ranked(1)[0].condition == ""
    assert "varnish" not in found.words(0)


def test_a_paint_that_is_missing_is_none_of_these(found):
    assert not found.explained[3]
    assert found.none[3] > 0.5
    assert "nothing in the catalogue explains this" in found.words(3)


@pytest.mark.parametrize("row", [4, 5, 6], ids=["comb", "spike", "step"])
def test_what_no_paint_reads_is_explained_by_none(found, row):
    """Jumps from band to band count as noise up to a tenth, not beyond."""
    assert not found.explained[row]
    assert found.none[row] > 0.9
    for values in (found.probability, found.fitted):
        assert np.isfinite(values[row]).any()


def test_batches_with_more_and_fewer_conditions_become_one(found, shelf):
    """A film in no doubt has fewer candidates than one that was sought again under a varnish."""
    spectra = found.measured.readings[[0, 3]]
    alone = [
        identify(GRID, one[None], shelf, ground=GROUNDS, max_paints=2, keep=300) for one in spectra
    ]
    few, many = (each.probability.shape[1] for each in alone)
    assert few < many
    both = Identification.join(alone)
    assert both.probability.shape == (2, many)
    for row, each in enumerate(alone):
        assert both.words(row).partition(":")[2] == each.words(0).partition(":")[2]
        assert [c.paints for c in both.ranked(row)] == [c.paints for c in each.ranked(0)]
        assert all(candidate.paints for candidate in both.ranked(row))


def test_what_a_person_rejects_is_never_more_probable_than_not(found):
    # Of the films; the others are as noisy as they are off.
    bad = found.delta_e[:4] > 4.0
    assert bad[3, 0]
    assert np.array_equal(found.rejected[:4], bad)
    assert np.where(bad, found.probability[:4], 0.0).sum(axis=1).max() <= 0.5


@pytest.mark.slow
def test_a_thin_film_said_to_be_opaque_is_found_over_its_ground(shelf):
    geometry = Bidirectional(45, 0)
    thin = read_film({"CobaltBlue": 1.0}, 0.1, np.full((1, GRID.size), 0.85), geometry)
    answer = identify(GRID, thin, shelf, opaque=True, instrument=geometry, max_paints=1)
    first = answer.ranked(0)[0]
    assert first.paints == ("CobaltBlue",)
    assert first.condition == "over a light ground"
    assert first.thickness == pytest.approx(0.1 * UNIT, rel=0.3)


def test_noise_is_taken_from_the_spectrum_where_nobody_told_it():
    rng = np.random.default_rng(3)
    smooth = 0.4 + 0.3 * np.tanh((np.linspace(400, 700, 61) - 560) / 40)
    noisy = smooth + 0.01 * rng.standard_normal((400, 61))
    assert np.median(noise_of_each(noisy)) == pytest.approx(0.01, rel=0.1)
    assert noise_of_each(smooth) < 5e-4
    assert noise_of_each(np.ones(5)) == 0.0


def test_extenders_are_those_that_hardly_show():
    known = list(catalogue.load().values())
    extenders = find_extenders(paints_of(known, UNIT))
    assert [known[n].name for n in np.flatnonzero(extenders)] == [
        "BariumSulphate",
        "CalciumCarbonate",
    ]


def flat_paint(modes, sd=None, name="Blue", provenance=""):
    """The same at all wavelengths: error modes, and relative standard deviations of k and s."""
    k, s = np.array([[1e4], [2e4]]) * np.ones(GRID.size)
    stated: dict = {} if sd is None else {"absorption_sd": sd[0] * k, "scattering_sd": sd[1] * s}
    modes = np.asarray(modes)[..., None] * np.ones(GRID.size)
    return Pigment(name, GRID, k, s, error_modes=modes, provenance=provenance, **stated)


def test_paints_of_one_source_are_wrong_together():
    """Errors of paints fitted together are correlated; of another source they are independent."""
    paints = [
        flat_paint([[0.1, 0.2], [0.0, 0.1]], name=name, provenance=source)
        for name, source in (("a", "lab"), ("b", "lab"), ("c", "elsewhere"))
    ]
    all_modes = error_modes(paints, BETWEEN_FILMS)

    def together(a, b):
        """Variance of a reading that two paints' log k move alike."""
        slopes = np.full((2, GRID.size), 0.5)
        return float(modes_covariance(slopes, all_modes[[a, b], 0])[0, 0])

    assert together(0, 1) == pytest.approx((0.5 * 0.2) ** 2)
    assert together(0, 2) == pytest.approx(2 * (0.5 * 0.1) ** 2)
    assert np.all(relative_errors(paints[:1], BETWEEN_FILMS) == 0)


@pytest.mark.slow
def test_a_clear_film_over_a_ground_that_nobody_told_is_no_answer(shelf):
    """An extender over a dark ground is as dark as any black paint: what is seen is the ground."""
    extender, seen_at = catalogue.load()["CalciumCarbonate"], Bidirectional(45.0, 0.0)
    black = read_film({"CalciumCarbonate": 1.0}, 1.0, np.full((1, GRID.size), 0.04), seen_at)
    seen = identify(GRID, black, [*shelf, extender], ground=0.5, instrument=seen_at, max_paints=2)
    for candidate in seen.ranked(0):
        hidden = candidate.probability == 0 or "ground" not in candidate.condition
        assert hidden or not set(candidate.paints) <= {"CalciumCarbonate", "BariumSulphate"}


def test_what_the_modes_leave_out_is_in_the_standard_deviations():
    """Modes and the rest make up what is stated; with what counts at most as the limit of both."""
    blue = flat_paint([[0.05, 0.05]], (0.13, 0.9))
    rest = relative_errors([blue], BETWEEN_FILMS)[0]
    held = error_modes([blue], BETWEEN_FILMS)[0]
    assert_allclose(rest[0], 0.12)
    assert_allclose(np.sqrt(rest**2 + np.sum(held**2, axis=-1))[1], BETWEEN_FILMS.most)
    # Modes that are larger than what is stated leave nothing.
    sure = flat_paint([[0.05, 0.05]], (0.01, 0.01))
    assert np.all(relative_errors([sure], BETWEEN_FILMS) == 0)


def test_error_modes_are_capped_and_resampled():
    blue = flat_paint([[0.1, -0.2], [3.0, 0.0]])
    capped = error_modes([blue], BETWEEN_FILMS)[0]
    assert np.sqrt((capped**2).sum(axis=-1)).max() == pytest.approx(BETWEEN_FILMS.most)
    between = blue.resample(np.array([450.0, 550.0])).error_modes
    assert between is not None
    assert between.shape == (2, 2, 2)
    with pytest.raises(ValueError, match="error_modes"):
        Pigment("Blue", [400.0, 500.0], [1.0, 1.0], [1.0, 1.0], error_modes=np.ones((2, 2, 3)))


def test_modes_of_the_catalogue_are_part_of_its_standard_deviations():
    """The largest modes hold most of the variance that is counted, and of no coefficient more than
    is stated.
    """
    held, stated = [], []
    for paint in catalogue.load().values():
        assert paint.error_modes is not None
        modes = np.asarray(paint.error_modes)
        held += [*np.sum(modes**2, axis=0)]
        for value, sd in (
            (paint.absorption, paint.absorption_sd),
            (paint.scattering, paint.scattering_sd),
        ):
            stated.append(np.minimum(np.asarray(sd) / np.asarray(value), 0.5) ** 2)
    assert np.all(np.array(held) < 1.01 * np.array(stated))
    assert 0.8 < np.sum(held) / np.sum(stated) < 0.99


def test_curve_of_none_is_better_than_one_of_todays_errors():
    """It is kept for that (see `log_odds_of_none`): what it finds of films without their paint, less
    what it takes for such, is more.
    """
    share = {name: entry["value"] for name, entry in read("truth")["values"].items()}
    kept = share["none_found"] - share["none_false"]
    assert kept > share["curve_found"] - share["curve_false"]
    assert np.all(np.diff(log_odds_of_none(np.array([0.5, 1.0, 2.0, 4.0]))) > 0)
