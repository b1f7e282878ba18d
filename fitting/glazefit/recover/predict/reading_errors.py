"""Errors of readings of one mixture around its k and s: surface, gain and model; and how much of
that holds for the same film over another card.
"""

from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from ...film.model.errors import ModelError, draw_model_errors
from ...film.model.response import Response
from ..joint.problem import Expectations, Unknowns, readings_of_draws
from ..joint.result import JointRecovery

SMOOTH = ModelError(amplitude=1.0, length=60.0, shared=0.8)
"""Errors of the model, of size one: similar at neighbouring bands."""


@dataclass(frozen=True)
class ReadingErrors:
    """Errors of readings of a mixture, by their surface, their gain, and the model.

    One draw of them holds for films of every thickness. A film that was read, over another card,
    is off as its reading was, as far as the two have a `correlation`.

    Attributes:
        calibrated: what was found.
        correlation: of errors of one film over two cards.
        was: of what was read, in standard deviations of gain and model, (films, 2, bands).
        drawn: the same for each draw of what is unknown, (draws, films, 2, bands).
        reach: how much of what a reading was off is gain and model, no noise: the ratio of their
            standard deviations, (films, 2, bands); 0 where nothing was read.
        gloss: what the surface's reflection is off, (draws, 1, 1).
        gain: in standard deviations, of films that were not read, (draws, 2, 1);
        model: and what the model is off, (draws, 2, bands).
    """

    calibrated: JointRecovery
    correlation: float
    was: Float[np.ndarray, "films 2 bands"]
    drawn: Float[np.ndarray, "draws films 2 bands"]
    reach: Float[np.ndarray, "films 2 bands"]
    gloss: Float[np.ndarray, "draws 1 1"]
    gain: Float[np.ndarray, "draws 2 1"]
    model: Float[np.ndarray, "draws 2 bands"]

    @classmethod
    def of(
        cls, calibrated: JointRecovery, response: Response, correlation: float
    ) -> "ReadingErrors":
        """Errors of what was read, and draws for what was not.

        Args:
            calibrated: what was found.
            response: model of one film.
            correlation: of errors of one film over two cards.
        """
        films = calibrated.films
        # Readings by the solution and by each draw: what the measured ones differ by is error.
        best = jax.tree.map(lambda leaf: np.asarray(leaf)[None], calibrated.unknowns)
        expected = _readings_of(calibrated, response, best)
        several = _readings_of(calibrated, response, calibrated.draws)
        read = np.stack([films.over_black, films.over_white], axis=1)
        sd = _error_size(calibrated.expectations, expected[0])
        # Noise and cards are in the residual's size, and a gain of its own is not.
        all_of_it = np.hypot(calibrated.residual_sd, calibrated.expectations.gain * expected[0])
        log_gloss = calibrated.draws.paints[:, 0] + calibrated.draws.films[:, 0, 1]
        rng = np.random.default_rng(1)
        count = len(log_gloss)
        return cls(
            calibrated=calibrated,
            correlation=correlation,
            was=(read - expected[0]) / all_of_it,
            drawn=(read - several) / all_of_it,
            reach=np.minimum(sd / all_of_it, 1.0) * films.seen[:, :, None],
            gloss=(np.exp(log_gloss) - calibrated.gloss[0])[:, None, None],
            gain=rng.standard_normal((count, 2, 1)),
            model=draw_model_errors(rng, count, 2, calibrated.wavelengths, SMOOTH),
        )

    def at(
        self, thickness: float, expected: Float[np.ndarray, "2 bands"]
    ) -> tuple[Float[np.ndarray, "2 bands"], Float[np.ndarray, "draws 2 bands"]]:
        """Expected errors of readings of a film, and each draw's deviation from them.

        Args:
            thickness: relative.
            expected: reflectance over black and white, (2, bands).
        """
        calibrated = self.calibrated
        size = calibrated.expectations
        new = size.gain * expected * self.gain + size.model_sd(expected) * self.model
        surface = calibrated.instrument.seen_surface * self.gloss
        through = np.flatnonzero(~calibrated.films.opaque)
        if through.size == 0:
            return np.zeros_like(expected), surface + new
        distances = np.abs(np.log(calibrated.thickness[through] / thickness))
        film = through[distances.argmin()]
        # A film as thick as the one that was read is that film. With thickness a tenth off, as a
        # standard deviation, less and less of the reading's errors goes.
        same = self.correlation * np.exp(-0.5 * (distances.min() / 0.1) ** 2)
        # Simple kriging (Journel, Huijbregts, Mining Geostatistics, 1978), band by band, from what
        # was read over one card or two.
        reach = self.reach[film].T  # (bands, 2)
        card_covariance = self.correlation * reach[:, :, None] * reach[:, None, :]
        card_covariance = card_covariance + np.eye(2) * (
            1.0 - self.correlation * reach[:, :, None] ** 2
        )
        towards = same * reach
        share = np.linalg.solve(card_covariance, towards[:, :, None])[:, :, 0]
        remaining = np.sqrt(np.maximum(1.0 - np.sum(share * towards, axis=1), 0.0))
        sd = _error_size(size, expected)
        shift = sd * np.einsum("bc,cb->b", share, self.was[film])
        drawn = sd * np.einsum("bc,dcb->db", share, self.drawn[:, film])[:, None]
        return shift, surface + (drawn - shift) + remaining * new


def _error_size(
    expected: Expectations, reflectance: Float[np.ndarray, "*n bands"]
) -> Float[np.ndarray, "*n bands"]:
    """Standard deviation of a reading by its gain and by the model."""
    return np.hypot(expected.gain * reflectance, expected.model_sd(reflectance))


def _readings_of(
    calibrated: JointRecovery, response: Response, draws: Unknowns
) -> Float[np.ndarray, "draws films 2 bands"]:
    """Readings that the films that were read should have given, by draws of the unknowns, without a
    gain.
    """
    problem = calibrated.problem
    ungained = problem._replace(gain_modes=np.zeros_like(problem.gain_modes))
    return np.moveaxis(np.asarray(readings_of_draws(draws, ungained, response)), 1, -1)


def film_readings(
    response: Response,
    kd: Float[np.ndarray, "bands"],
    sd: Float[np.ndarray, "bands"],
    off: Float[np.ndarray, "draws 2 bands"],
    grounds: tuple[Float[np.ndarray, "bands"] | Float[np.ndarray, "draws bands"], ...],
) -> Float[np.ndarray, "draws 2 bands"]:
    """Reflectance of the body over two grounds, with errors of log k and log s."""
    k = kd * np.exp(off[:, 0])
    s = sd * np.exp(off[:, 1])
    return np.stack(
        [np.asarray(response.body(k, s, np.broadcast_to(g, k.shape))) for g in grounds], axis=1
    )
