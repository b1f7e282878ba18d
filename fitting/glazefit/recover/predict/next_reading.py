"""Rank readings that are easily taken by what they would teach: of a mixture that was calibrated by
one film here, of a paint that was fitted in `experimental_design`.

Draws of what is still open give both what each candidate would read and the target: the colour
of some films. What a reading would leave open follows by Matheron's rule: each draw, less its
regression on what that reading would have been, noise and all (Journel, Huijbregts, Mining
Geostatistics, 1978). To first order that is the expected information, whatever the reading turns
out to be.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from glazejax.colour import delta_e_of_spectra
from glazejax.geometry import resolve_instrument
from glazejax.spectra import Bands

from ...film.films import InstrumentLike, usual_cards
from ...film.model.response import Response, film_response
from ..joint.joint import UNIT
from ..joint.problem import model_deviation
from ..joint.result import JointRecovery
from .mixture import drawn_mixture
from .reading_errors import film_readings


@dataclass(frozen=True)
class CandidateReading:
    """A reading that may be taken next.

    Attributes:
        film: what is read, in words.
        readings: that each draw of what is open would give, (draws, readings).
        sd: standard deviation of each reading's own error, (readings,).
        expected: CIEDE2000 (D65, 10 degrees) that the target is expected to be off after it.
    """

    film: str
    readings: Float[np.ndarray, "draws readings"]
    sd: Float[np.ndarray, "readings"]
    expected: float = np.nan


@dataclass(frozen=True)
class NextFilms:
    """Gain of further readings of one paint or mixture.

    Attributes:
        now: CIEDE2000 (D65, 10 degrees) that the target is expected to be off.
        films: candidates, the most instructive first.
    """

    now: float
    films: tuple[CandidateReading, ...]


def reading_bands(bands: int, most: int) -> np.ndarray:
    """Numbers of the bands, of so many, that a reading counts with: neighbours have the same
    information."""
    return np.unique(np.linspace(0, bands - 1, min(most, bands)).round().astype(int))


def rank_candidates(
    candidates: Sequence[CandidateReading],
    draws: Float[np.ndarray, "draws *open"],
    looks: Callable[[np.ndarray], Float[np.ndarray, "draws films bands"]],
    wavelengths: Bands,
) -> NextFilms:
    """Candidates in the order of what they would teach.

    Args:
        candidates: each with a reading for each draw.
        draws: of what is open.
        looks: reflectance of the target films, for any draws.
        wavelengths: of that reflectance, nm.
    """
    rng = np.random.default_rng(2)
    centre = draws.mean(axis=0)
    middle = looks(centre[None])[0]

    def expected(remaining: np.ndarray) -> float:
        # The regression needs all draws, a mean of colours few.
        spectra = looks(remaining[:128])
        return float(np.mean(delta_e_of_spectra(wavelengths, spectra, middle, observer=10)))

    def after(candidate: CandidateReading) -> float:
        # Covariance of the candidate's readings, noise and all, and theirs with what is open.
        off = candidate.readings - candidate.readings.mean(axis=0)
        reading_covariance = off.T @ off / len(draws) + np.diag(candidate.sd**2)
        open_covariance = off.T @ (draws - centre).reshape(len(draws), -1) / len(draws)
        # Each draw less its regression on its own noisy reading.
        read = off + candidate.sd * rng.standard_normal(off.shape)
        known = (read - read.mean(axis=0)) @ np.linalg.solve(reading_covariance, open_covariance)
        return expected(draws - known.reshape(draws.shape))

    films = [replace(candidate, expected=after(candidate)) for candidate in candidates]
    return NextFilms(expected(draws), tuple(sorted(films, key=lambda film: film.expected)))


def rank_next_readings(
    calibrated: JointRecovery,
    thickness: Sequence[float],
    *,
    ground: tuple[Bands, Bands] | None = None,
    instrument: InstrumentLike | None = None,
    response: Response | None = None,
) -> NextFilms:
    """Further readings of a mixture, in the order of what they would teach.

    Args:
        calibrated: what `glazefit.recover.predict.mixture.calibrate_mixture` found by one film.
        thickness: m, of the films whose colours over black and white are the target; on the scale
            of the film that was read.
        ground: internal reflectance of the black and the white ground, (bands,) each.
        instrument: by default d:8 with the specular part, refractive index 1.5.
        response: model of one film, by default that of the instrument.

    Returns:
        CIEDE2000 (D65, 10 degrees) to be expected now and with each further reading.
    """
    response = response or film_response(resolve_instrument(instrument))
    grid = calibrated.wavelengths
    grounds = usual_cards(grid) if ground is None else ground
    k, s = calibrated.absorption[0] / UNIT, calibrated.scattering[0] / UNIT
    off = drawn_mixture(calibrated)
    # Another film of it is as thick as was meant to within this.
    thickness_errors = calibrated.expectations.thickness * np.random.default_rng(2).standard_normal(
        len(off)
    )
    # Few bands stand for all: neighbours have the same information.
    bands = reading_bands(grid.size, 8)

    def bodies(metres: float, off: np.ndarray) -> np.ndarray:
        return film_readings(response, k * metres, s * metres, off, grounds)

    def looks(draws: np.ndarray) -> np.ndarray:
        return np.concatenate([bodies(metres, draws) for metres in thickness], axis=1)

    def candidate(
        name: str, cards: list[int], times: float = 1.0, *, another: bool
    ) -> CandidateReading:
        varied = off + thickness_errors[:, None, None] if another else off
        readings = bodies(times * float(calibrated.thickness[0]) * UNIT, varied)
        readings = readings[:, cards][:, :, bands].reshape(len(off), -1)
        mean = readings.mean(axis=0)
        sd = model_deviation(mean, calibrated.noise, calibrated.expectations)
        return CandidateReading(name, readings, sd)

    # Readings that are easily taken and were not, by words, by numbers of the cards, and by how
    # many times the film is as thick as that which was read.
    films = calibrated.films
    candidates = [
        candidate(f"the same film over {card}", [number], another=False)
        for number, card in enumerate(("black", "white"))
        if not films.opaque[0] and not films.seen[0, number]
    ]
    if not films.opaque[0]:
        candidates.append(candidate("an opaque film", [0], 200.0, another=True))
    candidates += [
        candidate(f"a film {label} as thick over black and white", [0, 1], times, another=True)
        for times, label in ((0.5, "half"), (2.0, "twice"))
    ]
    return rank_candidates(candidates, off, looks, grid)
