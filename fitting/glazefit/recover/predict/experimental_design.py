"""Gain of a further film: which of a few that are easy to make leaves least open of how a paint
will look.

The readings of a film that is not made yet are linearised at the solution. They follow what the fit
leaves open of the paints, and unknowns of the film's own: thickness, gloss and the error of its
weights. What remains open is judged by what matters in use: the colour difference that is to be
expected of the paint's opaque mixtures with white, and of a film over black and over white.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax import Pigment
from glazejax.spectra import lie_between

from ...film.films import card_readings
from ...film.model.response import Response, film_response, hiding_factor
from ..joint.constraints import error_modes
from ..joint.problem import model_deviation
from ..joint.result import JointRecovery
from .next_reading import CandidateReading, NextFilms, rank_candidates, reading_bands


class _Open(NamedTuple):
    """Draws of what is open of films that are planned; the first is the expected one."""

    coefficients: Float[np.ndarray, "draws bands 2 paints"]  # log k and log s for unit thickness
    amounts: Float[np.ndarray, "draws films paints"]  # log of thickness, and errors of weights
    gloss: Float[np.ndarray, "draws films"]  # log


class _PlannedFilms(NamedTuple):
    """Films that are easily made and were not."""

    names: list[str]
    shares: Float[np.ndarray, "films paints"]
    thickness: Float[np.ndarray, "films"]  # log


def rank_next_films(
    recovery: JointRecovery,
    paint: str,
    *,
    white: Pigment | None = None,
    response: Response | None = None,
) -> NextFilms:
    """Further films of a paint, in the order of what they would teach.

    Args:
        recovery: joint fit.
        paint: one of its paints.
        white: what tints would be made with, if the fit holds no white.
        response: model of one film, by default that of the fit's instrument.

    Raises:
        ValueError: no such paint.
    """
    response = response or film_response(recovery.instrument)
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
    open_ = _open(recovery, rows, bands, plan, stand_in)
    card_data = card_readings(recovery.films, recovery.instrument, recovery.noise)
    ground, ground_sd = (values[0, bands].T for values in (card_data.ground, card_data.ground_sd))
    surface = recovery.instrument.seen_surface
    expected, moves = map(np.asarray, _readings(open_, plan.shares, ground, surface, response))
    # The fewer bands stand for all; with 8 a tint is thought to teach half as much.
    read = reading_bands(grid.size, 16)
    thinning = np.sqrt(recovery.wavelengths.size / read.size)
    deviation = model_deviation(expected, recovery.noise, recovery.expectations)
    # A card's own error reaches the reading through the film, at most as a bare card's does.
    deviation = np.hypot(deviation, ground_sd * expected) / thinning
    candidates = [
        CandidateReading(
            name,
            moves[:, film][:, :, read].reshape(len(moves), -1),
            deviation[film][:, read].ravel(),
        )
        for film, name in enumerate(plan.names)
    ]
    # Parts of white to one of paint that the paint is judged by.
    judged = [_tint(white_parts) for white_parts in (1.0, 3.0, 10.0, 30.0) if pale is not None]
    mixtures = np.stack([plan.shares[0], *judged])

    def looks(draws: np.ndarray) -> np.ndarray:
        return np.asarray(_reflectances(draws, mixtures, np.exp(depth), response))

    return rank_candidates(candidates, open_.coefficients[1:], looks, grid)


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


def _open(
    recovery: JointRecovery,
    rows: list[int],
    bands: np.ndarray,
    plan: _PlannedFilms,
    white: Pigment | None,
) -> _Open:
    """Draw what is open, at some bands, of paints of the fit, by row, and of a white that is in no
    film of it.
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
        values = np.stack([white.absorption, white.scattering], axis=-1) * recovery.unit
        modes = error_modes(white)
        off = np.einsum("dm,mcb->dbc", normal(len(modes)), modes)
        # Its unit may be another than the films'.
        off = off + expected.scale * normal(1, 1)
        logs = np.log(np.maximum(values, 1e-7)) + off
        coefficients = np.concatenate([coefficients, logs[..., None]], axis=-1)
        gloss = np.concatenate([gloss, expected.paint_gloss * normal(1)], axis=-1)
    # Stronger paints go with thinner films: their product is known better than either.
    depth = recovery.depth(unknowns.films - best.films)[:, None]
    thickness_sd = np.mean(recovery.problem.film_scale[:, 0])
    thickness = plan.thickness + depth + thickness_sd * normal(films)
    # Of a tint the paint is the smaller part, and what weighing leaves open is its own.
    paint_share = plan.shares[:, 0]
    weight = np.hypot(expected.weight_share, expected.weight_floor / paint_share) * (
        paint_share < 1
    )
    amounts = np.stack([thickness + weight * normal(films), thickness], axis=-1)
    return _Open(
        coefficients=coefficients,
        amounts=amounts[..., : plan.shares.shape[1]],
        gloss=gloss @ plan.shares.T + expected.gloss * normal(films),
    )


@jax.jit
def _readings(
    open_: _Open,
    shares: Float[Array, "films paints"],
    grounds: Float[Array, "2 bands"],
    surface: float | Array,
    response: Response,
) -> tuple[Float[Array, "films 2 bands"], Float[Array, "draws films 2 bands"]]:
    """Expected readings of planned films, and how they move with each draw, to first order."""

    def read(draw: _Open) -> Float[Array, "films 2 bands"]:
        amounts = shares * jnp.exp(draw.amounts)
        kd, sd = jnp.einsum("bcp,fp->cfb", jnp.exp(draw.coefficients), amounts)
        body = response.body(kd[:, None], sd[:, None], grounds)
        return body + surface * jnp.exp(draw.gloss)[:, None, None]

    centre = jax.tree.map(lambda values: values[0], open_)
    off = jax.tree.map(lambda values: values[1:] - values[0], open_)
    return read(centre), jax.vmap(lambda move: jax.jvp(read, (centre,), (move,))[1])(off)


@jax.jit
def _reflectances(
    coefficients: Float[Array, "draws bands 2 paints"],
    mixed: Float[Array, "mixtures paints"],
    thickness: float | Array,
    response: Response,
) -> Float[Array, "draws looks bands"]:
    """Reflectance of opaque mixtures, and of a film of the first over black and over white, without
    the surface's part.
    """
    # Far from the solution a paint is as good as black or clear.
    values = jnp.exp(jnp.clip(coefficients, -16.0, 16.0))
    kd, sd = jnp.einsum("dbcp,mp->cdmb", values, mixed)
    thick = hiding_factor(kd, sd)
    opaque = response.body(kd * thick, sd * thick, 0.5)
    pure = slice(0, 1)
    film = response.body(
        thickness * kd[:, pure], thickness * sd[:, pure], jnp.asarray([[0.03], [0.9]])
    )
    return jnp.concatenate([opaque, film], axis=1)
