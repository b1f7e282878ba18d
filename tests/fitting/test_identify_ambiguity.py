"""What an answer leaves open and what it rests on, on made-up answers whose right words
are plain.
"""

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from glazefit import Noise
from glazefit.identify.result import STRENGTH, Identification, percent
from glazefit.identify.result.table import table_of
from glazefit.identify.search.searcher import check_spectra
from glazefit.identify.search.unstated_conditions import CONDITIONS
from glazefit.identify.show.ambiguity import (
    describe_additions,
    describe_ambiguity,
    describe_undecided,
    evidence_relied_on,
    possible_additions,
)
from glazefit.identify.show.terminal import print_identification

from .answers import made_up

GRID = np.arange(400.0, 701.0, 10.0)
PAINTS = ("ZincWhite", "LeadWhite", "CobaltBlue", "BariumSulphate", "Eosin", "Vermillion")
CURVE = np.linspace(0.3, 0.6, GRID.size)


def film(chance, condition=0, fitted=CURVE, /, **fractions):
    """A candidate by its probability, how it lies, what it reads, and the fraction of each paint."""
    return {paint: 25e-6 * part for paint, part in fractions.items()}, chance, condition, fitted


def answer(*candidates, covariance=0.04, grid=GRID) -> Identification:
    """An identification of one spectrum, the curve at these bands."""
    curve = np.interp(grid, GRID, CURVE)
    return made_up(
        check_spectra(grid, curve, 0.5, ["spot"], Noise()),
        PAINTS,
        [(amounts, chance) for amounts, chance, *_ in candidates],
        np.stack([fitted for *_, fitted in candidates])[None, :, None],
        log_covariance=np.broadcast_to(covariance * np.eye(3), (1, len(candidates), 3, 3)),
        condition=np.array([[condition for *_, condition, _ in candidates]]),
    )


def unexplained(found: Identification) -> Identification:
    return replace(found, none=np.array([0.9]))


def off_at(bands: slice, size: float) -> np.ndarray:
    curve = CURVE.copy()
    curve[bands] += size
    return curve


FIRST = film(0.8, CobaltBlue=1.0)
THINNED = film(0.1, CobaltBlue=0.9, BariumSulphate=0.1)


def text_of(found, top):
    console = Console(width=200, record=True, file=io.StringIO())
    print_identification(found, console, top=top)
    return console.export_text()


def test_what_the_film_may_hold_too_is_the_end_of_its_interval():
    found = answer(FIRST, THINNED)
    # Log odds of .1 with independent errors of both logs, .2 each, and of both paints' strength.
    odds = np.log(0.1 / 0.9) + 1.6448536 * np.sqrt(2 * (0.04 + STRENGTH**2))
    assert possible_additions(found, 0) == pytest.approx(
        {"BariumSulphate": 1 / (1 + np.exp(-odds))}, rel=1e-6
    )
    assert "It may also hold up to 22 % BariumSulphate." in describe_ambiguity(found, 0)


def test_of_many_paints_that_the_film_may_hold_too_the_first_are_named_and_the_others_counted():
    shares = {"LeadWhite": 0.3, "ZincWhite": 0.1, "Eosin": 3e-3, "Vermillion": 2e-3}
    beside = (film(0.03, CobaltBlue=1 - share, **{paint: share}) for paint, share in shares.items())
    found = answer(FIRST, *beside)
    (said,) = [words for words in describe_ambiguity(found, 0) if "hold" in words]
    most = [percent(most) for most in possible_additions(found, 0).values()]
    assert said == (
        f"It may also hold one more paint: up to {most[0]} LeadWhite, up to {most[1]} ZincWhite, "
        "a trace (below 1.0 %) of Eosin, or less of 1 other."
    )


