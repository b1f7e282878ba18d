"""Families of pigments in anybody's paint: features, the metric, templates, odds, and what is said
of them.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from benchmarks.paintbench.sources import read_source
from hypothesis import given
from hypothesis import strategies as st

from glazefit import identify
from glazefit.film.model.response import film_response
from glazefit.film.model.varnish import under_varnish
from glazefit.identify.families import (
    calibration,
    evidence,
    features,
    metric,
    naming,
    set_up,
    templates,
)
from glazefit.identify.families.expected import has_families
from glazefit.identify.families.sureness import WORTHLESS, Sureness
from glazefit.identify.families.varnish import CONDITIONS
from glazefit.identify.result.groups import COLOURLESS, GROUPS, group_of
from glazefit.identify.search.options import IdentificationOptions
from glazejax import Pigment, catalogue, colour, stack_reflectance_factor

from ..refusals import refusal

GRID = np.arange(420.0, 691.0, 10.0)
VISIBLE = np.arange(400.0, 701.0, 10.0)
WIDE = np.arange(380.0, 731.0, 10.0)
identify_hidden = partial(identify, opaque=True, instrument="45:0")


@pytest.fixture(scope="module")
def others(shelf):
    """Exemplars of all sources but hyperdoc's."""
    return [paint for paint in shelf if paint.source != "hyperdoc"]


@pytest.fixture(scope="module")
def few(others):
    """Of three families."""
    return [paint for paint in others if paint.family in ("malachite", "azurite", "vermilion")]


@pytest.fixture(scope="module")
def mockups(shared_data):
    source = read_source(shared_data / "hyperdoc")
    camera = source.cameras[0]
    return source, camera.wavelengths, np.clip(camera.readings, 0.0, 1.0)


@pytest.fixture(scope="module")
def find(mockups, others):
    """What identifies some rows of the mock-ups."""
    _, wavelengths, readings = mockups

    def find(rows, **options):
        return identify_hidden(wavelengths, readings[rows], others, **options)

    return find


def rows_of(source, family):
    return [
        row
        for row in source.chosen("pure")
        if source.families(source.samples[row]) == (family,)
        and source.samples[row].binder == "Gum arabic"
    ]


# ---- parts ---------------------------------------------------------------------------------------


@given(st.floats(0.3, 1.0), st.integers(0, 2**32 - 1))
def test_slopes_of_absorbance_do_not_see_a_factor(factor, seed):
    reading = np.random.default_rng(seed).uniform(0.1, 0.9, GRID.size)
    steps = GRID.size - 1
    one = features.features(GRID, reading)
    other = features.features(GRID, factor * reading)
    assert other[:steps] == pytest.approx(one[:steps], abs=1e-9)
    assert other[-1] - one[-1] == pytest.approx(-np.log(factor), abs=1e-9)


@given(st.floats(0.3, 3.0), st.integers(0, 2**32 - 1))
def test_a_thinner_coat_keeps_its_shape(thickness, seed):
    """-log R of a coat without scattering over white is in proportion to its thickness."""
    absorbance = np.random.default_rng(seed).uniform(0.1, 1.4, GRID.size)
    steps = GRID.size - 1
    one = features.features(GRID, np.exp(-absorbance))
    other = features.features(GRID, np.exp(-thickness * absorbance))
    assert other[:steps] == pytest.approx(thickness * one[:steps], abs=1e-9)
    shape = slice(2 * steps, 3 * steps)
    assert other[shape] == pytest.approx(one[shape], abs=0.02)
    assert np.sum(other[shape] ** 2) == pytest.approx(1.0, abs=0.1)


