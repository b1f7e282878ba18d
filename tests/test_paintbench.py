"""The bench of real paint: sources are read as they say, answers are judged as its README says; and what
chooses how far films scatter in `benchmarks.paint.prediction`.
"""

import numpy as np
import pytest
from benchmarks.paint import readings_of_mixtures
from benchmarks.paintbench import sources, splits, tasks
from benchmarks.paintbench.library import Answer, pure_table
from benchmarks.paintbench.mixers import KubelkaMunk, Mixtures
from benchmarks.paintbench.spectra import GRID
from scipy.stats import binom

from glazejax import catalogue

from .tables import rows


@pytest.fixture(scope="module")
def measured(shared_data):
    return {source.name: source for source in sources.read_sources(shared_data)}


def test_the_frozen_splits_are_those_of_the_rule(measured):
    splits.check_hashes()
    for name in ("bath", "grillini", "hyperdoc", "revigo"):
        for sample in measured[name].samples:
            assert sample.test == splits.is_test(name, sample), (name, sample.name)


def test_all_sources_come_to_one_form(measured):
    families = catalogue.families()
    for source in measured.values():
        for paint in source.paints.values():
            known = (*families, sources.FOREIGN, *sources.UNCLEAR)
            assert paint.family in known, (source.name, paint)
        for camera in source.cameras:
            assert camera.readings.shape == (len(source.samples), camera.wavelengths.size)
    assert len(measured["hyppigments"].samples) == 1592
    assert "74A" not in {sample.name for sample in measured["hyperdoc"].samples}
    assert measured["revigo"].bare is not None


def test_films_that_are_said_to_hide_their_ground_lie_over_no_black_card(measured):
    source = measured["revigo"]
    rows = [row for kind in ("pure", "mixture") for row in source.chosen(kind)]
    assert len(rows) == len(source.samples) / 2
    assert {source.samples[row].support for row in rows} == {sources.WHITE_CARD}
    table = pure_table([source])
    chalk = table.readings[table.families == "chalk"]
    assert np.nanmin(chalk[:, GRID >= 420.0]) > 0.4


JUDGED = """
azurite | azurite | right
azurite, chalk | azurite | right
azurite, vermilion | azurite | wrong
lead white + chalk | chalk | right
azurite, chalk | chalk | wrong
red ochre + yellow ochre + raw umber + burnt umber | raw umber | right
a + b + c + d + azurite | azurite | wrong
vermilion, minium + azurite | azurite, vermilion | right
vermilion | azurite, vermilion | wrong
vermilion | lead white, vermilion | right
| azurite | wrong
"""
"""Answers, each of families that are not told apart, and the families that are there."""


@pytest.mark.parametrize(("answer", "truth", "verdict"), rows(JUDGED))
def test_an_answer_is_right_as_the_readme_says(answer, truth, verdict):
    answers = [tuple(group.split(" + ")) for group in answer.split(", ") if group]
    assert tasks.is_right(answers, truth.split(", ")) == (verdict == "right")


def test_few_answers_have_a_calibration_error_where_all_that_is_stated_is_true():
    record = tasks.Record()
    for right in (True, False) * 15:
        record.state("chart", "method", 0.55, right)
    record.score_calibration()
    scores = record.results["calibration"]["chart"]["method"]
    counts = np.arange(31)
    expected = float(np.abs(counts / 30 - 0.55) @ binom.pmf(counts, 30, 0.55))
    assert scores["ece"] == pytest.approx(0.05)
    assert scores["ece_if_true"] == pytest.approx(expected, rel=0.1)


def test_scores_against_their_closed_forms():
    chances = np.array([0.95, 0.95, 0.55, 0.55])
    assert tasks.calibration_error(chances, np.array([1.0, 1.0, 1.0, 0.0])) == pytest.approx(0.05)
    assert tasks.area_under_curve(np.array([2.0, 3.0]), np.array([0.0, 2.0])) == 0.875
    low, high = tasks.interval(0.5, 100)
    assert (low, high) == (pytest.approx(0.4038, abs=1e-4), pytest.approx(0.5962, abs=1e-4))


def test_a_source_of_unclear_licence_is_asked_and_teaches_nothing(measured):
    assert not measured["makers"].learnable
    assert measured["usgs"].learnable

    method = Listener()
    record = tasks.Record()
    some = [measured[name] for name in ("makers", "usgs", "kimera")]
    tasks.run_names(some, [method], record)
    assert "makers" in record.results["pigment_380"]
    # A source that starts at 400 nm has nothing below it to be asked.
    assert "kimera" not in record.results["pigment_380"]
    assert method.groups == {"usgs", "kimera"}


def mixtures_by_kubelka_munk():
    rng = np.random.default_rng(1)
    k = np.array([[0.02, 0.02], [2.0, 0.1], [0.05, 1.0]])  # (paints, bands)
    s = np.array([[1.0, 1.0], [0.4, 0.6], [0.3, 0.2]])
    fractions = np.concatenate([np.eye(3), rng.dirichlet(np.ones(3), 20)])
    ratio = (fractions @ k) / (fractions @ s)
    return Mixtures(
        wavelengths=np.array([500.0, 600.0]),
        readings=1.0 + ratio - np.sqrt(ratio**2 + 2.0 * ratio),
        fractions=fractions,
        paints=("W", "R", "B"),
        names=tuple(str(n) for n in range(len(fractions))),
    )


@pytest.mark.parametrize("pairs", [False, True])
def test_two_constants_are_found_again_in_their_own_mixtures(pairs):
    films = mixtures_by_kubelka_munk()
    method = KubelkaMunk(pairs=pairs)
    method.learn(films.take(np.arange(15)))
    rest = films.take(np.arange(15, len(films)))
    predicted = method.predict(rest.fractions)
    # Half of the error that the method counts with: its priors pull by some of that.
    assert np.abs(predicted.readings - rest.readings).max() < 5e-3
    assert ((predicted.low <= rest.readings) & (rest.readings <= predicted.high)).all()
    found = method.amounts(rest.readings[:3], np.ones((3, 3), bool))
    assert np.abs(found - rest.fractions[:3]).max() < 0.05


class Listener:
    """A method that keeps which groups it was taught, and answers nothing."""

    name = "listener"

    def __init__(self):
        self.groups = set()

    def learn(self, library):
        self.groups |= set(library.groups.tolist())

    def answer(self, unnamed, hidden, pairs):
        return [Answer(ranked=(), doubt=0.0, refused=True)] * len(unnamed)


def test_a_film_has_no_say_in_how_far_films_scatter():
    """Two spreads, over two cards: what one film alone gains by the second is chosen for the
    others, not for itself.
    """
    off = np.ones((2, 2, 3))
    off[1, :, 0] = 0.1
    off[1, :, 1:] = 1.1
    np.testing.assert_array_equal(readings_of_mixtures.choose_without(off), [0, 1, 1])
