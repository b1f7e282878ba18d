"""Errors of readings of one mixture around its k and s: surface, gain and model; and how much of
that holds for the same film over another card.
"""

from collections.abc import Callable, Sequence

import jax
import numpy as np
from jaxtyping import Float

from glazejax.spectra import Bands

from ...film.model.errors import ModelError, draw_model_errors
from ...film.model.response import Response
from ..joint.problem import Expectations, readings_of_draws
from ..joint.result import JointRecovery
from .prediction import CardSpectra, DrawnSpectra

SMOOTH = ModelError(amplitude=1.0, length=60.0, shared=0.8)
"""Errors of the model, of size one: similar at neighbouring bands."""


ErrorsAt = Callable[[float, CardSpectra], tuple[CardSpectra, DrawnSpectra]]
"""Expected errors of readings of a film, and each draw's deviation from them, by its relative
thickness and its reflectance over black and white.
"""


def reading_errors(calibrated: JointRecovery, correlation: float) -> ErrorsAt:
    """Errors of readings of a mixture, by their surface, their gain, and the model.

    One draw of them holds for films of every thickness. A film that was read, over another card,
    is off as its reading was, as far as the two are correlated.

    Args:
        calibrated: fit of what was read.
        correlation: of errors of one film over two cards.
    """
    films = calibrated.films
    size = calibrated.expectations
    # Readings that the films should have given without a gain, by the solution and by each draw:
    # what the measured ones differ by is error.
    ungained = calibrated.problem._replace(gain_modes=np.zeros_like(calibrated.problem.gain_modes))
    points = jax.tree.map(
        lambda best, draws: np.concatenate([best[None], draws]),
        calibrated.unknowns,
        calibrated.draws,
    )
    computed = np.moveaxis(np.asarray(readings_of_draws(points, ungained)), 1, -1)
    expected = computed[0]
    # Noise and cards are in the residual's size, and a gain of its own is not.
    all_of_it = np.hypot(calibrated.residual_sd, size.gain * expected)
    # In standard deviations: by the solution, and by each draw of what is unknown.
    off = (films.over_cards - computed) / all_of_it
    # How much of what a reading was off is gain and model, no noise; nothing where none was read.
    reach = np.minimum(_error_size(size, expected) / all_of_it, 1.0) * films.seen[:, :, None]
    log_gloss = calibrated.draws.paints[:, 0] + calibrated.draws.films[:, 0, 1]
    gloss = (np.exp(log_gloss) - calibrated.gloss[0])[:, None, None]
    surface = calibrated.instrument.seen_surface * gloss
    # Of films that were not read.
    rng = np.random.default_rng(1)
    gain = rng.standard_normal((len(gloss), 2, 1))
    model = draw_model_errors(rng, len(gloss), 2, calibrated.wavelengths, SMOOTH)
    through = np.flatnonzero(~films.opaque)

    def errors_at(thickness: float, expected: CardSpectra) -> tuple[CardSpectra, DrawnSpectra]:
        new = size.gain * expected * gain + size.model_sd(expected) * model
        if through.size == 0:
            return np.zeros_like(expected), surface + new
        distances = np.abs(np.log(calibrated.thickness[through] / thickness))
        film = through[distances.argmin()]
        # A film as thick as the one that was read is that film. With thickness a tenth off, as a
        # standard deviation, less and less of the reading's errors goes.
        same = correlation * np.exp(-0.5 * (distances.min() / 0.1) ** 2)
        # Simple kriging (Journel, Huijbregts, Mining Geostatistics, 1978), band by band, from what
        # was read over one card or two.
        reached = reach[film].T  # (bands, 2)
        card_covariance = correlation * reached[:, :, None] * reached[:, None, :]
        card_covariance[:, [0, 1], [0, 1]] = 1.0
        towards = same * reached
        share = np.linalg.solve(card_covariance, towards[:, :, None])[:, :, 0]
        remaining = np.sqrt(np.maximum(1.0 - np.sum(share * towards, axis=1), 0.0))
        kept = np.einsum("bc,dcb->db", share, off[:, film])[:, None]
        kept = kept * _error_size(size, expected)
        shift = kept[0]
        return shift, surface + (kept[1:] - shift) + remaining * new

    return errors_at


def _error_size(
    expected: Expectations, reflectance: Float[np.ndarray, "*n bands"]
) -> Float[np.ndarray, "*n bands"]:
    """Standard deviation of a reading by its gain and by the model."""
    return np.hypot(expected.gain * reflectance, expected.model_sd(reflectance))


def film_readings(
    response: Response,
    kd: Bands,
    sd: Bands,
    off: Float[np.ndarray, "draws 2 bands"],
    grounds: Sequence[float | Bands],
) -> DrawnSpectra:
    """Reflectance of the body over two grounds, with errors of log k and log s."""
    k = kd * np.exp(off[:, :1])
    s = sd * np.exp(off[:, 1:])
    ground = np.stack([np.broadcast_to(each, kd.shape) for each in grounds])
    return np.asarray(response.body(k, s, ground))
