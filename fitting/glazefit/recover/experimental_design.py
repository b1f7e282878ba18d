"""What a further film would teach: which of a few that are easy to make leaves least open of how a
paint will look.

The posterior is linearised at the solution. A film that is not made yet adds readings, and unknowns
of its own: thickness, gloss and the error of its weights. What remains open is judged by what
matters in use: the colour difference that is to be expected of the paint's opaque mixtures with
white, and of a film over black and over white. On some thirty bands this is a small dense problem.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from glazejax import Pigment

from ..film.films import FLAGS, SPECTRA, Films
from ..film.model.response import HIGHEST, Response, film_response
from .constraints import Gauge, gather_constraints
from .joint import UNIT, pose
from .joint_problem import (
    JointProblem,
    JointResiduals,
    Unknowns,
    deviations,
    readings,
    residuals,
    totals,
)
from .joint_result import JointRecovery
from .next_reading import Candidate, NextFilms, rank_candidates, reading_bands

_BANDS = 31
# Bands that a candidate is read at: with 8 a tint is thought to teach half as much.
_READ = 16
_DRAWS = 512
_VISIBLE = (400.0, 700.0)
# Parts of white to one of paint: films to make, and mixtures to be judged by.
TINTS = (3, 10, 30)
_JUDGED = (1.0, 3.0, 10.0, 30.0)
_TIMES = {"a quarter": 0.25, "four times": 4.0}
# Mean internal reflectance of an opaque film from which a paint passes for a white.
_WHITE = 0.75


def rank_next_films(
    recovery: JointRecovery,
    paint: str,
    *,
    pigments: Mapping[str, Pigment] | None = None,
    gauge: Gauge | None = None,
    unit: float = UNIT,
    white: Pigment | None = None,
    response: Response | None = None,
) -> NextFilms:
    """Further films of a paint, in the order of what they would teach.

    Args:
        recovery: joint fit.
        paint: one of its paints.
        pigments, gauge, unit, response: as the fit was given.
        white: what tints would be made with, if the fit holds no white.

    Raises:
        ValueError: no such paint.
    """
    response = response or film_response(recovery.instrument)
    known = dict(pigments or {})
    row = recovery.row(paint)
    paints = list(recovery.paints)
    whites = _whites(recovery)
    chosen = next((p for p in (*recovery.known, *whites) if p in whites), None)
    if chosen is None and white is not None and white.name not in paints:
        chosen = white.name
        paints.append(chosen)
        known[chosen] = white
    pale = paints.index(chosen) if chosen is not None and chosen != paint else None
    film = ~recovery.films.opaque
    depth = float(np.mean(np.log(recovery.thickness[film]))) if film.any() else 0.0
    words, shares, depths = _planned(recovery, row, pale, len(paints), chosen or "", depth)
    problem, solution = _pose(
        recovery,
        shares,
        depths,
        paints=paints,
        known=known,
        gauge=gauge,
        unit=unit,
        response=response,
    )
    slopes = jax.tree.map(np.asarray, _jacobian(problem, response, solution))
    draws = _draws(slopes, solution, len(recovery.films))
    candidates = [
        Candidate(name, draws @ readings.T, np.ones(len(readings)))
        for name, readings in zip(words, _readings(slopes, len(recovery.films)), strict=True)
    ]
    pure = np.eye(len(paints))[row]
    tints = [(pure + p * np.eye(len(paints))[pale]) / (1 + p) for p in _JUDGED if pale is not None]
    mixed, thick = np.stack([pure, *tints]), np.exp(depth)

    def looks(draws: np.ndarray) -> np.ndarray:
        return np.asarray(
            _reflectances(
                draws, solution, problem, response, mixed=mixed, pure=pure, thickness=thick
            )
        )

    grid = recovery.wavelengths[_planning_bands(recovery)]
    return rank_candidates(paint, candidates, draws, looks, grid)


def _whites(recovery: JointRecovery) -> list[str]:
    """Paints whose opaque films are bright at all bands, the brightest first."""
    albedo = recovery.scattering / (recovery.scattering + recovery.absorption)
    # Of an opaque, isotropically scattering film (Hapke's approximation).
    root = np.sqrt(1.0 - albedo)
    bright = np.median((1.0 - root) / (1.0 + root), axis=1)
    return [recovery.paints[i] for i in np.argsort(-bright) if bright[i] > _WHITE]


def _planning_bands(recovery: JointRecovery) -> np.ndarray:
    """Numbers of the bands that are planned with: visible ones, some thirty."""
    grid = recovery.wavelengths
    bands = np.flatnonzero((grid >= _VISIBLE[0] - 1e-6) & (grid <= _VISIBLE[1] + 1e-6))
    bands = bands if bands.size > 2 else np.arange(grid.size)
    return bands[reading_bands(bands.size, _BANDS)]


def _planned(
    recovery: JointRecovery, row: int, pale: int | None, paints: int, white: str, depth: float
) -> tuple[list[str], Float[np.ndarray, "films paints"], Float[np.ndarray, "films"]]:
    """Films that are easily made and were not: words, shares, and log thickness."""
    paint = recovery.paints[row]
    pure = np.eye(paints)[row]
    made = [
        (f"a film of {paint} {words} as thick", pure, depth + np.log(times))
        for words, times in _TIMES.items()
    ]
    for parts in TINTS if pale is not None else ():
        share = (pure + parts * np.eye(paints)[pale]) / (1 + parts)
        similar = np.abs(recovery.shares[:, row] / share[row] - 1) < 0.15
        pad = np.pad(recovery.shares, ((0, 0), (0, paints - len(recovery.paints))))
        if not np.any(similar & (pad[:, pale] > 0)):
            made.append((f"a 1:{parts} tint of {paint} with {white}", share, depth))
    words, shares, depths = zip(*made, strict=True)
    return [f"{one}, over black and white" for one in words], np.stack(shares), np.array(depths)


def _pose(
    recovery: JointRecovery,
    mixed: Float[np.ndarray, "candidates paints"],
    depths: Float[np.ndarray, "candidates"],
    paints: list[str],
    known: Mapping[str, Pigment],
    gauge: Gauge | None,
    unit: float,
    response: Response,
) -> tuple[JointProblem, Unknowns]:
    """Problem of the films and all candidates, and the solution in it."""
    bands = _planning_bands(recovery)
    old = recovery.films
    count = len(old)
    more = len(depths)
    rows = np.concatenate([np.arange(count), np.zeros(more, dtype=int)])
    arrays = {what: getattr(old, what)[rows][:, bands] for what in SPECTRA}
    flags = {what: getattr(old, what)[rows] for what in FLAGS}
    flags["seen"][count:], flags["opaque"][count:] = True, False
    names = (*old.names, *(f"candidate {i}" for i in range(more)))
    films = Films(names, old.wavelengths[bands], **arrays, **flags)
    spare = len(paints) - len(recovery.paints)
    shares = np.concatenate([np.pad(recovery.shares, ((0, 0), (0, spare))), mixed])
    expected = recovery.expectations
    constraints = gather_constraints(films, paints, known, gauge, unit, expected)
    constraints.thickness[count:] = depths
    constraints.thickness_sd[count:] = expected.thickness if gauge is None else gauge.error
    gloss = np.concatenate([recovery.measured_gloss, np.full(more, np.nan)])
    settings = (
        shares,
        recovery.instrument,
        recovery.noise,
        expected,
        constraints,
        gloss,
    )
    problem = pose(films, *settings)
    solution = _solution(recovery, problem, bands, spare, depths)
    # How sure a reading is depends on what it will be.
    seen = np.asarray(jax.jit(readings)(solution, problem, response))[:, count:]
    for what, values in zip(SPECTRA[2:], np.moveaxis(seen, -1, 0), strict=True):
        arrays[what][count:] = np.maximum(values.T, 0.0)
    problem = pose(replace(films, **arrays), *settings)
    # The fewer bands stand for all.
    share = np.sqrt(max(old.wavelengths.size / bands.size, 1.0)) * films.seen
    return problem._replace(weight=jnp.asarray(np.asarray(problem.weight) * share)), solution


def _solution(
    recovery: JointRecovery,
    problem: JointProblem,
    bands: np.ndarray,
    spare: int,
    depths: Float[np.ndarray, "candidates"],
) -> Unknowns:
    """The fit's solution as deviations, with what is new where it is expected."""
    found = recovery.unknowns
    count = len(recovery.films)
    paints = len(recovery.paints)
    local = np.array(problem.known)
    old = np.concatenate([np.arange(paints), paints + spare + np.arange(paints)])
    local[:, old] = found.bands[bands]
    films = np.zeros(problem.film_scale.shape)
    films[:count, : found.films.shape[1]] = found.films
    films[count:, 0] = depths
    gloss = np.zeros(paints + spare)
    gloss[:paints] = found.paints
    others = np.zeros(len(problem.thickness_modes))
    # The first are of paints that are known: as the fit found them, unless there is a new one.
    same = (
        0
        if spare
        else max(
            (modes.first + len(modes.kept) for modes in recovery.known_modes.values()), default=0
        )
    )
    others[:same] = found.others[:same]
    whole = Unknowns(
        jnp.asarray(local), jnp.asarray(films), jnp.asarray(gloss), jnp.asarray(others)
    )
    return jax.jit(deviations)(whole, problem)


