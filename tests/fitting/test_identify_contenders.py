"""What a report adds to an identification: the nearest film with each paint, and the bands about a
fit.
"""

import json
from dataclasses import fields, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from glazefit.film.films import Instrument, Noise
from glazefit.film.model.errors import ModelError, Prior
from glazefit.film.model.response import film_response
from glazefit.identify.result import Identification
from glazefit.identify.search.pool import NOBODY
from glazefit.identify.search.searcher import check_spectra
from glazefit.identify.search.table import Paints
from glazefit.identify.show.bands import expected_bands
from glazefit.identify.show.contenders import LEAST_SHARE, Contenders, _screen, find_contenders
from glazefit.identify.show.reporting import ReportBuilder
from glazejax import Glaze, Hemispherical, Layer, Mixture, colour, reflectance
from tests.fitting.palette import GRID, palette
from tests.fitting.test_identify_page import ABOUT

PAINTS = palette()
NAMES = [paint.name for paint in PAINTS]
SPHERE = Hemispherical(8.0)
INSTRUMENT = Instrument(SPHERE, 1.5)
GROUNDS = np.array([0.05, 0.9])[:, None] * np.ones(GRID.size)
# The surface's share known, so that films can be computed by the forward package alone.
NEAT = ModelError(
    gloss_sd=0.0,
    coefficient=0.0,
    unstated=0.0,
    level=0.0,
    amplitude=0.0,
    scales=(1.0,),
    weights=(1.0,),
)


def film(parts: dict[str, float], thickness: float) -> np.ndarray:
    """Readings over both grounds, by the forward package."""
    medium = Mixture([PAINTS[NAMES.index(name)] for name in parts], list(parts.values()))
    return np.asarray(reflectance(Glaze([Layer(medium, thickness)], GROUNDS), SPHERE))


def explained(
    readings: np.ndarray, members: list[str], fractions: list[float], thickness: float
) -> Identification:
    """An identification that gives every spectrum this one explanation."""
    count = len(readings)
    measured = check_spectra(GRID, readings, GROUNDS, None, Noise())
    places = [NAMES.index(name) for name in members] + [NOBODY] * (3 - len(members))
    amounts = thickness * np.array(fractions + [0.0] * (3 - len(members)))
    fitted = film(dict(zip(members, fractions, strict=True)), thickness)
    present = np.array([1.0 if name in members else 0.0 for name in NAMES])
    return Identification(
        measured=measured,
        paints=tuple(NAMES),
        members=np.broadcast_to(np.array(places), (count, 1, 3)),
        coats=np.zeros((count, 1, 3), int),
        amounts=np.broadcast_to(amounts, (count, 1, 3)),
        log_covariance=np.zeros((count, 1, 3, 3)),
        probability=np.full((count, 1), 0.9),
        none=np.full(count, 0.1),
        misfit=np.full(count, 0.5),
        rejected=np.zeros((count, 1), bool),
        paint_probability=np.broadcast_to(0.9 * present, (count, len(NAMES))),
        gloss=np.ones((count, 1)),
        fitted=np.broadcast_to(fitted, (count, 1, *fitted.shape)),
        condition=np.zeros((count, 1), int),
        opaque=False,
    )


@pytest.fixture(scope="module")
def looked() -> tuple[Identification, Contenders]:
    """A tint of red, a green of blue and yellow, and what is nearest to each; the first is
    explained.
    """
    spectra = np.stack(
        [film({"Red": 0.1, "White": 0.9}, 30e-6), film({"Blue": 0.3, "Yellow": 0.7}, 15e-6)]
    )
    found = explained(spectra, ["White", "Red"], [0.9, 0.1], 30e-6)
    return found, find_contenders(found, PAINTS, INSTRUMENT, prior=Prior(), discrepancy=NEAT)


def test_films_with_a_paint_read_what_is_said_of_them(looked):
    found, near = looked
    assert (near.members[..., 0] == np.arange(len(NAMES))).all()
    np.testing.assert_allclose(near.fractions.sum(axis=-1), 1.0)
    assert (near.fractions[..., 0] >= LEAST_SHARE * (1 - 1e-9)).all()
    for row, paint in ((0, 4), (0, 1), (1, 0), (1, 2)):
        members, shares = near.members[row, paint], near.fractions[row, paint]
        there = {NAMES[m]: float(s) for m, s in zip(members, shares, strict=True) if m != NOBODY}
        again = film(there, float(near.thickness[row, paint]))
        off = found.measured.readings[row] - again
        # The table of films is right to 1e-5.
        assert np.sqrt(np.mean(off**2)) == pytest.approx(near.rmse[row, paint], abs=5e-5)
        seen = colour.delta_e_of_spectra(
            GRID, found.measured.readings[row], again, observer=10
        ).max()
        assert seen == pytest.approx(near.delta_e[row, paint], abs=0.02)


