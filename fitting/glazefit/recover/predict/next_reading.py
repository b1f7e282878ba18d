"""Rank readings that are easily taken by what they would teach: of a mixture that was calibrated by
one film, and of a paint that was fitted with others.

Draws of what is still open give both what each candidate would read and the target: the colour
of some films. What a reading would leave open follows by Matheron's rule: each draw, less its
regression on what that reading would have been, noise and all (Journel, Huijbregts, Mining
Geostatistics, 1978). To first order that is the expected information, whatever the reading turns
out to be.

The readings of a further film of a fitted paint are linearised at the solution. They follow what
the fit leaves open of the paints, and unknowns of the film's own: thickness, gloss and the error of
its weights. What remains open is judged by what matters in use: the colour difference that is to be
expected of the paint's opaque mixtures with white, and of a film over black and over white.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax import Pigment
from glazejax.colour import delta_e_of_spectra
from glazejax.geometry import resolve_instrument
from glazejax.spectra import Bands, lie_between

from ...film.films import InstrumentLike, card_readings, check_ground, usual_cards
from ...film.model.response import Response, film_response, hiding_factor
from ..joint.joint import UNIT
from ..joint.pose import error_modes
from ..joint.problem import FilmShares, JointProblem, Unknowns, model_deviation, readings
from ..joint.result import JointRecovery, by_paint
from .mixture import drawn_mixture, film_readings


@dataclass(frozen=True)
class CandidateReading:
    """A reading that may be taken next.

    Attributes:
        film: what is read, in words.
        readings: that each draw of what is open would give, (draws, readings).
        sd: standard deviation of each reading's own error, (readings,).
        expected: CIEDE2000 that the target is expected to be off after it.
    """

    film: str
    readings: Float[np.ndarray, "draws readings"]
    sd: Float[np.ndarray, "readings"]
    expected: float = np.nan


@dataclass(frozen=True)
class NextFilms:
    """Gain of further readings of one paint or mixture.

    Attributes:
        now: CIEDE2000 that the target is expected to be off.
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
    eye: tuple[str, str | int] = ("D65", 10),
) -> NextFilms:
    """Candidates in the order of what they would teach.

    Args:
        candidates: each with a reading for each draw.
        draws: of what is open.
        looks: reflectance of the target films, for any draws.
        wavelengths: of that reflectance, nm.
        eye: illuminant and observer by which films are judged.
    """
    rng = np.random.default_rng(2)
    illuminant, observer = eye
    centre = draws.mean(axis=0)
    middle = looks(centre[None])[0]

    def expected(remaining: np.ndarray) -> float:
        # The regression needs all draws, a mean of colours few.
        spectra = looks(remaining[:128])
        off = delta_e_of_spectra(
            wavelengths, spectra, middle, illuminant=illuminant, observer=observer
        )
        return float(np.mean(off))

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
    illuminant: str = "D65",
    observer: str | int = 10,
) -> NextFilms:
    """Further readings of a mixture, in the order of what they would teach.

    Args:
        calibrated: what `glazefit.recover.predict.mixture.calibrate_mixture` found by one film.
        thickness: m, of the films whose colours over black and white are the target; on the scale
            of the film that was read.
        ground: internal reflectance of the black and the white ground, (bands,) each.
        instrument: by default that of the fit.
        response: model of one film, by default that of the instrument, or of the fit.
        illuminant, observer: by which colours are judged.

    Returns:
        CIEDE2000 to be expected now and with each further reading.

    Raises:
        ValueError: a reflectance of a ground that is not in [0, 1], an unknown illuminant or
            observer, or a grid that covers no colour.
    """
    for reflectance in () if ground is None else ground:
        check_ground(reflectance)
    if instrument is not None:
        response = response or film_response(resolve_instrument(instrument))
    response = response or calibrated.problem.response
    grid = calibrated.wavelengths
    grounds = usual_cards(grid) if ground is None else ground
    coefficients = np.exp(calibrated.unknowns.bands.T) / UNIT
    off = drawn_mixture(calibrated)
    # Another film of it is as thick as was meant to within this.
    thickness_errors = calibrated.expectations.thickness * np.random.default_rng(2).standard_normal(
        len(off)
    )
    # Few bands stand for all: neighbours have the same information.
    bands = reading_bands(grid.size, 8)

    def bodies(metres: float, off: np.ndarray) -> np.ndarray:
        return film_readings(response, coefficients * metres, off, grounds)

    def looks(draws: np.ndarray) -> np.ndarray:
        return np.concatenate([bodies(metres, draws) for metres in thickness], axis=1)

    def candidate(name: str, cards: list[int], times: float) -> CandidateReading:
        # Only the film that was read is as thick as it was found.
        varied = off if times == 1.0 else off + thickness_errors[:, None, None]
        readings = bodies(times * float(calibrated.thickness[0]) * UNIT, varied)
        readings = readings[:, cards][:, :, bands].reshape(len(off), -1)
        mean = readings.mean(axis=0)
        sd = model_deviation(mean, calibrated.noise, calibrated.expectations)
        return CandidateReading(name, readings, sd)

    # Readings that are easily taken and were not, by words, by numbers of the cards, and by how
    # many times the film is as thick as that which was read.
    films = calibrated.films
    candidates = [
        candidate(f"the same film over {card}", [number], 1.0)
        for number, card in enumerate(("black", "white"))
        if not films.opaque[0] and not films.seen[0, number]
    ]
    if not films.opaque[0]:
        candidates.append(candidate("an opaque film", [0], 200.0))
    candidates += [
        candidate(f"a film {label} as thick over black and white", [0, 1], times)
        for times, label in ((0.5, "half"), (2.0, "twice"))
    ]
    return rank_candidates(candidates, off, looks, grid, (illuminant, observer))