@pytest.mark.parametrize(
    "other",
    [
        film(0.1, ZincWhite=0.9, BariumSulphate=0.1),  # without the first's paint
        film(1e-4, CobaltBlue=0.9, BariumSulphate=0.1),  # hardly possible
        film(0.1, 1, CobaltBlue=0.9, BariumSulphate=0.1),  # lies differently
        film(0.1, CobaltBlue=0.9999, BariumSulphate=0.0001),  # nothing to speak of
        film(0.1, CobaltBlue=0.8, BariumSulphate=0.1, ZincWhite=0.1),  # two more
    ],
)
def test_other_films_do_not_say_what_this_one_may_hold(other):
    assert possible_additions(answer(FIRST, other), 0) == {}


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        (1, "rests on the varnish: without a varnish it is CobaltBlue"),
        (3, "rests on the ground: as stated it is CobaltBlue"),
        (6, "rests on the ground: as stated it is CobaltBlue"),
    ],
)
def test_an_answer_that_rests_on_how_the_film_lies_says_so(condition, words):
    far = CURVE + 0.02
    found = answer(FIRST, film(0.15, condition, far, LeadWhite=1.0))
    (said,) = evidence_relied_on(found, 0)
    assert words in said
    assert f"{CONDITIONS[condition].words} it is LeadWhite (15%)" in said
    # Of the same pigment nothing rests on it; nor where the other is improbable.
    for chance, paint in ((0.15, "CobaltBlue"), (0.05, "LeadWhite")):
        other = film(chance, condition, far, **{paint: 1.0})
        assert evidence_relied_on(answer(FIRST, other), 0) == []


@pytest.mark.parametrize(
    ("bands", "words"),
    [
        (slice(-3, None), "last tenth of the spectrum (680-700 nm)"),
        (slice(0, 3), "first tenth of the spectrum (400-42"),
    ],
)
def test_an_answer_that_rests_on_an_end_of_the_spectrum_says_so(bands, words):
    # Elsewhere both fit alike; the other is off where only that end sees it.
    own = off_at(slice(10, 20), 0.004)
    other = own.copy()
    other[bands] += 0.03

    def relied_on():
        first, second = film(0.8, 0, own, CobaltBlue=1.0), film(0.1, 0, other, LeadWhite=1.0)
        return evidence_relied_on(answer(first, second), 0)

    (said,) = relied_on()
    assert words in said
    assert "elsewhere LeadWhite fits as well" in said
    # Off in the middle too: the answer does not rest on the end.
    other[12:15] += 0.03
    assert relied_on() == []


def test_two_names_of_one_pigment_are_no_doubt():
    first = film(0.8, 0, off_at(slice(10, 20), 0.004), CobaltBlue=1.0)
    second = film(0.1, 0, off_at(slice(-3, None), 0.03), CobaltBlue=1.0)
    assert evidence_relied_on(answer(first, second), 0) == []


def test_what_nothing_explains_has_no_such_doubts():
    found = unexplained(answer(FIRST, THINNED))
    assert not any("may also hold" in words for words in describe_ambiguity(found, 0))


def test_what_the_headline_settled_is_not_called_open():
    """Two paints of one pigment share it, and what is missing to one is that nothing explains the
    film.
    """
    found = answer(
        film(0.5, Vermillion=1.0),
        film(0.2, Vermillion=0.9, Eosin=0.1),
        film(0.2, Vermillion=0.9, LeadWhite=0.1),
    )
    assert describe_undecided(found, 0) == (
        "Not settled by this spectrum: LeadWhite (22%), Eosin (22%)."
    )
    two = replace(found, paints=(*PAINTS[:-1], "Eosin1Wax"))
    # Vermillion's place is now Eosin1Wax's: a film of that, or of both, is of eosin.
    assert describe_undecided(two, 0) == "Not settled by this spectrum: LeadWhite (22%)."
    # What nothing explains has no headline, and all of it is open.
    assert "Vermillion (90%)" in describe_undecided(unexplained(found), 0)


def test_shares_that_no_reading_tells_are_not_said():
    trace = film(0.8, LeadWhite=0.9998, CobaltBlue=0.0002)
    weak = film(0.1, LeadWhite=0.992, CobaltBlue=0.008)
    most = film(0.1, LeadWhite=0.002, CobaltBlue=0.0001, Eosin=0.9979)
    found = answer(trace, weak, most, covariance=4.0)
    assert [candidate.words for candidate in found.ranked(0)] == [
        "LeadWhite + a trace of CobaltBlue",
        "99.2 % LeadWhite + 0.8 % CobaltBlue",
        "99.8 % Eosin + 0.2 % LeadWhite + a trace of CobaltBlue",
    ]
    assert "any amount of Eosin" in describe_additions(found, 0)


