"""Bands in which readings of a film may lie about an explanation of it: what the stated errors
leave when amounts are fitted.

Noise, the model's own error and errors of the paints' k and s make a covariance of the readings; a
fit of the amounts and of the surface's share takes part of that away. What is left is how far
measured and fitted spectra differ where an explanation is right and the errors are as stated.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.stats import t

from glazejax.radiative.common.chunks import pieces_of

from ..coats.arrangement import Arrangement
from ..coats.readings import CoatedFilms
from ..result import Identification
from ..search.candidates import CHUNK
from ..search.pool import NOBODY
from ..search.refine import paints_covariance, slopes_at, slopes_by_amount
from ..search.task import Chunk, IdentificationTask, diagonal_covariance
from ..search.unstated_conditions import CONDITIONS
from .explanation import FITS


def expected_bands(
    identification: Identification, task: IdentificationTask
) -> Float[np.ndarray, "spectra candidates grounds bands"]:
    """Half the width of the 90 % band of the readings about the most probable explanations,
    (spectra, candidates, ...): those that are drawn. Of a film under a varnish, that of the film
    without it.

    A whole spectrum's misfit follows Student's t, and so does the band.

    Args:
        identification: of the spectra.
        task: of the search.
    """
    chunks = pieces_of(np.arange(len(identification)), CHUNK)
    return np.concatenate([_bands(identification.take(chunk), task) for chunk in chunks])


def _bands(
    identification: Identification, task: IdentificationTask
) -> Float[np.ndarray, "spectra candidates grounds bands"]:
    """Of a few spectra."""
    measured = identification.measured
    members = identification.members[:, :FITS]
    slopes = _slopes(identification, task)
    same = Chunk(task, measured).smooth_covariance + diagonal_covariance(measured.noise_sd)
    covariance = paints_covariance(task, slopes, members) + same[:, None]
    # The surface's share is an unknown too.
    by_amount = slopes_by_amount(slopes)
    # What it adds, in standard deviations.
    sd = max(task.surface_sd, 1e-9)
    surface = np.full((*by_amount.shape[:2], 1, by_amount.shape[-1]), sd)
    design = np.concatenate([by_amount, surface], axis=-2)
    # What is expected of the total, next to nothing of the fractions, and what of the surface.
    share = np.pad(identification.fractions[:, :FITS], ((0, 0), (0, 0), (0, 1)))
    prior_precision = share[..., :, None] * share[..., None, :] / task.prior.spread**2
    # A weight of a tenth holds each log amount to what is expected.
    prior_precision = prior_precision + np.diag([0.1] * members.shape[-1] + [1.0])
    solved = np.linalg.solve(covariance, np.swapaxes(design, -1, -2))
    fitted = np.linalg.solve(design @ solved + prior_precision, design)
    remaining = np.diagonal(covariance, axis1=-2, axis2=-1) - np.sum(design * fitted, axis=-2)
    ends = float(t.ppf(0.95, task.discrepancy.freedom))
    return (ends * np.sqrt(np.maximum(remaining, 0.0))).reshape(
        *members.shape[:2], *measured.readings.shape[1:]
    )


def _slopes(
    identification: Identification, task: IdentificationTask
) -> Float[np.ndarray, "spectra candidates errors readings"]:
    """Slopes of the readings by the log of k, then of s, of the paints of the most probable
    explanations.
    """
    with np.errstate(divide="ignore"):
        logs = np.log(identification.amounts[:, :FITS] / task.prior.thickness)
    sets = identification.members[:, :FITS]
    coats = identification.coats[:, :FITS]
    # Films of one coat by the table, each over the ground that it was searched over.
    row = np.repeat(np.arange(len(identification)), sets.shape[1])
    measured = identification.measured.take(row)
    levels = np.array([condition.ground for condition in CONDITIONS], dtype=float)
    level = levels[identification.condition[:, :FITS]].reshape(-1, 1, 1)
    grounds = np.where(np.isnan(level), measured.grounds, level)
    chunk = Chunk(task, replace(measured, grounds=grounds))
    films = np.arange(len(row))
    slopes = slopes_at(chunk, sets.reshape(len(row), -1), logs.reshape(len(row), -1), films)
    slopes = np.array(slopes).reshape(*sets.shape[:2], *slopes.shape[1:])
    # Films of two coats by the solver, in the places of their paints.
    for spectrum, candidate in np.argwhere((coats > 0).any(axis=-1)):
        at = spectrum, candidate
        size = int((sets[at] != NOBODY).sum())
        members = sets[at][:size].tolist()
        films = CoatedFilms.of(task, members, identification.measured.grounds[spectrum])
        upper, lower = (np.flatnonzero(coats[at][:size] == n).tolist() for n in (0, 1))
        arrangement = Arrangement((tuple(upper), tuple(lower)))
        _, by_log = films.read_and_slopes(arrangement, np.exp(logs[at][None, :size]))
        errors = [*range(size), *range(sets.shape[-1], sets.shape[-1] + size)]
        slopes[*at, errors] = by_log[0]
    return slopes