@given(st.floats(0.0, 0.04), st.floats(0.001, 0.01), st.integers(0, 2**32 - 1))
def test_gloss_of_a_dark_paint_is_not_seen_in_the_second_view(gloss, darkest, seed):
    body = darkest + 0.3 * np.random.default_rng(seed).uniform(0.0, 1.0, GRID.size)
    body[0] = darkest
    read, plain = features.views(GRID, body + gloss)[1], features.views(GRID, body)[1]
    assert read == pytest.approx(plain, abs=1e-9)
    one, other = features.colours(GRID, body[None] + gloss), features.colours(GRID, body[None])
    assert one == pytest.approx(other, abs=1e-4)


def test_colours_are_those_of_cie94_from_grey():
    """From a grey, CIE94's difference of chroma is a chroma: its integral is compressed here."""
    bodies = np.stack([np.full(GRID.size, 0.3), np.where(GRID > 580.0, 0.33, 0.29)])
    read = features.colours(GRID, bodies)
    assert read is not None
    grey, pink = read
    plain = features.with_one_gloss(np.where(VISIBLE > 580.0, 0.33, 0.29))
    chroma = np.hypot(*colour.lab(VISIBLE, plain)[1:])
    assert np.hypot(*pink[1:]) == pytest.approx(chroma / (1 + 0.0225 * chroma), rel=0.05)
    assert np.hypot(*grey[1:]) < 0.2
    assert features.colours(np.arange(900.0, 1701.0, 10.0), np.full((1, 81), 0.5)) is None


def test_no_slope_reaches_over_a_gap():
    grid = np.array([400.0, 410.0, 420.0, 600.0, 610.0, 620.0])
    reading = np.array([0.2, 0.3, 0.4, 0.9, 0.8, 0.7])
    found = features.features(grid, reading)
    assert found.size == 4 * 4 + 1
    assert found[:4] == pytest.approx(-np.diff(np.log(reading))[[0, 1, 3, 4]])


def test_the_metric_finds_the_covariance_within_families():
    rng = np.random.default_rng(3)
    spread = np.array([3.0, 1.0, 0.2])
    middles = rng.normal(0.0, 20.0, (40, 3))
    families = np.repeat(np.arange(40), 6)
    points = middles[families] + spread * rng.standard_normal((240, 3))
    found = metric.learn_metric(points, families, points[:0], 25)
    # Distances within families are alike along all axes once they are whitened.
    white = found.place(points)
    apart = white - np.repeat([white[families == f].mean(axis=0) for f in range(40)], 6, 0)
    assert np.std(apart, axis=0) == pytest.approx(np.full(3, np.std(apart)), rel=0.3)
    same = found.log_evidence(white[:1], metric.as_columns(white[1:2]))[0, 0]
    far = found.log_evidence(white[:1], metric.as_columns(white[-1:]))[0, 0]
    assert same > far


def test_a_metric_needs_two_paints_of_a_family():
    points = np.random.default_rng(0).normal(size=(4, 3))
    with refusal("give more exemplars"):
        metric.learn_metric(points, np.arange(4), points[:0], 25)


def test_thick_films_are_those_of_the_solver():
    ratio = np.geomspace(1e-4, 30.0, 9)
    found = templates.hiding_body(film_response("45:0"), ratio[None])[0]
    expected = stack_reflectance_factor(
        (1.0 / (1.0 + ratio))[:, None],
        np.full((9, 1), 1e5),
        0.0,
        cos_incidence=0.5**0.5,
        tolerance=1e-6,
    )
    # The table of films ends at a scattering thickness of 1000, where white still gains a little.
    assert found == pytest.approx(np.asarray(expected), abs=2e-3)


def test_a_mixture_of_one_paint_with_itself_is_that_paint(shelf):
    two = [paint for paint in shelf if paint.family == "azurite" and paint.source == "hyppigments"]
    known = templates.coefficients(two[:2], GRID)
    same = known[:, [0, 0]]
    response = film_response("45:0")
    pure = templates.pure_templates(same, response, None)
    mixed = templates.mixed_templates(same, np.array([0, 1]), np.zeros((2, 3)), response, None)
    thick = pure.readings[np.isinf(pure.thickness)][0]
    for reading in mixed.readings:
        assert reading == pytest.approx(thick, abs=1e-6)
    assert mixed.fractions.sum(axis=1) == pytest.approx(1.0)


