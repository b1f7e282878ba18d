"""How far films of right answers are from readings, and what a report by family draws."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import identify
from glazefit.identify.families.features import (
    at_brightness_of,
    relative_misfit,
    with_one_gloss,
)
from glazefit.identify.families.misfit import usual_misfit
from glazefit.identify.result.groups import answer_of
from glazefit.identify.result.table import table_of
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.show.explanation import explanations
from glazefit.identify.show.page import fits_to_draw, plot_axes
from glazefit.identify.show.record import make_record, table_of_record
from glazefit.identify.show.terminal import report_families, write_residuals
from glazejax import Pigment

from .tables import read_rows
from .test_identify_page import ABOUT, Parsed, html, plots

GRID = np.arange(420.0, 691.0, 10.0)
FAMILIES = ("azurite", "vermilion", "malachite", "red ochre", "lead white", "carbon black")
OPTIONS = IdentificationOptions(instrument="45:0", keep=40)
# A steep flank: a red.
RED = 0.06 + 0.7 / (1.0 + np.exp(-(GRID - 600.0) / 12.0))


@pytest.fixture(scope="module")
def shelf(shelf):
    """Exemplars of some families."""
    return [paint for paint in shelf if paint.family in FAMILIES]


def identify_hidden(spectra, shelf):
    """Which families hide under these spectra, by name."""
    readings = np.stack([*spectra.values()])
    asked: dict = dict(names=[*spectra], opaque=True, instrument="45:0", keep=40)
    return identify(GRID, readings, shelf, **asked)


@pytest.fixture(scope="module")
def found(shelf):
    """A red and a grey, by these families."""
    return identify_hidden({"red": RED, "grey": np.full(GRID.size, 0.3)}, shelf)


def families(shelf) -> dict[str, str]:
    return {paint.name: paint.family for paint in shelf}


def test_gloss_and_brightness_of_a_film_are_those_of_the_reading():
    """Gloss is as `with_one_gloss` has it: .05 of a reading at most."""
    film = RED - RED.min() + 0.03
    drawn, scale = at_brightness_of(RED - RED.min() + 0.01, film)
    assert drawn == pytest.approx(film - 0.02)
    assert scale == pytest.approx(1.0)
    # Of two films that differ in brightness alone, half of the brighter is nearly the other.
    drawn, scale = at_brightness_of(RED, 2.0 * RED)
    assert scale == pytest.approx(0.5, abs=0.02)
    assert drawn == pytest.approx(RED, abs=0.02)
    assert relative_misfit(RED, RED) == pytest.approx(np.zeros(GRID.size))


def test_a_film_is_drawn_where_it_is_compared_alone():
    film = np.concatenate([np.full(4, RED[3]), RED[4:-3], np.full(2, RED[-4]), [np.nan]])
    drawn, _ = at_brightness_of(RED, film)
    assert np.isfinite(drawn).tolist() == [False] * 3 + [True] * (GRID.size - 6) + [False] * 3


def test_right_answers_among_equal_paints_are_off_by_nothing(shelf, found):
    """Every paint stands there twice, by two sources, but for a hundredth of its k."""
    usual = usual_misfit(found, shelf, OPTIONS)
    assert usual is not None
    assert 10 < usual.answers <= len(shelf)
    assert 0.01 < usual.half < usual.nine_tenths < 0.5
    assert np.isfinite(usual.band).all()
    rng = np.random.default_rng(0)
    twins = [
        Pigment(
            f"twin of {paint.name}",
            paint.wavelengths,
            paint.absorption * rng.lognormal(0.0, 0.01, paint.wavelengths.size),
            paint.scattering,
        ).renamed(f"twin of {paint.name}", family=paint.family, source="twins")
        for paint in shelf
    ]
    nothing = usual_misfit(found, [*shelf, *twins], OPTIONS)
    assert nothing is not None
    assert nothing.half < 0.01
    assert nothing.answers > usual.answers


def test_each_answer_is_drawn_by_its_nearest_film(shelf, found):
    """At the reading's brightness, and under the answer's probability."""
    of = families(shelf)
    for row in range(2):
        films = explanations(found, row, 3)
        answers = found.family_sets[row][:3]
        assert [film.probability for film in films] == [one.probability for one in answers]
        for film, answer in zip(films, answers, strict=True):
            named = {
                name for one in answer.families for name in (one, *dict(answer.within.get(one, ())))
            }
            assert named & {of[paint] for paint in film.paints}
        reading = found.measured.readings[row, 0]
        # Of what it may be multiplied by, as drawn it comes nearest, gloss aside.
        (fitted,) = films[0].fitted
        drawn = np.isfinite(fitted)
        body = with_one_gloss(reading[drawn])
        film = fitted[drawn] - reading[drawn] + body
        assert film @ (body - film) == pytest.approx(0.0, abs=1e-9)
        # No film of these paints is as flat as the grey.
        if row == 0:
            assert np.nanmax(fitted) == pytest.approx(reading.max(), rel=0.15)
        assert films[0].scale != pytest.approx(1.0, abs=1e-3)
    # A film of paints is drawn as it was fitted.
    paints = replace(found, family_sets=())
    for film, candidate in zip(explanations(paints, 0, 3), paints.ranked(0, 3), strict=True):
        assert_array_equal(film.fitted, candidate.fitted)
        assert film.words == candidate.words


def test_the_nearest_exemplar_is_of_the_answer(shelf, found):
    """Also where the most probable single set belongs to another answer."""
    of = families(shelf)
    answer = answer_of(found.family_sets[0][0].families)

    def is_of_it(paints):
        return answer_of(of[paint] for paint in paints) == answer

    other = next(n for n, one in enumerate(found.ranked(0)) if not is_of_it(one.paints))
    probability = found.probability.copy()
    probability[0, [0, other]] = probability[0, [other, 0]]
    order = [other, *(n for n in range(probability.shape[1]) if n != other)]
    swapped = replace(found, members=found.members[:, order], probability=probability[:, order])
    named = swapped.nearest_exemplars(0)
    assert named in swapped.verdict(0)
    assert is_of_it(named.split(" + "))
    assert next(iter(table_of(swapped)[1]))[5] == named


def test_residuals_are_of_the_film_that_is_drawn(found, tmp_path):
    write_residuals(found, tmp_path / "off.csv")
    lines = read_rows(tmp_path / "off.csv")
    (film,) = explanations(found, 0, 1)
    titles = "fitted at the reading's gloss and brightness", "measured", "residual"
    rows = [[float(line[title]) for title in titles] for line in lines[: GRID.size]]
    fitted, measured, off = np.transpose(rows)
    assert_allclose(fitted, film.fitted[0], rtol=1e-4)
    assert_allclose(off, measured - fitted, atol=1e-5)


def test_a_page_by_family_says_how_large_a_misfit_is_usual(shelf, found):
    usual = usual_misfit(found, shelf, OPTIONS)
    assert usual is not None
    about = ABOUT | {"subject": {"inventory": "SK-A-1"}}
    filed = make_record(found, about, ("red", "grey"), 5, usual=usual)
    text = html(filed)
    seen = Parsed(text)
    assert "<dt>Inventory number</dt><dd>SK-A-1</dd>" in text
    assert len(plots(seen)) == 2
    spot = filed["spots"][0]
    assert "vermilion" in spot["families"][0]["families"]
    fits = fits_to_draw(spot["explanations"])
    misfit = f"{100 * fits[0]['misfit']:.1f}"
    words = " ".join(seen.words["spot-1"].split())
    assert f"Line 1 has an error of {misfit}" in words
    assert f"Of {usual.answers} right answers" in words
    assert ("further than is usual" in words) == (fits[0]["misfit"] > usual.nine_tenths)
    # The band about the reading, and every line, lie within the axes.
    high = plot_axes(filed, spot)["spectra"].high
    assert high >= np.max(spot["measured"]) + np.max(spot["usual_band"][0][-3:])
    assert high >= max(value for fit in fits for value in fit["fitted"][0] if value is not None)
    assert text.count('class="usual"') == 2
    first, *_ = table_of_record(filed)[1]
    assert first[-1] == " + ".join(paint["name"] for paint in spot["explanations"][0]["paints"])
    far = {**fits[0], "misfit": 2 * usual.nine_tenths}
    further = {**filed, "spots": [{**spot, "explanations": [far, *fits[1:]]}]}
    assert "further than is usual" in html(further)


def test_a_page_by_family_of_an_interrupted_run_says_what_is_missing(found):
    filed = make_record(found, ABOUT, ("red", "grey", "blue"), 5)
    words = Parsed(html(filed)).words[""]
    assert "Interrupted. 2 of 3 spots were finished. Not done: blue." in words
    assert words.index("Interrupted") < words.index("Summary")


def test_the_nearest_answer_is_named_however_improbable_it_is(shelf):
    """A spectrum like no paint had no answer, no row in a table, and no page."""
    names = ("step", "red")
    unlike = identify_hidden({"step": np.where(GRID < 560.0, 0.9, 0.02), "red": RED}, shelf)
    assert 0.999 < unlike.none[0] < 1.0
    (answer,) = unlike.family_sets[0]
    assert answer.probability < 1e-3
    (headline,) = (line for line in report_families(unlike, 5, None) if "step: " in line)
    assert str(headline).endswith(f"the nearest pigment is {answer.words}")
    filed = make_record(unlike, ABOUT, names, 5)
    for _, rows in (table_of(unlike), table_of_record(filed)):
        assert {row[0] for row in rows} == {*names}
    # With its film, and where that was not kept.
    bare = {**filed, "spots": [{**spot, "explanations": []} for spot in filed["spots"]]}
    for each, count in ((filed, 2), (bare, 0)):
        page = Parsed(html(each))
        assert len(plots(page)) == count
        (row,) = (cells for cells in page.rows if cells[0] == "step")
        assert "like none that is known; nearest" in row[2]