def test_paints_of_the_film_come_near_and_others_do_not(looked):
    _, near = looked
    assert (near.delta_e[0, [0, 2]] < 0.02).all()
    assert near.delta_e[0, [1, 4]].min() > 2.5
    assert (near.delta_e[1, [3, 4]] < 0.1).all()
    assert near.fractions[1, 4, 0] == pytest.approx(0.3, abs=0.01)


def test_no_film_with_a_paint_comes_much_nearer(looked):
    """Blue beside white and red in a tint of red, by scipy's simplex from several starts."""
    found, near = looked
    readings = found.measured.readings[0]
    sd = np.hypot(found.measured.noise_sd[0], 0.005 + 0.02 * readings)
    response = film_response(SPHERE, 1.5)
    tabled = jax.jit(lambda *film: response.body(*film))

    def tabled_film(parts: dict[str, float], thickness: float) -> np.ndarray:
        thick = (
            sum(
                share * thickness * getattr(PAINTS[NAMES.index(name)], what)
                for name, share in parts.items()
            )
            for what in ("absorption", "scattering")
        )
        return np.asarray(tabled(*thick, GROUNDS)) + INSTRUMENT.seen_surface

    def cost(unknowns: np.ndarray) -> float:
        blue = LEAST_SHARE + (1 - LEAST_SHARE) / (1 + np.exp(-unknowns[1]))
        white = (1 - blue) / (1 + np.exp(-unknowns[2]))
        parts = {"Blue": blue, "White": white, "Red": max(1 - blue - white, 1e-12)}
        return float(
            np.sum(((readings - tabled_film(parts, 25e-6 * np.exp(unknowns[0]))) / sd) ** 2)
        )

    starts = [(0.0, -6.0, 2.0), (0.0, -6.0, 6.0), (-1.0, -4.0, 0.0)]
    best = min(
        minimize(cost, start, method="Nelder-Mead", options={"maxiter": 400}).fun
        for start in starts
    )
    members, shares = near.members[0, 4], near.fractions[0, 4]
    there = {NAMES[m]: float(s) for m, s in zip(members, shares, strict=True) if m != NOBODY}
    mine = np.sum(((readings - film(there, float(near.thickness[0, 4]))) / sd) ** 2)
    assert mine <= 1.02 * best


def test_a_film_of_one_paint_alone(looked):
    found, _ = looked
    near = find_contenders(found, PAINTS, INSTRUMENT, prior=Prior(), discrepancy=NEAT, max_paints=1)
    off = found.explained
    assert off.all()
    # Beside the explanation itself, which is of two.
    alone = near.members[:, [1, 3, 4]]
    assert (alone[..., 1:] == NOBODY).all()
    assert (near.fractions[:, [1, 3, 4], 0] == 1).all()


def test_partners_are_chosen_by_the_misfit_of_the_mixtures():
    """The screening's least misfits, and where they are, against films mixed and compared one by
    one.
    """
    response = film_response(SPHERE, 1.5)
    k, s = (
        np.stack([25e-6 * np.asarray(getattr(p, what)) for p in PAINTS])
        for what in ("absorption", "scattering")
    )
    partners = np.array(
        [[other for other in range(len(NAMES)) if other != paint] for paint in range(len(NAMES))]
    )
    total, share = np.array([0.3, 1.0, 1.0, 3.0]), np.array([0.1, 0.1, 0.6, 0.9])
    rng = np.random.default_rng(5)
    target = np.stack(
        [film({"Red": 0.1, "White": 0.9}, 30e-6), film({"Blue": 0.3, "Yellow": 0.7}, 15e-6)]
    )
    target = target.reshape(2, -1) - 0.04
    white = np.eye(target.shape[1]) + 0.1 * rng.standard_normal(
        (2, target.shape[1], target.shape[1])
    )
    ground = np.stack([GROUNDS, 0.8 * GROUNDS])
    wanted = np.einsum("srt,st->sr", white, target)
    tries, spectra = (
        [jnp.asarray(a) for a in some]
        for some in ((partners, total, share), (ground, wanted, white))
    )
    least, where = _screen(response, Paints(jnp.asarray(k), jnp.asarray(s)), *tries, *spectra)
    for paint in range(len(NAMES)):
        for place, other in enumerate(partners[paint]):
            mixed = [
                total[:, None] * (share[:, None] * v[paint] + (1 - share[:, None]) * v[other])
                for v in (k, s)
            ]
            for row in range(2):
                body = np.asarray(
                    response.body(mixed[0][:, None], mixed[1][:, None], ground[row])
                ).reshape(4, -1)
                cost = np.sum(((target[row] - body) @ white[row].T) ** 2, axis=-1)
                assert float(least[paint, row, place]) == pytest.approx(cost.min(), rel=1e-6)
                assert int(where[paint, row, place]) == cost.argmin()