def test_exemplars_that_do_not_know_a_band_are_missing_there(shelf):
    oils = [paint for paint in shelf if paint.source == "revigo"][:3]
    known = templates.coefficients(oils, np.array([650.0, 690.0, 720.0]))
    assert np.isfinite(known[..., :2]).all()
    assert np.isnan(known[..., 2]).all()


# ---- odds ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found_search(others):
    return set_up.search_families(GRID, others, IdentificationOptions(instrument="45:0"))


@pytest.mark.parametrize("instrument", ["d:8", "de:8", "45:0"])
def test_a_black_is_a_black_whatever_the_instrument(others, instrument):
    """A flat .0092 cannot be read by d:8 from a smooth surface, which reflects .04 by itself."""
    blacks = np.array([0.0092, 0.02, 0.045])[:, None] * np.ones(WIDE.size)
    found = identify_hidden(WIDE, blacks, others, instrument=instrument)
    for sets in found.family_sets:
        assert "a black" in sets[0].families
    expected = 0.0092 / 0.04 if instrument == "d:8" else 1.0
    assert found.gloss[0, 0] == pytest.approx(expected, rel=0.02)


def test_a_teal_is_no_white(others):
    """An edge of rutile between 380 and 410 nm once outweighed all other bands."""
    body = 0.75 - 0.4 / (1.0 + np.exp(-(WIDE - 590.0) / 15.0))
    found = identify_hidden(WIDE, body * np.clip((WIDE - 370.0) / 45.0, 0.1, 1.0), others)
    whites = {"a white", *GROUPS["a white"]}
    assert not found.explained[0] or set(found.family_sets[0][0].families) - whites


@pytest.fixture(scope="module")
def search(shelf):
    """Of all sources, for one paint."""
    return set_up.search_families(GRID, shelf, IdentificationOptions(max_paints=1))


def made_of(search, families):
    """Which of the films that are compared are of these families alone."""
    chosen = np.append(np.isin(search.families, families), True)
    return chosen[search.members[search.set_of]].all(axis=1)


def test_a_light_grey_is_no_black(search):
    """A zinc white over black had the slopes of a thin coat of a warm black over white."""
    blacks = made_of(search, GROUPS["a black"])
    light = blacks & (np.asarray(search.colours)[:, 0] > 50.0)
    assert light.any()
    possible = search._possible(search.templates.readings[light])
    assert not possible[:, blacks].any()
    assert possible.any(axis=1).all()


def test_a_yellow_is_no_extender(search, shelf):
    """Barium sulphate was read in a yellowed oil: its films that hide have a chroma of 32."""
    templates = search.templates
    extender = shelf[[paint.name for paint in shelf].index("barium sulphate/revigo-BariumSulphate")]
    body = templates.readings[templates.members[:, 0] == search.exemplars.index(extender)]
    lightness, red, yellow = colour.lab(GRID, body[0])
    assert lightness > 85.0
    assert np.hypot(red, yellow) > 30.0
    possible = search._possible(body[:1])
    assert not possible[:, made_of(search, [*COLOURLESS])].any()
    assert possible.any()


@pytest.mark.parametrize("instrument", ["45:0", "d:8"])
def test_the_film_of_an_answer_has_the_gloss_of_its_reading(found_search, others, instrument):
    """A matte surface reflects more to 45:0 than films are computed with: that is no other
    colour.
    """
    bodies = found_search.templates.readings
    dark = bodies[bodies.min(axis=1) < 0.015][::997]
    assert len(dark) > 3
    matte = 0.03 + 0.97 * dark
    found = identify_hidden(GRID, matte, others, instrument=instrument)
    compared = GRID >= 415.0
    darkest = found.fitted[:, 0, 0, compared].min(axis=1)
    assert darkest == pytest.approx(matte[:, compared].min(axis=1), abs=1e-6)