class _PlannedFilms(NamedTuple):
    """Films that are easily made and were not."""

    names: list[str]
    shares: FilmShares
    thickness: Float[np.ndarray, "films"]  # log


def rank_next_films(
    recovery: JointRecovery,
    paint: str,
    *,
    white: Pigment | None = None,
) -> NextFilms:
    """Further films of a paint, in the order of what they would teach.

    Args:
        recovery: joint fit.
        paint: one of its paints.
        white: what tints would be made with, if the fit holds no white.

    Raises:
        ValueError: no such paint.
    """
    # The white of the tints: one of the fit, or one that stands in for it.
    row = recovery.row(paint)
    whites = _whites(recovery)
    pale = next((name for name in (*recovery.known, *whites) if name in whites), None)
    stand_in = None
    if pale is None and white is not None and white.name not in recovery.paints:
        stand_in = white
        pale = white.name
    elif pale == paint:
        pale = None
    depth = float(recovery.depth(recovery.unknowns.films))
    plan = _plan(recovery, row, pale, depth)
    # Planned with are visible bands, some thirty.
    bands = np.flatnonzero(lie_between(recovery.wavelengths, 400.0, 700.0))
    bands = bands if bands.size > 2 else np.arange(recovery.wavelengths.size)
    bands = bands[reading_bands(bands.size, 31)]
    grid = recovery.wavelengths[bands]
    rows = [row, recovery.row(pale)] if pale in recovery.paints else [row]
    draws = _draw_plan(recovery, rows, bands, plan, stand_in)
    # Over the cards of the first film.
    card_data = card_readings(recovery.films, recovery.instrument, recovery.noise)
    ground_sd = card_data.ground_sd[0, bands]
    films, paints = plan.shares.shape
    no_modes = np.zeros((0, films, 2))
    planned = recovery.problem._replace(
        ground=recovery.problem.ground[bands, :1],
        shares=plan.shares,
        # Of a tint the paint is the smaller part, and what weighing leaves open is its own.
        minor=np.broadcast_to(np.eye(1, paints), (films, 1, paints)),
        opaque=np.zeros(films, dtype=bool),
        gloss=np.full(films, np.nan),
        ground_modes=no_modes,
        gain_modes=no_modes,
    )
    expected, moves = map(np.asarray, _linear_readings(draws, planned))
    # The fewer bands stand for all; with 8 a tint is thought to teach half as much.
    read = reading_bands(grid.size, 16)
    thinning = np.sqrt(recovery.wavelengths.size / read.size)
    deviation = model_deviation(expected, recovery.noise, recovery.expectations, ground_sd.T)
    candidates = [
        CandidateReading(
            name,
            moves[:, film][:, :, read].reshape(len(moves), -1),
            deviation[film][:, read].ravel() / thinning,
        )
        for film, name in enumerate(plan.names)
    ]
    # Parts of white to one of paint that the paint is judged by.
    judged = [_tint(white_parts) for white_parts in (1.0, 3.0, 10.0, 30.0) if pale is not None]
    mixtures = np.stack([plan.shares[0], *judged])

    def looks(logs: np.ndarray) -> np.ndarray:
        coefficients = by_paint(logs)
        return np.asarray(_reflectances(coefficients, mixtures, np.exp(depth), planned.response))

    return rank_candidates(candidates, draws.bands[1:], looks, grid)


def _tint(white_parts: float) -> Float[np.ndarray, "2"]:
    """Shares of the paint and of the white, of so many parts of white to one of paint."""
    return np.array([1.0, white_parts]) / (1.0 + white_parts)


def _whites(recovery: JointRecovery) -> list[str]:
    """Paints whose opaque films are bright at all bands, the brightest first."""
    albedo = recovery.scattering / (recovery.scattering + recovery.absorption)
    # Of an opaque, isotropically scattering film (Hapke's approximation).
    root = np.sqrt(1.0 - albedo)
    # A yellow is bright at most bands; whites absorb in the violet, at fewer than these.
    bright = np.quantile((1.0 - root) / (1.0 + root), 0.15, axis=1)
    return [recovery.paints[i] for i in np.argsort(-bright) if bright[i] > 0.5]


