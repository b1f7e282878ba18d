"""What a further reading of a mixture would teach, beside those that it was calibrated by.

Draws of what is still open give both what the further reading may be and what is sought: the colour
of some films. What the reading would leave open follows by Matheron's rule: each draw of what is
sought, less its regression on what that reading would have been, noise and all (Journel,
Huijbregts, Mining Geostatistics, 1978). To first order that is the expected information, whatever
the reading turns out to be.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from glazejax.colour import delta_e_of_spectra
from glazejax.geometry import resolve_instrument

from ..film.films import InstrumentLike, usual_cards
from ..film.model.response import Response, film_response
from .experimental_design import NextFilm, NextFilms
from .joint import UNIT
from .joint_result import JointRecovery
from .mixture import drawn_mixture
from .reading_errors import film_readings

# Bands that a reading counts with: neighbours tell the same.
_BANDS = 8
_TIMES = (0.5, 2.0)
_HIDES = 200.0


class _Candidate(NamedTuple):
    words: str
    times: float
    cards: tuple[int, ...]
    anew: bool


def rank_next_readings(
    calibrated: JointRecovery,
    thickness: Sequence[float],
    *,
    ground: tuple[Float[np.ndarray, "bands"], Float[np.ndarray, "bands"]] | None = None,
    instrument: InstrumentLike | None = None,
    response: Response | None = None,
) -> NextFilms:
    """Further readings of a mixture, in the order of what they would teach.

    Args:
        calibrated: what `glazefit.recover.mixture.calibrate_mixture` found by one film.
        thickness: m, of the films whose colours over black and white are sought; on the scale of
            the film that was read.
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
    own = float(calibrated.thickness[0]) * UNIT

    def bodies(metres: float, more: Float[np.ndarray, "draws"]) -> np.ndarray:
        return film_readings(
            response, k * metres, s * metres, off + more[:, None, None], grounds
        ).reshape(len(off), 2, -1)

    rng = np.random.default_rng(2)
    alike = np.zeros(len(off))
    other = calibrated.expectations.thickness * rng.standard_normal(len(off))
    sought = np.stack([bodies(metres, alike) for metres in thickness], axis=1)
    middle = sought.mean(axis=0)
    bands = np.unique(np.linspace(0, grid.size - 1, min(_BANDS, grid.size)).round().astype(int))

    def expected(drawn: np.ndarray) -> float:
        return float(np.mean(delta_e_of_spectra(grid, drawn, middle, observer=10)))

    found = []
    for candidate in _candidates(calibrated):
        seen = bodies(candidate.times * own, other if candidate.anew else alike)
        seen = seen[:, list(candidate.cards)][:, :, bands].reshape(len(off), -1)
        sd = np.hypot(
            calibrated.noise.sd(seen.mean(axis=0)),
            calibrated.expectations.model_floor
            + calibrated.expectations.model_share * seen.mean(axis=0),
        )
        read = seen + sd * rng.standard_normal(seen.shape)
        left = _given(sought.reshape(len(off), -1), seen - seen.mean(axis=0), read, sd)
        rest = np.maximum(left.reshape(sought.shape), 0.0)
        found.append(NextFilm(candidate.words, expected(rest)))
    return NextFilms(
        calibrated.paints[0],
        expected(sought),
        tuple(sorted(found, key=lambda film: film.expected)),
    )


def _given(
    sought: Float[np.ndarray, "draws n"],
    off: Float[np.ndarray, "draws m"],
    read: Float[np.ndarray, "draws m"],
    sd: Float[np.ndarray, "m"],
) -> Float[np.ndarray, "draws n"]:
    """Draws of what is sought as a reading leaves them: less their regression on it."""
    both = off.T @ off / len(off) + np.diag(sd**2)
    across = off.T @ (sought - sought.mean(axis=0)) / len(off)
    return sought - (read - read.mean(axis=0)) @ np.linalg.solve(both, across)


def _candidates(calibrated: JointRecovery) -> list[_Candidate]:
    """Readings that are easily taken and were not."""
    films = calibrated.films
    made = []
    if not films.opaque[0]:
        made += [
            _Candidate(f"the same film over {card}", 1.0, (number,), anew=False)
            for number, card in enumerate(("black", "white"))
            if not films.seen[0, number]
        ]
        made.append(_Candidate("a film that hides what is below it", _HIDES, (0,), anew=True))
    made += [
        _Candidate(f"a film {words} as thick over black and white", times, (0, 1), anew=True)
        for times, words in zip(_TIMES, ("half", "twice"), strict=True)
    ]
    return made