def test_probabilities_are_probabilities(found_search):
    readings = np.random.default_rng(0).uniform(0.05, 0.9, (7, GRID.size))
    odds = found_search.odds(readings)
    assert odds.sets.sum(axis=1) + odds.none == pytest.approx(np.ones(7))
    assert (odds.sets >= 0).all()
    assert ((odds.fraction >= 0) & (odds.fraction <= 1)).all()


def test_a_hidden_family_is_in_no_answer(found_search):
    films = found_search.templates
    whole = np.interp(GRID, found_search.grid, films.readings[0])[None]
    family = found_search.family_of[films.members[0, 0]]
    hidden = np.zeros((1, len(found_search.families)), bool)
    hidden[0, family] = True
    odds = found_search.odds(whole, hidden=hidden)
    with_it = (found_search.members == family).any(axis=1)
    assert odds.sets[0, with_it].max() == 0.0
    assert odds.none[0] > found_search.odds(whole).none[0]


def test_exemplars_of_a_source_that_is_left_out_are_not_compared(found_search):
    readings, rows = calibration.exemplars_as_readings(found_search)
    own = found_search.source_of[rows[:5]]
    _, seen, _ = found_search.compare(readings[:5], own)
    of_members = np.append(found_search.source_of, -1)[found_search.templates.members]
    for row, source in enumerate(own):
        assert np.isneginf(seen[row, (of_members == source).any(axis=1)]).all()


def test_power_and_sharpness_undo_what_is_too_sure():
    """Evidence that was made three times too strong comes out three times weaker."""
    rng = np.random.default_rng(5)
    truth = rng.integers(0, 4, 4000)
    right = np.eye(4, dtype=bool)[truth]
    honest = rng.normal(0.0, 1.0, (4000, 4)) + 2.0 * right
    # Two normal densities one apart by two: the log of their ratio is two times the reading.
    log_sets = {1.0: 3.0 * 2.0 * honest, 0.33: 2.0 * honest}
    found = calibration.learn_power(log_sets, np.zeros(4), right, np.ones(4000))
    assert found.power == 0.33
    assert found.sharpness == 1.0
    stated = found.share(log_sets[0.33], np.zeros(4)).max(axis=1)
    first = log_sets[0.33].argmax(axis=1) == truth
    assert stated.mean() == pytest.approx(first.mean(), abs=0.02)


def learn_none(seed, *, taken_off):
    """Log evidence of known paints, and what is learnt of it and of foreign ones': two normal
    densities 1 apart, less so much of what any paint's density holds.
    """
    rng = np.random.default_rng(seed)
    fits = rng.normal([[1.0], [0.0]], 1.0, (2, 20000))
    usual = rng.normal(-20.0, 3.0, fits.shape)
    paint, foreign = np.stack([fits - taken_off * usual, usual], axis=-1)
    weights = np.ones(20000)
    return fits[0], calibration.learn_none(paint, foreign, (weights, weights))


def test_none_is_stated_as_often_as_it_is_true():
    """The log odds are a line of slope 1 through the middle."""
    known, (slopes, intercept, least) = learn_none(6, taken_off=0.0)
    assert slopes == pytest.approx((1.0, 0.0), abs=0.05)
    assert np.mean(known < least) == pytest.approx(calibration.FALSE_ALARMS, abs=1e-3)
    sure = Sureness(slopes=slopes, intercept=intercept)
    for chance in (0.5, 0.1):
        none = sure.none(np.array([[0.5]]), np.array([-20.0]), chance)
        assert none[0] == pytest.approx(chance, abs=0.02)