@jax.jit
def _jacobian(problem: JointProblem, response: Response, solution: Unknowns) -> JointResiduals:
    flat, unravel = ravel_pytree(solution)
    return jax.jacfwd(lambda y: residuals(unravel(y), (problem, response)))(flat)


def _draws(slopes: JointResiduals, solution: Unknowns, films: int) -> Float[np.ndarray, "draws n"]:
    """Draws of the unknowns, as all that is measured and expected leaves them open."""
    n = slopes.data.shape[-1]
    rest = [part.reshape(-1, n) for name, part in slopes._asdict().items() if name != "data"]
    base = np.concatenate([slopes.data[:, :films].reshape(-1, n), *rest])
    factor = np.linalg.cholesky(base.T @ base)
    normal = np.random.default_rng(0).standard_normal((_DRAWS, n))
    # As `ravel_pytree` lays them, without its programs.
    centre = np.concatenate([np.asarray(part).ravel() for part in solution])
    return centre + np.linalg.solve(factor.T, normal.T).T


def _readings(slopes: JointResiduals, films: int) -> Iterator[Float[np.ndarray, "readings n"]]:
    """How the readings of each candidate follow the unknowns, in their standard deviations."""
    data = np.asarray(slopes.data)
    bands = reading_bands(len(data), _READ)
    for film in np.moveaxis(data[bands, films:], 1, 0):
        # The fewer bands stand for all.
        yield film.reshape(-1, data.shape[-1]) * np.sqrt(len(data) / bands.size)


@jax.jit
def _reflectances(
    draws: Float[Array, "draws n"],
    like: Unknowns,
    problem: JointProblem,
    response: Response,
    mixed: Float[Array, "mixtures paints"],
    pure: Float[Array, "paints"],
    thickness: Float[Array, ""],
) -> Float[Array, "draws looks bands"]:
    """Reflectance of opaque mixtures, and of a film over black and over white, without the
    surface's part.
    """
    _, unravel = ravel_pytree(like)

    def one(flat: Array) -> Array:
        # Far from the solution a paint is as good as black or clear.
        coefficients = jnp.exp(jnp.clip(totals(unravel(flat), problem).bands, -16.0, 16.0))
        paints = pure.size
        k = coefficients[:, :paints]
        s = coefficients[:, paints:]
        kd = mixed @ k.T
        sd = mixed @ s.T
        thick = 0.999 * jnp.minimum(HIGHEST[0] / kd, HIGHEST[1] / sd)
        opaque = response.body(kd * thick, sd * thick, 0.5)
        film = response.body(
            thickness * (k @ pure), thickness * (s @ pure), jnp.asarray([[0.03], [0.9]])
        )
        return jnp.concatenate([opaque, film])

    return jax.vmap(one)(draws)