def _plan(recovery: JointRecovery, row: int, pale: str | None, depth: float) -> _PlannedFilms:
    """Thinner and thicker films of the paint, and tints of it with the white."""
    paint = recovery.paints[row]
    pure = np.eye(1 if pale is None else 2)[0]
    planned = [
        (f"a film of {paint} {label} as thick", pure, depth + np.log(times))
        for label, times in (("a quarter", 0.25), ("four times", 4.0))
    ]
    with_white = (
        recovery.shares[:, recovery.row(pale)] > 0 if pale in recovery.paints else np.array(False)
    )
    for white_parts in (3, 10, 30) if pale is not None else ():
        share = _tint(white_parts)
        similar = np.abs(recovery.shares[:, row] / share[0] - 1) < 0.15
        if not np.any(similar & with_white):
            planned.append((f"a 1:{white_parts} tint of {paint} with {pale}", share, depth))
    names, shares, thickness = zip(*planned, strict=True)
    return _PlannedFilms(
        [f"{name}, over black and white" for name in names], np.stack(shares), np.array(thickness)
    )


def _draw_plan(
    recovery: JointRecovery,
    rows: list[int],
    bands: np.ndarray,
    plan: _PlannedFilms,
    white: Pigment | None,
) -> Unknowns:
    """Draws of what is open of planned films, at some bands, from paints of the fit, by row, and a
    white that is in no film of it; the first is what is expected.
    """
    expected = recovery.expectations
    best = recovery.unknowns
    unknowns = jax.tree.map(
        lambda centre, several: np.concatenate([centre[None], several]),
        best,
        recovery.whole_covariance.draw(best, 512),
    )
    count = len(unknowns.bands)
    films = len(plan.names)
    # Another stream than that of the recovery's draws.
    rng = np.random.default_rng(1)

    def normal(*shape: int) -> np.ndarray:
        draws = rng.standard_normal((count, *shape))
        draws[0] = 0.0
        return draws

    coefficients = unknowns.bands[:, bands].reshape(count, bands.size, 2, -1)[..., rows]
    gloss = unknowns.paints[:, rows]
    if white is not None:
        white = white.resample(recovery.wavelengths[bands])
        values = np.column_stack([white.absorption, white.scattering]) * recovery.unit
        modes = error_modes(white)
        off = np.einsum("dm,mcb->dbc", normal(len(modes)), modes)
        # Its unit may be another than the films'.
        off = off + expected.scale * normal(1, 1)
        logs = np.log(np.maximum(values, 1e-7)) + off
        coefficients = np.concatenate([coefficients, logs[..., None]], axis=-1)
        gloss = np.hstack([gloss, expected.paint_gloss * normal(1)])
    # Stronger paints go with thinner films: their product is known better than either.
    depth = recovery.depth(unknowns.films - best.films)[:, None]
    thickness_sd = np.mean(recovery.problem.scale.films[:, 0])
    thickness = plan.thickness + depth + thickness_sd * normal(films)
    paint_share = plan.shares[:, 0]
    weight_sd = np.hypot(expected.weight_share, expected.weight_floor / paint_share)
    weight = weight_sd * (paint_share < 1) * normal(films)
    film_gloss = expected.gloss * normal(films)
    return Unknowns(
        bands=coefficients.reshape(count, bands.size, -1),
        films=np.stack([thickness, film_gloss, weight], axis=-1),
        paints=gloss,
        others=np.zeros((count, 0)),
    )


@jax.jit
def _linear_readings(
    draws: Unknowns, planned: JointProblem
) -> tuple[Float[Array, "films 2 bands"], Float[Array, "draws films 2 bands"]]:
    """Readings of planned films by the first draw, and how they move with each other one, to first
    order.
    """

    def read(draw: Unknowns) -> Float[Array, "films 2 bands"]:
        return jnp.moveaxis(readings(draw, planned), 0, -1)

    centre = jax.tree.map(lambda values: values[0], draws)
    off = jax.tree.map(lambda values: values[1:] - values[0], draws)
    return read(centre), jax.vmap(lambda move: jax.jvp(read, (centre,), (move,))[1])(off)


@jax.jit
def _reflectances(
    coefficients: Float[Array, "draws 2 paints bands"],
    mixed: Float[Array, "mixtures paints"],
    thickness: float | Array,
    response: Response,
) -> Float[Array, "draws looks bands"]:
    """Reflectance of opaque mixtures, and of a film of the first over black and over white, without
    the surface's part.
    """
    # Far from the solution a paint is as good as black or clear.
    values = jnp.exp(jnp.clip(coefficients, -16.0, 16.0))
    kd, sd = jnp.einsum("dcpb,mp->cdmb", values, mixed)
    thick = hiding_factor(kd, sd)
    opaque = response.body(kd * thick, sd * thick, 0.5)
    pure = slice(0, 1)
    film = response.body(
        thickness * kd[:, pure], thickness * sd[:, pure], jnp.asarray([[0.03], [0.9]])
    )
    return jnp.concatenate([opaque, film], axis=1)