def test_an_unusual_reading_owes_its_evidence_to_how_unusual_it_is():
    """What a term of any paint's density adds is taken off again."""
    slopes = learn_none(7, taken_off=1.0)[1][0]
    assert slopes == pytest.approx((1.0, 1.0), abs=0.05)


def test_evidence_is_sometimes_worthless():
    shares = Sureness().share(np.array([[500.0, 0.0, -np.inf]]), np.log([0.2, 0.2, 0.6]))
    assert shares.sum() == pytest.approx(1.0)
    assert shares[0, 1] == pytest.approx(WORTHLESS / 2)
    assert shares[0, 2] == 0.0


def test_something_is_left_for_the_nearest_set():
    """However improbable all are; 1 - 1e-17 is 1."""
    none = Sureness().none(np.array([[-900.0, -950.0]]), np.zeros(1), 0.1)[0]
    assert 1.0 - 1e-8 < none < 1.0


def test_few_known_exemplars_are_refused(found_search):
    """Of sources that leave most of the exemplars, each sought without its own."""
    readings, rows = calibration.exemplars_as_readings(found_search)
    own = found_search.source_of[rows]
    alike = found_search.family_of == found_search.family_of[rows, None]
    left = found_search.source_of != own[:, None]
    shared = (alike & left).any(axis=1) & (left.mean(axis=1) > 0.5)
    odds = found_search.odds(readings[shared], sources=own[shared])
    assert 0 < odds.unlike.mean() < 0.15


def test_exemplars_of_one_source_teach_no_sureness(shelf):
    own = [paint for paint in shelf if paint.source == "hyppigments"]
    found = set_up.search_families(GRID, own, IdentificationOptions(max_paints=1))
    assert found.sureness == calibration._UNTAUGHT
    odds = found.odds(calibration.exemplars_as_readings(found)[0][:3])
    assert np.isfinite(odds.sets).all()


def colours_of(found):
    return [name for name in found.families(0)[0][0] if name not in COLOURLESS]


@pytest.mark.parametrize(
    "family", ["azurite", "vermilion", "malachite", "red ochre", "burnt umber", "minium"]
)
def test_mockups_of_another_hand_are_named(mockups, find, family):
    """Gum arabic on paper, by another laboratory than all exemplars: the oils alone named none."""
    found = find(rows_of(mockups[0], family)[:1])
    assert colours_of(found) in ([family], [group_of(family)])
    assert found.explained[0]
    assert found.ranked(0, 1)[0].paints[0] in found.paints


def test_a_colour_in_white_is_named_by_its_colour(mockups, find):
    source = mockups[0]
    row = [sample.name for sample in source.samples].index("16A")
    assert source.families(source.samples[row]) == ("azurite", "lead white")
    found = find([row])
    assert colours_of(found) == ["azurite"]
    two = next(candidate for candidate in found.ranked(0) if len(candidate.paints) == 2)
    assert sum(two.fractions) == pytest.approx(1.0)
    assert (two.fractions_90[:, 0] <= two.fractions).all()
    assert (two.fractions <= two.fractions_90[:, 1]).all()


@pytest.mark.slow
def test_a_coat_over_a_ground_is_named_too(others):
    paint = next(p for p in others if p.name == "azurite/hyppigments-10200")
    known = templates.coefficients([paint], GRID)
    thin = templates.pure_templates(known, film_response("45:0"), np.full(GRID.size, 0.85))
    found = identify(GRID, thin.readings[2:4], others, ground=0.85, instrument="45:0")
    for row in range(2):
        assert found.families(row)[0][0] == ("azurite",)
        assert 0 < found.ranked(row, 1)[0].thickness < 1e-3


