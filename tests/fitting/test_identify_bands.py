"""What a report adds to an identification: the bands about a fit."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit.film.films import Instrument, Noise
from glazefit.film.model.errors import ModelError
from glazefit.film.model.response import film_response
from glazefit.identify.result import Identification
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.pool import NOBODY
from glazefit.identify.search.searcher import Searcher, check_spectra
from glazefit.identify.show.bands import expected_bands
from glazejax import Glaze, Hemispherical, Layer, Mixture, reflectance
from tests.fitting.palette import GRID, palette

PAINTS = palette()
NAMES = [paint.name for paint in PAINTS]
SPHERE = Hemispherical(8.0)
INSTRUMENT = Instrument(SPHERE, 1.5)
GROUNDS = np.array([0.05, 0.9])[:, None] * np.ones(GRID.size)
# The surface's share known, so that films can be computed by the forward package alone.
NEAT = ModelError(
    freedom=1e9,
    gloss_sd=0.0,
    coefficient=0.0,
    unstated=0.0,
    level=0.0,
    amplitude=0.0,
    share=0.0,
    haze=0.0,
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


def bands(found: Identification, discrepancy: ModelError) -> np.ndarray:
    """About the explanations, in a search with these errors."""
    options = IdentificationOptions(instrument=INSTRUMENT, discrepancy=discrepancy)
    return expected_bands(found, Searcher.of(GRID, PAINTS, options).task)


def test_bands_lose_what_a_fit_takes_away():
    """With noise alone the variance that is left adds up to the readings less the unknowns."""
    spectra = film({"Red": 0.1, "White": 0.9}, 30e-6)[None]
    found = explained(spectra, ["White", "Red"], [0.9, 0.1], 30e-6)
    gloss = replace(NEAT, gloss_sd=1e3)
    noise = found.measured.noise_sd[0]
    half = {
        name: bands(found, d)[0, 0] / 1.6448536 for name, d in (("known", NEAT), ("free", gloss))
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
    band = bands(found, replace(NEAT, level=level))
    assert_allclose(band[0, 0].ravel(), 1.6448536 * np.sqrt(np.diagonal(left)), rtol=0.01)


def test_bands_hold_the_errors_that_are_stated():
    spectra = film({"Red": 0.1, "White": 0.9}, 30e-6)[None]
    found = explained(spectra, ["White", "Red"], [0.9, 0.1], 30e-6)

    def mean(**changed) -> float:
        return float(bands(found, ModelError(**{"unstated": 0.05, **changed})).mean())

    usual = mean()
    assert mean(coefficient=0.2) > 1.2 * usual
    assert mean(amplitude=0.05) > 2 * usual
    # Quantiles of Student's t at .95: 2.015 for 5, 2.132 for 4.
    assert mean(freedom=4.0) == pytest.approx(usual * 2.1318468 / 2.0150484)


def test_bands_of_many_spectra_are_those_of_each():
    """They are computed some spectra at a time."""
    spectra = np.stack([film({"Red": 0.1, "White": 0.9}, depth) for depth in (20e-6, 40e-6)])
    many = explained(
        np.resize(spectra, (70, *spectra.shape[1:])), ["White", "Red"], [0.9, 0.1], 30e-6
    )
    one = bands(many.take(np.array([69])), NEAT)
    assert_allclose(bands(many, NEAT)[69:], one, rtol=1e-6)
