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


def answer(candidates, covariance=0.04) -> Identification:
    """An identification of one spectrum from (paints, fractions, probability, condition,
    fitted).
    """
    sets = [
        (paints, np.asarray(fractions) * 25e-6, chance)
        for paints, fractions, chance, *_ in candidates
    ]
    return made_up(
        check_spectra(GRID, CURVE, 0.5, ["spot"], Noise()),
        PAINTS,
        sets,
        np.stack([c[4] for c in candidates])[None, :, None],
        log_covariance=np.broadcast_to(covariance * np.eye(3), (1, len(sets), 3, 3)),
        condition=np.array([[c[3] for c in candidates]]),
    )


def off_at(bands: slice, size: float) -> np.ndarray:
    curve = CURVE.copy()
    curve[bands] += size
    return curve


FIRST = (("CobaltBlue",), [1.0], 0.8, 0, CURVE)
THINNED = (("CobaltBlue", "BariumSulphate"), [0.9, 0.1], 0.1, 0, CURVE)


def text_of(found, top):
    console = Console(width=200, record=True, file=io.StringIO())
    print_identification(found, console, top=top)
    return console.export_text()


def test_what_the_film_may_hold_too_is_the_end_of_its_interval():
    found = answer([FIRST, THINNED])
    # Log odds of .1 with independent errors of both logs, .2 each, and of both paints' strength.
    odds = np.log(0.1 / 0.9) + 1.6448536 * np.sqrt(2 * (0.04 + STRENGTH**2))
    assert possible_additions(found, 0) == pytest.approx(
        {"BariumSulphate": 1 / (1 + np.exp(-odds))}, rel=1e-6
    )
    assert "It may also hold up to 22 % BariumSulphate." in describe_ambiguity(found, 0)


def test_of_many_paints_that_the_film_may_hold_too_the_first_are_named_and_the_others_counted():
    shares = {"LeadWhite": 0.3, "ZincWhite": 0.1, "Eosin": 3e-3, "Vermillion": 2e-3}
    beside = [
        (("CobaltBlue", paint), [1 - share, share], 0.03, 0, CURVE)
        for paint, share in shares.items()
    ]
    (said,) = [
        words for words in describe_ambiguity(answer([FIRST, *beside]), 0) if "hold" in words
    ]
    most = [percent(most) for most in possible_additions(answer([FIRST, *beside]), 0).values()]
    assert said == (
        f"It may also hold one more paint: up to {most[0]} LeadWhite, up to {most[1]} ZincWhite, "
        "a trace (below 1.0 %) of Eosin, or less of 1 other."
    )


@pytest.mark.parametrize(
    "other",
    [
        (("ZincWhite", "BariumSulphate"), [0.9, 0.1], 0.1, 0, CURVE),  # without the first's paint
        (("CobaltBlue", "BariumSulphate"), [0.9, 0.1], 1e-4, 0, CURVE),  # hardly possible
        (("CobaltBlue", "BariumSulphate"), [0.9, 0.1], 0.1, 1, CURVE),  # lies differently
        (("CobaltBlue", "BariumSulphate"), [0.9999, 0.0001], 0.1, 0, CURVE),  # nothing to speak of
        (("CobaltBlue", "BariumSulphate", "ZincWhite"), [0.8, 0.1, 0.1], 0.1, 0, CURVE),  # two more
    ],
)
def test_other_films_do_not_say_what_this_one_may_hold(other):
    assert possible_additions(answer([FIRST, other]), 0) == {}


@pytest.mark.parametrize(
    ("condition", "words"),
    [(1, "rests on the varnish"), (3, "rests on the ground"), (6, "rests on the ground")],
)
def test_an_answer_that_rests_on_how_the_film_lies_says_so(condition, words):
    far = off_at(slice(None), 0.02)
    found = answer([FIRST, (("LeadWhite",), [1.0], 0.15, condition, far)])
    (said,) = evidence_relied_on(found, 0)
    assert words in said
    assert f"{CONDITIONS[condition].words} it is LeadWhite (15%)" in said
    # Of the same pigment nothing rests on it; nor where the other is improbable.
    same = (("CobaltBlue",), [1.0], 0.15, condition, far)
    assert evidence_relied_on(answer([FIRST, same]), 0) == []
    assert (
        evidence_relied_on(answer([FIRST, (("LeadWhite",), [1.0], 0.05, condition, far)]), 0) == []
    )


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
        found = answer([(*FIRST[:4], own), (("LeadWhite",), [1.0], 0.1, 0, other)])
        return evidence_relied_on(found, 0)

    (said,) = relied_on()
    assert words in said
    assert "elsewhere LeadWhite fits as well" in said
    # Off in the middle too: the answer does not rest on the end.
    other[12:15] += 0.03
    assert relied_on() == []


