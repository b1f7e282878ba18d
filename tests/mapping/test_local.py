"""Answers in closed form, beside searches of the same spectra."""

import dataclasses
import functools

import numpy as np
import pytest

from glazefit import Noise
from glazefit.film.colour_metric import reading_metric
from glazefit.identify.result import Identification
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher
from glazefit.mapping.solve.atlas import Atlas
from glazefit.mapping.solve.local import Searched, as_measured, search_locally
from glazefit.mapping.solve.survey import Features
from glazefit.mapping.solve.update import log_weight_gain
from glazefit.mapping.solve.working_bands import WorkingBands
from glazejax.colour import delta_e_of_spectra
from tests.mapping import small

COUNTS = {"over a ground": 96, "hiding": 40}
"""Of spectra; few of those over a ground leave more than one candidate to compare."""


@dataclasses.dataclass
class Problem:
    searcher: Searcher
    ground: np.ndarray | None
    readings: np.ndarray
    sd: np.ndarray
    known: Searched

    @property
    def atlas(self):
        features = Features.of(self.readings)
        return Atlas(features, self.known, self.searcher.task.prior)

    @functools.cached_property
    def found(self):
        """Of the readings themselves."""
        return self.search(self.readings)

    def search(self, readings):
        return list(
            self.searcher.search(as_measured(self.searcher, readings, self.sd, self.ground))
        )


def sd_of(readings):
    return np.hypot(0.001, Noise().sd(readings))


# That a map agrees with searches of its pixels, test_map_cube.py tells quickly.
@pytest.fixture(
    scope="module",
    params=[pytest.param(each, marks=pytest.mark.slow) for each in ("over a ground", "hiding")],
)
def problem(request):
    scene = small.scene()
    bands = WorkingBands.of(scene.wavelengths, small.paints())
    searcher = Searcher.of(
        bands.wavelengths,
        small.paints(),
        IdentificationOptions(max_paints=2),
        opaque=request.param == "hiding",
    )
    ground = None if request.param == "hiding" else scene.ground @ bands.mean
    spectra = scene.rows(0, 24, noise=False).reshape(-1, scene.wavelengths.size)
    chosen = np.random.default_rng(0).choice(len(spectra), COUNTS[request.param], replace=False)
    readings = bands.means(spectra)[chosen].astype(float)
    return Problem(
        searcher,
        ground,
        readings,
        sd_of(readings),
        search_locally(searcher, readings, sd_of(readings), ground),
    )


def probabilities(problem, found):
    measured, pool, odds = found[0]
    searcher = problem.searcher
    return Identification.of(
        measured, pool, odds, paints=searcher.paints, opaque=searcher.opaque, keep=3
    )


def test_at_a_representative_it_is_the_search(problem):
    found, apart = problem.atlas.answers(problem.readings.astype("f4"))
    whole = probabilities(problem, problem.found)
    assert apart.max() < 0.2  # single precision
    assert (np.sort(found.members, axis=1) == np.sort(whole.members[:, 0], axis=1)).all()
    np.testing.assert_allclose(found.probability, whole.probability[:, 0], atol=0.02)
    np.testing.assert_allclose(found.none, whole.none, atol=0.04)
    np.testing.assert_allclose(found.paint_probability, whole.paint_probability, atol=0.04)
    np.testing.assert_allclose(found.fitted, whole.fitted[:, 0, 0], atol=1e-4)
    np.testing.assert_allclose(np.exp(found.amounts), whole.amounts[:, 0], rtol=1e-3, atol=1e-12)
    np.testing.assert_array_equal(found.explained, whole.explained)


def test_candidates_that_were_left_out_keep_their_share(problem):
    """Of all odds of candidates a share r is of those left out: the others have 1 - r, and none
    against all of them has less.
    """
    readings = problem.readings.astype("f4")
    left_out = 0.3

    def answers(rest: float):
        known = dataclasses.replace(problem.known, rest=np.full_like(problem.known.rest, rest))
        return Atlas(Features.of(readings), known, problem.searcher.task.prior).answers(readings)[0]

    without, found = answers(0.0), answers(left_out)
    whole = (1.0 - without.none) / (1.0 - left_out) + without.none
    np.testing.assert_allclose(found.probability, without.probability / whole, rtol=1e-5)
    np.testing.assert_allclose(found.none, without.none / whole, rtol=1e-5)