def test_films_over_different_grounds_keep_their_order(mockups, few):
    source, wavelengths, readings = mockups
    bands = (wavelengths >= 420.0) & (wavelengths <= 690.0) & (wavelengths % 10 == 0)
    rows = rows_of(source, "malachite") + rows_of(source, "azurite")[:1]
    grounds = np.array([0.8, 0.3])

    def sought(chosen):
        return identify(
            wavelengths[bands],
            readings[rows][chosen][:, bands],
            few,
            ground=grounds[chosen][:, None, None] * np.ones(bands.sum()),
            instrument="45:0",
            names=[str(number) for number in chosen],
        )

    both = sought([0, 1])
    assert both.measured.names == ("0", "1")
    assert both.measured.grounds[:, 0, 0] == pytest.approx(grounds)
    for row in range(2):
        alone = sought([row])
        assert both.families(row)[0][0] == alone.families(0)[0][0]
        assert both.none[row] == pytest.approx(alone.none[0], abs=0.05)


def test_answers_do_not_depend_on_what_was_searched_before(few, monkeypatch):
    """How sure a search may be once came from the first one, over whatever ground that was."""
    grounds = np.array([0.3, 0.9])
    reading = np.interp(GRID, [420.0, 480.0, 560.0, 620.0, 690.0], [0.25, 0.3, 0.15, 0.1, 0.2])

    def chances(rows, *, hidden_before):
        monkeypatch.setattr(set_up, "_SEARCHES", {})
        if hidden_before:
            identify(GRID, reading, few, opaque=True, max_paints=1)
        below = grounds[rows][:, None, None] * np.ones(GRID.size)
        spectra = np.tile(reading, (2, 1, 1))
        return identify(GRID, spectra, few, ground=below, max_paints=1).none

    first = chances([0, 1], hidden_before=False)
    assert first[0] != first[1]
    assert chances([1, 0], hidden_before=True)[::-1] == pytest.approx(first, rel=1e-9, abs=0.0)


def test_the_thickness_of_a_film_is_that_which_its_spectrum_was_computed_with(few):
    """It was stated in coats of another usual thickness than films are computed in."""
    ground = np.full(GRID.size, 0.85)
    options: dict = {"instrument": "45:0", "max_paints": 1}
    films = set_up.prepare_search(GRID, few, IdentificationOptions(**options), ground).templates
    row = int(np.flatnonzero(films.thickness == 1.2)[0])
    best = identify(GRID, films.readings[row], few, ground=ground, **options).ranked(0, 1)[0]
    paint = few[films.members[row, 0]]
    assert best.paints == (paint.name,)
    absorption, scattering = best.thickness * templates.coefficients([paint], GRID)
    body = templates.coat_body(film_response("45:0"), absorption, scattering, ground)
    assert body[0] == pytest.approx(films.readings[row], rel=1e-5)


# ---- varnish -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_paints_under_a_varnish_are_named_where_it_is_stated(mockups, others):
    """All pure mock-ups, under a yellow varnish that no setting was learnt from."""
    source, wavelengths, readings = mockups
    known = {paint.family for paint in others}
    rows = [
        row
        for row in source.chosen("pure")
        if source.clear(source.samples[row]) and source.families(source.samples[row])[0] in known
    ]
    thickness = 0.7 * np.exp((400.0 - wavelengths) / 75.0)
    seen = under_varnish(film_response("45:0"), readings[rows], thickness)

    def count_right(varnish):
        found = identify_hidden(wavelengths, seen, others, varnish=varnish)
        return sum(
            group_of(source.families(source.samples[row])[0])
            in map(group_of, found.families(number)[0][0])
            for number, row in enumerate(rows)
        )

    # Of 37 paints, of which 35 are named without the varnish. Where it is not stated 23 are (27
    # before families were as common as their pigments, which named more clear films of all sources).
    assert count_right("yellowed") >= 30 > count_right(None)
    assert count_right("unknown") >= 30