def test_bands_lose_what_a_fit_takes_away():
    """With noise alone the variance that is left adds up to the readings less the unknowns."""
    spectra = film({"Red": 0.1, "White": 0.9}, 30e-6)[None]
    found = explained(spectra, ["White", "Red"], [0.9, 0.1], 30e-6)
    gloss = ModelError(
        gloss_sd=1e3,
        coefficient=0.0,
        unstated=0.0,
        level=0.0,
        amplitude=0.0,
        scales=(1.0,),
        weights=(1.0,),
    )
    noise = found.measured.noise_sd[0]
    half = {
        name: expected_bands(found, PAINTS, INSTRUMENT, prior=Prior(), discrepancy=d)[0, 0]
        / 1.6448536
        for name, d in (("known", NEAT), ("free", gloss))
    }
    count = spectra.size
    assert found.measured.noise_sd.shape == spectra.shape
    kept = {name: np.sum((sd / noise) ** 2) for name, sd in half.items()}
    assert kept["known"] == pytest.approx(count - 2, abs=0.1)
    assert kept["free"] == pytest.approx(count - 3, abs=0.1)


@pytest.mark.parametrize("level", [0.0, 0.05])
def test_bands_are_what_a_linear_fit_of_the_amounts_leaves(level: float):
    """Covariance less what generalised least squares explains, with slopes by finite
    differences.
    """
    thickness, amounts = 30e-6, np.array([0.9, 0.1])
    spectra = film({"White": 0.9, "Red": 0.1}, thickness)[None]
    found = explained(spectra, ["White", "Red"], amounts.tolist(), thickness)
    k, s = (
        np.stack(
            [
                thickness * np.asarray(getattr(PAINTS[NAMES.index(name)], what))
                for name in ("White", "Red")
            ]
        )
        for what in ("absorption", "scattering")
    )
    response = film_response(SPHERE, 1.5)
    body = jax.jit(lambda *film: response.body(*film))

    def read(log_k: np.ndarray, log_s: np.ndarray) -> np.ndarray:
        return np.asarray(
            body((amounts * np.exp(log_k)) @ k, (amounts * np.exp(log_s)) @ s, GROUNDS)
        ).ravel()

    steps, nothing = 1e-4 * np.eye(2), np.zeros(2)
    by_k = np.stack([read(step, nothing) - read(-step, nothing) for step in steps], axis=-1) / 2e-4
    by_s = np.stack([read(nothing, step) - read(nothing, -step) for step in steps], axis=-1) / 2e-4
    covariance = np.diag(found.measured.noise_sd.ravel() ** 2) + level**2 * (
        by_k @ by_k.T + by_s @ by_s.T
    )
    lever = by_k + by_s
    solved = np.linalg.solve(covariance, lever)
    left = covariance - lever @ np.linalg.solve(lever.T @ solved, lever.T)
    band = expected_bands(
        found, PAINTS, INSTRUMENT, prior=Prior(), discrepancy=replace(NEAT, level=level)
    )
    np.testing.assert_allclose(
        band[0, 0].ravel(), 1.6448536 * np.sqrt(np.diagonal(left)), rtol=0.01
    )


def test_bands_hold_the_errors_that_are_stated():
    spectra = film({"Red": 0.1, "White": 0.9}, 30e-6)[None]
    found = explained(spectra, ["White", "Red"], [0.9, 0.1], 30e-6)

    def mean(**changed) -> float:
        d = ModelError(**{"unstated": 0.05, "scales": (1.0,), "weights": (1.0,), **changed})
        return float(expected_bands(found, PAINTS, INSTRUMENT, prior=Prior(), discrepancy=d).mean())

    usual = mean()
    assert mean(coefficient=0.2) > 1.2 * usual
    assert mean(amplitude=0.05) > 2 * usual
    # Quantiles of Student's t at .95: 2.015 for 5, 1.645 for none.
    assert mean(freedom=5.0) == pytest.approx(usual * 2.0150484 / 1.6448536)


def test_what_an_interrupt_left_over_is_not_filed(looked, tmp_path):
    found, _ = looked
    halves = [replace_rows(found, rows) for rows in ([0], [1])]
    report_builder = ReportBuilder(
        PAINTS, INSTRUMENT, discrepancy=NEAT, prior=Prior(), max_paints=2
    )
    parts = []
    for part in report_builder.watch(iter(halves)):
        parts.append(part)
        if len(parts) == 2:
            break
    report_builder.write(halves[0], replace(ABOUT, names=("1", "2")), tmp_path / "x.html", 2)
    filed = json.loads((tmp_path / "x.json").read_text())
    assert [spot["name"] for spot in filed["spots"]] == ["1"]
    assert filed["not_done"] == ["2"]


def replace_rows(found: Identification, rows: list[int]) -> Identification:
    """Some of the spectra."""
    whole = ("measured", "paints", "opaque", "family_sets", "coats_odds")
    parts = {
        field.name: getattr(found, field.name)[rows]
        for field in fields(found)
        if field.name not in whole
    }
    return replace(found, measured=found.measured.take(np.array(rows)), **parts)
