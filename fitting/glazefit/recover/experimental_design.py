"""What a further film would teach: which of a few that are easy to make leaves least open of how a
paint will look.

The posterior is linearised at the solution. A film that is not made yet adds its readings'
information, whatever they turn out to be, and unknowns of its own: thickness, gloss and the error
of its weights. What remains open is judged by what matters in use: the colour difference that is to
be expected of the paint's opaque mixtures with white, and of a film over black and over white. On
some thirty bands this is a small dense problem.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from glazejax import Pigment
from glazejax.colour import delta_e_of_spectra

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

_BANDS = 31
_DRAWS = 64
_VISIBLE = (400.0, 700.0)
# Parts of white to one of paint: films to make, and mixtures to be judged by.
TINTS = (3, 10, 30)
_JUDGED = (1.0, 3.0, 10.0, 30.0)
_THINNER = 0.25
_THICKER = 4.0
# Mean internal reflectance of an opaque film from which a paint passes for a white.
_WHITE = 0.75


class NextFilm(NamedTuple):
    """A further film, and the CIEDE2000 that the paint's mixtures and films are then expected to be
    off.
    """

    film: str
    expected: float


@dataclass(frozen=True)
class NextFilms:
    """What further films would teach of one paint.

    Attributes:
        paint: its name.
        now: CIEDE2000 (D65, 10 degrees) that its mixtures with white and its films are expected to
            be off.
        films: further films, the most instructive first.
    """

    paint: str
    now: float
    films: tuple[NextFilm, ...]


class _Candidate(NamedTuple):
    words: str
    share: Float[np.ndarray, "paints"]
    log_thickness: float


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
    candidates = _candidates(recovery, row, pale, len(paints), chosen or "", depth)
    problem, solution = _pose(
        recovery, candidates, paints=paints, known=known, gauge=gauge, unit=unit, response=response
    )
    judge = _Judge(
        grid=recovery.wavelengths[_planning_bands(recovery)],
        row=row,
        pale=pale,
        depth=depth,
        solution=solution,
        problem=problem,
        response=response,
    )
    base, more = _information(problem, solution, response, len(recovery.films), len(candidates))
    now = judge.expected(base)
    found = [
        NextFilm(c.words, judge.expected(base + extra))
        for c, extra in zip(candidates, more, strict=True)
    ]
    return NextFilms(paint, now, tuple(sorted(found, key=lambda film: film.expected)))


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
    return bands[
        np.unique(np.linspace(0, bands.size - 1, min(_BANDS, bands.size)).round().astype(int))
    ]


def _candidates(
    recovery: JointRecovery, row: int, pale: int | None, paints: int, white: str, depth: float
) -> list[_Candidate]:
    paint = recovery.paints[row]
    pure = np.eye(paints)[row]
    over = "over black and white"
    made = [
        _Candidate(f"a film of {paint} a quarter as thick, {over}", pure, depth + np.log(_THINNER)),
        _Candidate(
            f"a film of {paint} four times as thick, {over}", pure, depth + np.log(_THICKER)
        ),
    ]
    for parts in TINTS if pale is not None else ():
        assert pale is not None
        share = (pure + parts * np.eye(paints)[pale]) / (1 + parts)
        similar = np.abs(recovery.shares[:, row] / share[row] - 1) < 0.15
        if not np.any(
            similar & (recovery.shares[:, pale] > 0 if pale < recovery.shares.shape[1] else False)
        ):
            made.append(
                _Candidate(f"a 1:{parts} tint of {paint} with {white}, {over}", share, depth)
            )
    return made


def _pose(
    recovery: JointRecovery,
    candidates: list[_Candidate],
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
    more = len(candidates)
    rows = np.concatenate([np.arange(count), np.zeros(more, dtype=int)])
    arrays = {what: getattr(old, what)[rows][:, bands] for what in SPECTRA}
    flags = {what: getattr(old, what)[rows] for what in FLAGS}
    flags["seen"][count:], flags["opaque"][count:] = True, False
    names = (*old.names, *(f"candidate {i}" for i in range(more)))
    films = Films(names, old.wavelengths[bands], **arrays, **flags)
    spare = len(paints) - len(recovery.paints)
    shares = np.concatenate(
        [np.pad(recovery.shares, ((0, 0), (0, spare))), np.stack([c.share for c in candidates])]
    )
    expected = recovery.expectations
    constraints = gather_constraints(films, paints, known, gauge, unit, expected)
    constraints.thickness[count:] = [c.log_thickness for c in candidates]
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
    solution = _solution(recovery, problem, bands, spare, candidates)
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
    candidates: list[_Candidate],
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
    films[count:, 0] = [c.log_thickness for c in candidates]
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


def _information(
    problem: JointProblem, solution: Unknowns, response: Response, films: int, more: int
) -> tuple[Float[np.ndarray, "n n"], list[Float[np.ndarray, "n n"]]]:
    """Information of all that is measured and expected, and of each candidate's readings."""
    slopes = jax.tree.map(np.asarray, _jacobian(problem, response, solution))
    n = slopes.data.shape[-1]
    rest = [part.reshape(-1, n) for name, part in slopes._asdict().items() if name != "data"]
    base = np.concatenate([slopes.data[:, :films].reshape(-1, n), *rest])
    parts = [slopes.data[:, films + i].reshape(-1, n) for i in range(more)]
    return base.T @ base, [part.T @ part for part in parts]


class _Judge:
    """How far a paint's mixtures and films may look other than expected, by draws that all
    candidates share.
    """

    def __init__(
        self,
        grid: Float[np.ndarray, "bands"],
        row: int,
        pale: int | None,
        depth: float,
        solution: Unknowns,
        problem: JointProblem,
        response: Response,
    ):
        self._like, self._grid = solution, grid
        # As `ravel_pytree` lays them, without its programs.
        self._centre = np.concatenate([np.asarray(part).ravel() for part in solution])
        self._normal = np.random.default_rng(0).standard_normal((_DRAWS, self._centre.size))
        paints = problem.shares.shape[1]
        pure = np.eye(paints)[row]
        mixed = (
            [pure]
            if pale is None
            else [pure, *((pure + p * np.eye(paints)[pale]) / (1 + p) for p in _JUDGED)]
        )
        self._args: tuple[Any, ...] = (
            problem,
            response,
            jnp.asarray(mixed),
            jnp.asarray(pure),
            np.exp(depth),
        )
        self._mean = np.asarray(
            _reflectances(jnp.asarray(self._centre[None]), solution, *self._args)
        )

    def expected(self, information: Float[np.ndarray, "n n"]) -> float:
        """Mean CIEDE2000 (D65, 10 degrees) between draws and the solution."""
        factor = np.linalg.cholesky(information)
        draws = self._centre + np.linalg.solve(factor.T, self._normal.T).T
        spectra = np.asarray(_reflectances(jnp.asarray(draws), self._like, *self._args))
        return float(np.mean(delta_e_of_spectra(self._grid, spectra, self._mean, observer=10)))


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