@pytest.mark.slow
def test_near_a_representative_it_follows_the_search(problem):
    """Weights of candidates, amounts, fits and Delta E move as those of a new search do."""
    rng = np.random.default_rng(1)
    step = 0.0015 * rng.standard_normal(problem.readings.shape)
    before, after = problem.found[0], problem.search(problem.readings + step)[0]
    local = problem.known.local
    moved, predicted, shift, fits = [], [], [], []
    # Of films that explain the spectrum: a far residual is no straight line in the amounts.
    met = np.sum(local.off**2, axis=1) < 50.0
    for row in range(len(problem.readings)):
        candidates = problem.known.candidates[row]
        own = np.arange(candidates.start, candidates.stop)[met[candidates]]
        changes = []
        for n in own:
            same = [
                (pool.members[row] == local.members[n]).all(axis=1)
                & (pool.condition[row] == local.condition[n])
                & np.isfinite(pool.log_weight[row])
                for _, pool, _ in (before, after)
            ]
            if not (same[0].any() and same[1].any()):
                continue
            one, other = (int(np.argmax(s)) for s in same)
            gain = after[1].log_weight[row, other] - before[1].log_weight[row, one]
            changes.append((gain, _gain(local.take(np.array([n])), step[row])))
            fits.append(
                [
                    after[1].readings[row, other] - before[1].readings[row, one],
                    local.fitted_by[n] @ step[row],
                ]
            )
            there = local.members[n] >= 0
            amounts = after[1].logs[row, other][there] - before[1].logs[row, one][there]
            shift.append(np.max(np.abs(amounts - (local.amounts_by[n] @ step[row])[there])))
        # What all candidates of a spectrum gain makes none more probable.
        moved.extend(gain - changes[0][0] for gain, _ in changes[1:])
        predicted.extend(gain - changes[0][1] for _, gain in changes[1:])
    moved, predicted, fits = np.asarray(moved), np.asarray(predicted), np.asarray(fits)
    assert len(moved) > 8
    off = np.abs(moved - predicted)
    assert np.median(off) < 0.05
    assert np.median(off) < 0.1 * np.median(np.abs(moved))
    assert np.median(shift) < 0.01
    assert np.median(np.abs(fits[:, 0] - fits[:, 1]).max(axis=1)) < 0.2 * np.median(
        np.abs(fits[:, 0]).max(axis=1)
    )


def _gain(one, step):
    off = one.off + np.einsum("nij,j->ni", one.off_by, step)[None]
    logs = np.einsum("nmj,j->nm", one.logs_by, step)[None]
    return float(log_weight_gain(one, off, logs)[0, 0] + one.weight_by[0] @ step)


@pytest.mark.slow
def test_spectra_between_representatives_are_answered_as_searched(problem):
    rng = np.random.default_rng(2)
    noisy = np.maximum(problem.readings + 0.001 * rng.standard_normal(problem.readings.shape), 0.0)
    found, _ = problem.atlas.answers(noisy.astype("f4"))
    whole = probabilities(problem, problem.search(noisy))
    same = (np.sort(found.members, axis=1) == np.sort(whole.members[:, 0], axis=1)).all(axis=1)
    assert same.mean() >= 0.85
    assert np.median(np.abs(found.paint_probability - whole.paint_probability).max(axis=1)) < 0.05


@pytest.mark.slow
def test_what_is_kept_comes_back(problem):
    arrays = problem.known.arrays()
    halves = 2 * [
        search_locally(problem.searcher, problem.readings, problem.sd, problem.ground).arrays()
    ]
    both = Searched.joined(2, lambda n, name: halves[n][name])
    count = len(problem.readings)
    assert both.candidates[count].start == both.candidates[count - 1].stop == both.kept.sum() // 2
    for name, values in both.arrays().items():
        half = len(values) // 2
        np.testing.assert_allclose(values[:half], arrays[name], rtol=1e-5, atol=1e-6)
        np.testing.assert_array_equal(values[half:], halves[1][name])


def test_colours_differ_as_the_metric_says():
    rng = np.random.default_rng(3)
    grid = np.arange(400.0, 701.0, 10.0)
    base = 0.1 + 0.6 * rng.random((6, 1)) * (1 + 0.5 * np.sin(grid / 40.0 + 6 * rng.random((6, 1))))
    metric = reading_metric(grid, base)
    step = 0.004 * np.cos(grid / 70.0 + 6 * rng.random((6, 1)))
    told = np.linalg.norm(np.einsum("scb,sb->sc", metric, step), axis=1)
    seen = np.asarray(delta_e_of_spectra(grid, base, base + step, observer=10))
    np.testing.assert_allclose(told, seen, rtol=0.08)
    # Without a colour it is a hundred times the root mean square.
    few = np.linspace(900.0, 1000.0, 11)
    flat = reading_metric(few, np.full((1, 11), 0.4))
    assert np.linalg.norm(flat[0] @ np.full(11, 0.01)) == pytest.approx(1.0)
