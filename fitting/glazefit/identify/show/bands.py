"""Bands in which readings of a film may lie about an explanation of it: what the stated errors
leave when amounts are fitted.

Noise, the model's own error and errors of the paints' k and s make a covariance of the readings; a
fit of the amounts and of the surface's share takes part of that away. What is left is how far
measured and fitted spectra differ where an explanation is right and the errors are as stated.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.stats import norm, t

from glazejax import Pigment

from ...film.films import Instrument
from ...film.model.errors import (
    ModelError,
    Prior,
    error_modes,
    model_covariance,
    paints_covariance,
    relative_errors,
)
from ...film.model.optics import Optics
from ...film.model.response import film_response
from ..coats.arrangement import Arrangement
from ..coats.readings import CoatedFilms
from ..result import Identification
from ..search.pool import NOBODY
from ..search.refine import slopes_of
from ..search.searcher import check_pigments, opaque_prior
from ..search.table import paints_of


def expected_bands(
    identification: Identification,
    pigments: Sequence[Pigment],
    instrument: Instrument,
    *,
    prior: Prior,
    discrepancy: ModelError,
    count: int = 3,
) -> Float[np.ndarray, "spectra candidates grounds bands"]:
    """Half the width of the 90 % band of the readings about the most probable explanations,
    (spectra, count, ...).

    Args:
        identification: of the spectra.
        pigments: its catalogue.
        instrument: that read the spectra.
        prior: its usual thickness is the unit of amounts, its spread holds amounts that nothing
            determines.
        discrepancy: errors of the model; where a whole spectrum's misfit follows Student's t, the
            band is its.
        count: explanations; fewer if there are fewer.
    """
    measured = identification.measured
    d = discrepancy
    resampled = check_pigments(pigments, measured.wavelengths)
    count = min(count, identification.members.shape[1])
    members = identification.members[:, :count]
    readings = measured.readings.reshape(len(identification), 1, -1)
    slopes = _slopes(identification, resampled, instrument, prior, count)
    off = d.amplitude + d.share * readings
    scaled = model_covariance(measured.wavelengths, measured.readings.shape[1], d, off)
    errors = relative_errors(resampled, d), error_modes(resampled, d)
    scaled = scaled + paints_covariance(slopes, members, *errors, measured.wavelengths, d)
    scale = min(d.scales, key=lambda scale: abs(np.log(scale)))
    noise = measured.noise_sd.reshape(readings.shape) ** 2
    covariance = scale**2 * scaled + noise[..., None] * np.eye(noise.shape[-1])
    # By log amounts: k and s of a paint grow together. The surface's share is an unknown too.
    size = members.shape[-1]
    by_amount = np.where(
        (members == NOBODY)[..., None], 0.0, slopes[..., :size, :] + slopes[..., size:, :]
    )
    # What it adds, in standard deviations.
    sd = max(d.surface_sd(instrument.seen_surface), 1e-9)
    surface = np.full((*by_amount.shape[:2], 1, by_amount.shape[-1]), sd)
    design = np.concatenate([by_amount, surface], axis=-2)
    # What is expected of the total, next to nothing of the fractions, and what of the surface.
    share = np.concatenate(
        [identification.fractions[:, :count], np.zeros((*members.shape[:2], 1))], axis=-1
    )
    spread = (opaque_prior(prior, resampled) if identification.opaque else prior).spread
    prior_precision = share[..., :, None] * share[..., None, :] / spread**2
    # A weight of a tenth holds each log amount to what is expected.
    prior_precision = prior_precision + np.diag([0.1] * size + [1.0])
    solved = np.linalg.solve(covariance, np.swapaxes(design, -1, -2))
    fitted = np.swapaxes(design, -1, -2) @ np.linalg.solve(
        design @ solved + prior_precision, design
    )
    remaining = np.diagonal(covariance, axis1=-2, axis2=-1) - np.diagonal(
        fitted, axis1=-2, axis2=-1
    )
    ends = norm.ppf(0.95) if d.freedom is None else t.ppf(0.95, d.freedom)
    return (float(ends) * np.sqrt(np.maximum(remaining, 0.0))).reshape(
        *members.shape[:2], *measured.readings.shape[1:]
    )


def _slopes(
    identification: Identification,
    pigments: list[Pigment],
    instrument: Instrument,
    prior: Prior,
    count: int,
) -> Float[np.ndarray, "spectra candidates errors readings"]:
    """Slopes of the readings by the log of k, then of s, of the paints of the most probable
    explanations.
    """
    paints = paints_of(pigments, prior.thickness)
    with np.errstate(divide="ignore"):
        logs = np.log(identification.amounts[:, :count] / prior.thickness)
    sets = identification.members[:, :count]
    coats = identification.coats[:, :count]
    response = film_response(instrument.geometry, instrument.refractive_index)
    ground = identification.measured.grounds
    row = np.repeat(np.arange(len(identification)), count)
    # Films of one coat by the table.
    slopes = slopes_of(
        response, paints, sets.reshape(len(row), -1), logs.reshape(len(row), -1), ground, row
    )
    slopes = np.array(slopes).reshape(*sets.shape[:2], *slopes.shape[1:])
    # Films of two coats by the solver, in the places of their paints.
    optics = Optics.of(instrument.geometry, instrument.refractive_index)
    for spectrum, candidate in np.argwhere((coats > 0).any(axis=-1)):
        at = spectrum, candidate
        size = int((sets[at] != NOBODY).sum())
        members = sets[at][:size]
        upper, lower = (np.flatnonzero(coats[at][:size] == n).tolist() for n in (0, 1))
        arrangement = Arrangement((tuple(upper), tuple(lower)))
        films = CoatedFilms(
            coefficients=np.array([np.asarray(coefficient)[members] for coefficient in paints]),
            grounds=ground[spectrum],
            optics=optics,
            response=response,
        )
        _, by_log = films.read_and_slopes(arrangement, np.exp(logs[at][None, :size]))
        errors = [*range(size), *range(sets.shape[-1], sets.shape[-1] + size)]
        slopes[(*at, errors)] = by_log[0]
    return slopes