def test_varnishes_are_covers_of_their_expected_amount():
    response = film_response("45:0")
    body = np.full((400, GRID.size), 0.5)
    conditions: Any = CONDITIONS
    thin = conditions["thin"]
    random = under_varnish(response, body, thin.at_random(GRID, len(body)))
    expected = under_varnish(response, body, thin.expected(GRID))
    assert np.mean(random, axis=0) == pytest.approx(expected[0], abs=0.04)
    assert (random <= 0.5 + 1e-9).all()
    # Some are none at all, and none shines.
    assert random[:, 0].std() > 0.03
    assert conditions["none"] is None
    assert conditions["unknown"].expected(np.array([400.0])).item() == pytest.approx(0.16)


# ---- names ---------------------------------------------------------------------------------------


def test_a_group_is_named_where_no_family_has_most_of_it(found_search):
    sets = np.zeros(len(found_search.members))

    def place(*families):
        numbers = sorted(found_search.families.index(family) for family in families)
        padded = [*numbers, -1][:2]
        return int(np.flatnonzero((found_search.members == padded).all(axis=1))[0])

    sets[place("azurite", "lead white")] = 0.3
    sets[place("azurite", "zinc white")] = 0.3
    sets[place("azurite")] = 0.2
    sets[place("malachite")] = 0.1
    first, second = naming.name_sets(found_search, sets)
    # The white that is most probable beside it is named; the probability is azurite's.
    assert first.families == ("azurite", "a white")
    assert first.probability == pytest.approx(0.8)
    assert dict(first.within["a white"]) == pytest.approx({"lead white": 0.5, "zinc white": 0.5})
    assert second.families == ("malachite",)
    assert "lead white 50%" in first.words
    sets[place("azurite", "zinc white")] = 0.05
    assert naming.name_sets(found_search, sets)[0].families == ("azurite", "lead white")
    sets[place("azurite")] = 0.5
    assert naming.name_sets(found_search, sets)[0].families == ("azurite",)
    # Without a colour, whites alone and a white with a black are different answers.
    sets[:] = 0.0
    sets[place("lead white")] = 0.4
    sets[place("carbon black", "lead white")] = 0.5
    sets[place("chalk", "zinc white")] = 0.1
    found = {answer.families: answer.probability for answer in naming.name_sets(found_search, sets)}
    assert found[("a black", "lead white")] == pytest.approx(0.5)
    assert sum(found.values()) == pytest.approx(1.0)
    assert len(found) == 2


def test_every_family_of_a_group_is_known():
    assert set().union(*GROUPS.values()) <= set(catalogue.families())


# ---- elements and years --------------------------------------------------------------------------


def test_elements_weigh_and_rule_nothing_out():
    known = catalogue.families()
    sets = [[known["azurite"]], [known["ultramarine"]], [known["smalt"]]]
    with_copper = evidence.log_odds_of_elements(sets, ["Cu"], [])
    assert with_copper[0] > with_copper[1] == with_copper[2]
    without = evidence.log_odds_of_elements(sets, [], ["Co"])
    assert without[2] < without[0] == without[1]
    # Aluminium is too light for fluorescence in air to tell.
    assert evidence.log_odds_of_elements(sets, ["Al"], ["Si"]) == pytest.approx(np.zeros(3))
    assert np.isfinite(with_copper).all()


def test_facts_say_nothing_of_a_family_that_the_catalogue_does_not_have(found_search):
    (unknown,) = found_search.sets[0]
    names = ["lake of my own" if name == unknown else name for name in found_search.families]
    search = replace(found_search, families=tuple(names))
    facts = IdentificationOptions(elements=("Cu",), without_elements=("Co",), painted=1620)
    told = search.with_facts(facts)
    assert told.log_prior[0] == pytest.approx(search.log_prior[0])
    known = [n for n, families in enumerate(search.sets) if "lake of my own" not in families]
    assert not np.allclose(told.log_prior[known], search.log_prior[known])


def test_an_element_is_found_or_not():
    with refusal("Cu is said to be found and not to be found"):
        evidence.log_odds_of_elements([], ["Cu"], ["Cu"])