def test_two_names_of_one_pigment_are_no_doubt():
    own, other = off_at(slice(10, 20), 0.004), off_at(slice(-3, None), 0.03)
    found = answer([(*FIRST[:4], own), (("CobaltBlue",), [1.0], 0.1, 0, other)])
    assert evidence_relied_on(found, 0) == []


def test_what_nothing_explains_has_no_such_doubts():
    found = answer([FIRST, THINNED])
    nothing = replace(found, none=np.array([0.9]))
    assert not any("may also hold" in words for words in describe_ambiguity(nothing, 0))


def test_what_the_headline_settled_is_not_called_open():
    """Two paints of one pigment share it, and what is missing to one is that nothing explains the
    film.
    """
    eosin = "Eosin", "Eosin1Wax"
    found = answer(
        [
            (("Vermillion",), [1.0], 0.5, 0, CURVE),
            (("Vermillion", "Eosin"), [0.9, 0.1], 0.2, 0, CURVE),
            (("Vermillion", "LeadWhite"), [0.9, 0.1], 0.2, 0, CURVE),
        ]
    )
    assert describe_undecided(found, 0) == (
        "Not settled by this spectrum: LeadWhite (22%), Eosin (22%)."
    )
    two = replace(found, paints=(*PAINTS[:4], *eosin))
    # Vermillion's place is now Eosin1Wax's: a film of that, or of both, is of eosin.
    assert describe_undecided(two, 0) == "Not settled by this spectrum: LeadWhite (22%)."
    # What nothing explains has no headline, and all of it is open.
    nothing = replace(found, none=np.array([0.9]))
    assert "Vermillion (90%)" in describe_undecided(nothing, 0)


def test_shares_that_no_reading_tells_are_not_said():
    trace = ("LeadWhite", "CobaltBlue"), [0.9998, 0.0002], 0.8, 0, CURVE
    weak = ("LeadWhite", "CobaltBlue"), [0.992, 0.008], 0.1, 0, CURVE
    most = ("LeadWhite", "CobaltBlue", "Eosin"), [0.002, 0.0001, 0.9979], 0.1, 0, CURVE
    found = answer([trace, weak, most], covariance=4.0)
    words = [candidate.words for candidate in found.ranked(0)]
    assert words == [
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
    found = answer([(PAINTS[: len(fractions)], fractions, 0.9, condition, CURVE)])
    laid = np.zeros_like(found.coats)
    laid[0, 0, : len(coats)] = coats
    (candidate,) = replace(found, coats=laid).ranked(0)
    assert candidate.words == words
    assert candidate.mixture == words.partition(", ")[0]


# ---- headlines -----------------------------------------------------------------------------------


def open_answer():
    """Lead white is in three sets of .2 each; the most probable set is without it."""
    return answer(
        [
            (("CobaltBlue",), [1.0], 0.25, 0, CURVE),
            (("LeadWhite",), [1.0], 0.2, 0, CURVE),
            (("LeadWhite", "BariumSulphate"), [0.9, 0.1], 0.2, 0, CURVE),
            (("LeadWhite", "ZincWhite"), [0.8, 0.2], 0.2, 0, CURVE),
        ]
    )


def test_the_headline_names_what_is_probable_over_all_sets():
    found = open_answer()
    assert found.likely_paint(0) == ("LeadWhite", pytest.approx(0.6))
    assert found.words(0).startswith(
        "spot: most probably with LeadWhite (60%), but its companion is"
    )
    assert "CobaltBlue (25%), is without it" in found.words(0)
    assert "Most probably with LeadWhite (60%)" in text_of(found, 4)


def test_a_set_that_holds_the_most_probable_paint_is_the_headline():
    found = answer([FIRST])
    assert found.likely_paint(0) is None
    assert found.words(0).startswith("spot: CobaltBlue (probability 80%")


def test_what_is_not_explained_names_the_film_that_is_nearest():
    far = off_at(slice(None), 0.2)
    near = off_at(slice(None), 0.03)
    found = answer(
        [
            (("CobaltBlue",), [1.0], 0.05, 0, far),
            (("LeadWhite",), [1.0], 0.03, 0, near),
        ]
    )
    first, second = found.ranked(0)
    assert second.delta_e < first.delta_e
    assert f"LeadWhite, has an error of Delta E00 {second.delta_e:.1f}" in found.words(0)


def test_a_film_that_hides_its_ground_has_no_thickness_in_the_table():
    found = replace(answer([FIRST]), amounts=np.full((1, 1, 3), np.nan))
    assert "nan" not in text_of(found, 1)


@pytest.mark.parametrize(
    ("fraction", "words"),
    [(1.0, "100 %"), (0.0, "0 %"), (0.9997, "> 99.9 %"), (0.0003, "< 0.1 %"), (0.5, "50 %")],
)
def test_parts_of_a_whole_are_said_as_parts(fraction, words):
    assert percent(fraction) == words
