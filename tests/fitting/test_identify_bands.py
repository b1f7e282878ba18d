"""What a report adds to an identification: the bands about a fit."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit.film.films import Instrument, Noise
from glazefit.film.model.errors import ModelError, smooth_kernel
from glazefit.film.model.response import film_response
from glazefit.identify.result import Identification
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher, check_spectra
from glazefit.identify.search.unstated_conditions import CONDITIONS
from glazefit.identify.show.bands import expected_bands
from glazejax import Glaze, Hemispherical, Layer, Mixture, Pigment, reflectance
from tests.fitting.answers import made_up
from tests.fitting.palette import GRID, PALETTE, optical_depths

STATED = np.random.default_rng(4).uniform(0.02, 0.08, (5, 2, GRID.size))
"""Relative standard deviations of k and s that the paints state."""
PAINTS = [
    Pigment(
        paint.name,
        GRID,
        paint.absorption,
        paint.scattering,
        absorption_sd=sd[0] * np.asarray(paint.absorption),
        scattering_sd=sd[1] * np.asarray(paint.scattering),
    )
    for paint, sd in zip(PALETTE, STATED, strict=True)
]
NAMES = [paint.name for paint in PAINTS]
SPHERE = Hemispherical(8.0)
INSTRUMENT = Instrument(SPHERE, 1.5)
GROUNDS = np.array([0.05, 0.9])[:, None] * np.ones(GRID.size)
# The surface's share known, so that films can be computed by the forward package alone.
NO_ERRORS = ("gloss_sd", "coefficient", "most", "level", "amplitude", "share", "haze")
NEAT = ModelError(freedom=1e9, **dict.fromkeys(NO_ERRORS, 0.0))
TINT, THICKNESS = {"White": 0.9, "Red": 0.1}, 30e-6
"""Shares of its paints, and how thick it is where nothing else is said, m."""
ROWS = [NAMES.index(name) for name in TINT]


def film(thickness: float = THICKNESS) -> np.ndarray:
    """Readings of the tint over both grounds, by the forward package."""
    medium = Mixture([PAINTS[row] for row in ROWS], list(TINT.values()))
    return np.asarray(reflectance(Glaze([Layer(medium, thickness)], GROUNDS), SPHERE))


def explained(readings: np.ndarray) -> Identification:
    """An identification that explains every spectrum by the tint."""
    return made_up(
        check_spectra(GRID, readings, GROUNDS, None, Noise()),
        NAMES,
        [({name: THICKNESS * share for name, share in TINT.items()}, 0.9)],
        film(),
    )


def bands(found: Identification, discrepancy: ModelError) -> np.ndarray:
    """About the explanations, in a search with these errors."""
    options = IdentificationOptions(instrument=INSTRUMENT, discrepancy=discrepancy)
    return expected_bands(found, Searcher.of(GRID, PAINTS, options).task)


@pytest.mark.parametrize(
    "errors",
    [{}, {"level": 0.05}, {"coefficient": 0.05}, {"most": 0.5}, {"gloss_sd": 1e3}],
    ids=["noise", "level", "coefficient", "stated", "free gloss"],
)
def test_bands_are_what_a_linear_fit_of_the_amounts_leaves(errors: dict[str, float]):
    """Covariance less what generalised least squares explains, with slopes by finite
    differences.
    """
    amounts = np.array([*TINT.values()])
    found = explained(film()[None])
    k, s = optical_depths([PAINTS[row] for row in ROWS], THICKNESS * np.eye(2))
    response = film_response(SPHERE)
    body = jax.jit(lambda *film: response.body(*film))

    def read(logs: np.ndarray) -> np.ndarray:
        by_k, by_s = amounts * np.exp(logs.reshape(2, 2))
        return np.asarray(body(by_k @ k, by_s @ s, GROUNDS)).ravel()

    steps = 1e-4 * np.eye(4)
    slopes = np.stack([read(step) - read(-step) for step in steps], axis=-1) / 2e-4
    stated = np.tile(STATED[ROWS].swapaxes(0, 1).reshape(4, -1), 2).T
    alike = np.tile(smooth_kernel(GRID, NEAT.coefficient_length), (2, 2))
    covariance = np.diag(found.measured.noise_sd.ravel() ** 2)
    level, coefficient = (errors.get(name, 0.0) for name in ("level", "coefficient"))
    covariance += slopes @ slopes.T * (level**2 + coefficient**2 * alike)
    if "most" in errors:
        covariance += (stated * slopes) @ (stated * slopes).T * alike
    lever = slopes[:, :2] + slopes[:, 2:]
    if "gloss_sd" in errors:
        lever = np.column_stack([lever, np.ones(len(lever))])
    solved = np.linalg.solve(covariance, lever)
    left = covariance - lever @ np.linalg.solve(lever.T @ solved, lever.T)
    band = bands(found, replace(NEAT, **errors))
    assert_allclose(band[0, 0].ravel(), 1.6448536 * np.sqrt(np.diagonal(left)), rtol=0.01)


def test_bands_hold_the_errors_that_are_stated():
    found = explained(film()[None])

    def mean(**changed) -> float:
        return float(bands(found, ModelError(**{"most": 0.05, **changed})).mean())

    usual = mean()
    assert mean(coefficient=0.2) > 1.2 * usual
    assert mean(amplitude=0.05) > 2 * usual
    # Quantiles of Student's t at .95: 2.015 for 5, 2.132 for 4.
    assert mean(freedom=4.0) == pytest.approx(usual * 2.1318468 / 2.0150484)


def test_bands_about_a_film_over_another_ground_are_of_that_ground():
    stated = explained(film(5e-6)[None])
    dark = next(n for n, condition in enumerate(CONDITIONS) if condition.ground == 0.04)
    below = np.full_like(stated.measured.grounds, 0.04)
    over_dark = replace(stated, measured=replace(stated.measured, grounds=below))
    band = bands(replace(stated, condition=np.array([[dark]])), ModelError())
    assert_allclose(band, bands(over_dark, ModelError()), rtol=1e-6)
    assert np.abs(band / bands(stated, ModelError()) - 1.0).max() > 0.1


def test_bands_of_many_spectra_are_those_of_each():
    """They are computed some spectra at a time."""
    spectra = np.stack([film(20e-6), film(40e-6)])
    many = explained(np.resize(spectra, (70, *spectra.shape[1:])))
    one = bands(many.take(np.array([69])), NEAT)
    assert_allclose(bands(many, NEAT)[69:], one, rtol=1e-6)