def test_the_year_and_the_elements_move_the_headline(mockups, find):
    rows = rows_of(mockups[0], "vermilion")

    def chance(found, family):
        return sum(p for names, p in found.families(0) if family in names)

    plain = find(rows)
    told = find(rows, elements=("Hg",), painted=1620)
    assert chance(told, "vermilion") > chance(plain, "vermilion")
    for late in ("cadmium red", "azo red"):
        assert chance(told, late) <= chance(plain, late)
    known = catalogue.families()
    sets = [[known["vermilion"]], [known["cadmium red"]], [known["cadmium red"], known["azo red"]]]
    # Cadmium red is of 1910, azo reds of 1912: each costs a factor of fifty.
    odds = np.exp(evidence.log_odds_of_year(sets, 1620))
    assert odds == pytest.approx([1.0, 1 / 50, 1 / 2500])


def test_anachronisms_are_said():
    words = evidence.describe_anachronism(["Prussian blue", "a white", "azurite"], 1620)
    assert words == "not of 1620: Prussian blue was in use 1704-"
    assert not evidence.describe_anachronism(["azurite"], 1620)
    assert "smalt" in evidence.describe_anachronism(["smalt"], 1950)
    # Of lapis lazuli long before it was made: no spectrum tells one from the other.
    assert not evidence.describe_anachronism(["ultramarine"], 1100)
    assert "lapis lazuli" in evidence.describe_anachronism(["ultramarine"], -100)


# ---- what cannot be asked ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(varnish="old"), "varnish is 'old'; say one of none, thin, yellowed"),
        (dict(elements=("Xx",)), "there is no element 'Xx'"),
        (dict(wavelengths=np.linspace(3e3, 3.1e3, GRID.size)), "no three bands lie there"),
        (
            dict(wavelengths=np.linspace(900.0, 1700.0, GRID.size)),
            "too little is known there: .* give readings",
        ),
        (
            dict(wavelengths=np.linspace(1000.0, 1700.0, GRID.size)),
            "the spectra begin at 1000 nm, and no answer without the visible",
        ),
        (
            dict(
                spectra=np.full((1, 2, GRID.size), 0.5),
                opaque=False,
                ground=np.full((2, GRID.size), 0.5),
            ),
            "by one reading of a film, not 2",
        ),
    ],
)
def test_what_cannot_be_asked_is_said(others, change, words):
    asked = {"wavelengths": GRID, "spectra": np.full(GRID.size, 0.5), "opaque": True, **change}
    with refusal(words):
        identify(pigments=others, **asked)


def test_too_few_exemplars_are_said(others):
    few = [paint for paint in others if paint.family == "azurite"][:3]
    with refusal("3 exemplars have the spectra's bands, too few"):
        identify_hidden(GRID, np.full(GRID.size, 0.5), few)


@pytest.mark.slow
def test_the_narrow_model_is_kept_for_own_films(shelf):
    oils = [paint for paint in shelf if paint.source == "revigo"][:4]
    find = partial(identify, VISIBLE, np.full(VISIBLE.size, 0.4), ground=0.9, max_paints=1)
    assert not find(oils, own_films=True).family_sets
    with refusal(r"use catalogue\.load"):
        find(catalogue.load("oils"), painted=1700)


def test_paints_without_a_family_are_sought_as_paints():
    assert not has_families(list(catalogue.load("oils").values()))
    paint = Pigment("mine", GRID, np.ones(GRID.size), np.ones(GRID.size))
    assert not has_families([paint])
    assert has_families([paint.renamed("x", family="smalt", source="me")])


def test_identifications_by_family_are_joined_and_printed(mockups, find):
    found = find(rows_of(mockups[0], "azurite")[:2], names=["a", "b"])
    both = type(found).join([found, found])
    assert len(both.family_sets) == 4
    assert "azurite" in found.words(0)
    assert "nearest exemplar" in found.words(0)