@pytest.mark.parametrize(
    ("fractions", "coats", "condition", "words"),
    [
        ([1.0], (0,), 0, "ZincWhite"),
        ([1.0], (0,), 3, "ZincWhite, over a light ground"),
        ([0.9, 0.1], (0, 0), 0, "90 % ZincWhite + 10 % LeadWhite"),
        ([0.955, 0.045], (0, 0), 0, "95.5 % ZincWhite + 4.5 % LeadWhite"),
        ([0.9955, 0.0045], (0, 0), 0, "99.6 % ZincWhite + 0.4 % LeadWhite"),
        ([0.3, 0.7], (0, 1), 0, "30 % ZincWhite over 70 % LeadWhite"),
        (
            [0.3, 0.2, 0.5],
            (0, 0, 1),
            1,
            "(30 % ZincWhite + 20 % LeadWhite) over 50 % CobaltBlue, under a yellowed varnish",
        ),
    ],
)
def test_words_of_an_explanation(fractions, coats, condition, words):
    found = answer(film(0.9, condition, **dict(zip(PAINTS, fractions, strict=False))))
    laid = np.zeros_like(found.coats)
    laid[0, 0, : len(coats)] = coats
    (candidate,) = replace(found, coats=laid).ranked(0)
    assert candidate.words == words
    assert candidate.mixture == words.partition(", ")[0]


# ---- headlines -----------------------------------------------------------------------------------


def test_the_headline_names_what_is_probable_over_all_sets():
    """Lead white is in three sets of .2 each; the most probable set is without it."""
    found = answer(
        film(0.25, CobaltBlue=1.0),
        film(0.2, LeadWhite=1.0),
        film(0.2, LeadWhite=0.9, BariumSulphate=0.1),
        film(0.2, LeadWhite=0.8, ZincWhite=0.2),
    )
    assert found.likely_paint(0) == ("LeadWhite", pytest.approx(0.6))
    assert found.words(0).startswith(
        "spot: most probably with LeadWhite (60%), but its companion is"
    )
    assert "CobaltBlue (25%), is without it" in found.words(0)
    assert "Most probably with LeadWhite (60%)" in text_of(found, 4)


def test_a_set_that_holds_the_most_probable_paint_is_the_headline():
    found = answer(FIRST)
    assert found.likely_paint(0) is None
    assert found.words(0).startswith("spot: CobaltBlue (probability 80%")


def test_what_is_not_explained_names_the_film_that_is_nearest():
    found = answer(
        film(0.05, 0, CURVE + 0.2, CobaltBlue=1.0), film(0.03, 0, CURVE + 0.03, LeadWhite=1.0)
    )
    first, second = found.ranked(0)
    assert second.delta_e < first.delta_e
    assert f"LeadWhite, has an error of Delta E00 {second.delta_e:.1f}" in found.words(0)


def test_what_is_not_explained_and_has_no_colour_says_how_far_it_is_off():
    curve = CURVE[::5]
    blue = film(0.05, 0, curve + 0.2, CobaltBlue=1.0)
    found = answer(blue, film(0.03, 0, curve + 0.03, LeadWhite=1.0), grid=GRID[::5])
    assert np.isnan(found.delta_e).all()
    assert "LeadWhite, has an error of 0.030 in reflectance (RMSE)" in found.words(0)


def test_a_film_that_hides_its_ground_has_no_thickness_in_the_table():
    found = replace(answer(FIRST), amounts=np.full((1, 1, 3), np.nan))
    assert "nan" not in text_of(found, 1)


def test_the_table_says_how_each_film_lies():
    """Films that differ in that alone were one line twice, and an unknown thickness was `nan`."""
    hiding = next(n for n, condition in enumerate(CONDITIONS) if condition.opaque)
    lying = [film(0.1, condition, CobaltBlue=1.0) for condition in (1, hiding)]
    titles, rows = table_of(answer(FIRST, *lying))
    stated, varnished, hidden = (dict(zip(titles, row, strict=True)) for row in rows)
    assert stated["condition"] == ""
    assert varnished["condition"] == "under a yellowed varnish"
    assert hidden["condition"] == "hiding its ground"
    assert varnished["thickness_um"] == pytest.approx(25.0)
    assert hidden["thickness_um"] is hidden["thickness_sd_um"] is None
    # Where one coat alone was tried, more are not improbable.
    assert stated["coats_probability"] is None


@pytest.mark.parametrize(
    ("fraction", "words"),
    [(1.0, "100 %"), (0.0, "0 %"), (0.9997, "> 99.9 %"), (0.0003, "< 0.1 %"), (0.5, "50 %")],
)
def test_parts_of_a_whole_are_said_as_parts(fraction, words):
    assert percent(fraction) == words
