"""Spectra that exemplars and their mixtures would have, by the film model: what a reading is
compared with.

A film that hides its ground depends on k/s alone. Over a ground that is seen, and where a film is
said to hide its ground but may not, coats of several thicknesses accompany it.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import jax
import numpy as np
from jaxtyping import Array, Float, Int

from glazejax import Pigment
from glazejax.radiative.common.chunks import by_blocks
from glazejax.spectra import Bands, lie_between

from ...film.model.response import FilmResponse
from ...film.numerics.columns import Columns

Coefficients: TypeAlias = Float[np.ndarray, "2 exemplars bands"]
"""k and s of exemplars, 1/m."""
PerExemplar: TypeAlias = Int[np.ndarray, "exemplars"]
"""A number for each exemplar: its own, or that of its family or its source."""
FilmCurves: TypeAlias = Float[np.ndarray, "films bands"]
"""A curve for each film over the bands: what it reads, its k, s or k/s, or its varnish."""
FRACTIONS = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 0.98)
"""Mass fractions of the first of two paints."""
COATS = (0.35, 1.0)
"""Thicknesses of coats that a film said to hide its ground may have, of usual ones."""
LIGHT_GROUND = 0.85
"""Internal reflectance of what is then below."""
THICKNESSES = (0.1, 0.2, 0.4, 0.7, 1.2, 2.0, 4.0)
MIXED_THICKNESSES = (0.2, 0.7, 2.0)
"""Thicknesses of coats over a known ground, of usual ones: of one paint, and of two."""
# Exemplars of each family that are mixed: those nearest to the others, one for each part.
_MIXED = 2
# Scattering optical thickness that hides the ground.
_OPAQUE = 200.0
# Films that are computed at a time.
_CHUNK = 2048
# k/s at which films that hide their ground are computed, and between which they are interpolated.
_RATIOS = (1e-7, 1e4)
_NODES = 600


@dataclass(frozen=True, kw_only=True)
class Templates(Columns):
    """Computed films.

    Attributes:
        members: exemplars of each by number, -1 for none, (templates, 2).
        fractions: by mass, (templates, 2).
        thickness: of usual ones (`usual_coat`); infinite for a film that hides its ground.
        readings: without the outer surface's part, (templates, bands).
    """

    members: Int[np.ndarray, "templates 2"]
    fractions: Float[np.ndarray, "templates 2"]
    thickness: Float[np.ndarray, "templates"]
    readings: Float[np.ndarray, "templates bands"]

    def __len__(self) -> int:
        return len(self.members)


def coefficients(pigments: Sequence[Pigment], wavelengths: Bands) -> Coefficients:
    """k and s of exemplars on a grid, 1/m; NaN where one is not known."""
    out = np.full((2, len(pigments), wavelengths.size), np.nan)
    for row, pigment in enumerate(pigments):
        grid = np.asarray(pigment.wavelengths)
        covered = lie_between(wavelengths, grid[0], grid[-1])
        for quantity, values in enumerate((pigment.absorption, pigment.scattering)):
            # Coefficients change by factors: their logs are interpolated.
            logs = np.log(np.maximum(np.asarray(values, dtype=np.float64), 1e-3))
            out[quantity, row, covered] = np.exp(np.interp(wavelengths[covered], grid, logs))
    return out


def with_stand_ins(k_and_s: Coefficients, family_of: PerExemplar) -> Coefficients:
    """k and s of exemplars, continued beyond the bands at which they are known: log k/s and log s
    go on as they do, in the median, for the others of the family that are known there, or for all
    exemplars where none of the family is.

    What is known of a paint in the visible alone is compared with a reading of the near infrared,
    too. Compared on fewer bands it would win against a paint that is known at all of them and fits
    as well.

    Args:
        k_and_s: 1/m, NaN where one is not known; each is known from one band to another.
        family_of: number of each exemplar's family.

    Returns:
        The same shape; NaN for exemplars that are known at no band, and where nobody is known.
    """
    known = np.isfinite(k_and_s[0])
    absorption, scattering = np.log(k_and_s)
    courses = np.stack([absorption - scattering, scattering])
    out = courses.copy()
    for row in np.flatnonzero(known.any(axis=1) & ~known.all(axis=1)):
        first, last = np.flatnonzero(known[row])[[0, -1]]
        for end, beyond in ((first, np.arange(first)), (last, np.arange(last + 1, known.shape[1]))):
            # Relatives that are known there, or all where none of these is; what nobody knows stays
            # unknown.
            there = known[:, np.append(beyond, end)].all(axis=1)
            relatives = there & (family_of == family_of[row])
            models = relatives if relatives.any() else there
            if not models.any():
                continue
            # From the last known band on, as much lower or higher as theirs are.
            change = courses[:, models][..., beyond] - courses[:, models, end, None]
            out[:, row, beyond] = courses[:, row, end, None] + np.median(change, axis=1)
    ratio, scattering = out
    return np.exp(np.stack([ratio + scattering, scattering]))


def usual_coat(coefficients: Coefficients) -> float:
    """Thickness at which the median of all exemplars and bands scatters twice on the way through,
    m.
    """
    return float(2.0 / np.median(coefficients[1]))


def most_films(exemplars: int, families: int, *, opaque: bool, mixed: bool) -> int:
    """Films that a search among so many exemplars compares with at most.

    Args:
        exemplars: how many there are.
        families: that they are of.
        opaque: whether they are said to hide their ground.
        mixed: whether films of two families are tried.
    """
    pairs = families * (families - 1) // 2 * _MIXED**2 if mixed else 0
    alone, together = (1 + len(COATS), 1) if opaque else (len(THICKNESSES), len(MIXED_THICKNESSES))
    return exemplars * alone + pairs * len(FRACTIONS) * together


def pure_templates(
    coefficients: Coefficients, response: FilmResponse, ground: Bands | None
) -> Templates:
    """Films of one exemplar each.

    Args:
        coefficients: of all exemplars.
        response: of the instrument.
        ground: internal reflectance of what is below, or None for films said to hide it: then
            coats over a light ground accompany those that do.
    """
    count = coefficients.shape[1]
    members = np.column_stack([np.arange(count), np.full(count, -1)])
    fractions = np.tile([1.0, 0.0], (count, 1))
    levels = (np.inf, *COATS) if ground is None else THICKNESSES
    return _over(coefficients, response, members, fractions, ground, levels)


def mixed_templates(
    coefficients: Coefficients,
    families: PerExemplar,
    points: Float[np.ndarray, "exemplars components"],
    response: FilmResponse,
    ground: Bands | None,
) -> Templates:
    """Films of two families each: of a few exemplars of one with a few of the other.

    Args:
        coefficients, response, ground: as for `pure_templates`.
        families: number of each exemplar's family.
        points: of the exemplars in the metric, by which those that are mixed are chosen.
    """
    chosen = [typical(points, np.flatnonzero(families == family)) for family in np.unique(families)]
    pairs = [
        pair
        for two_families in itertools.combinations(chosen, 2)
        for pair in itertools.product(*two_families)
    ]
    members = np.repeat(np.array(pairs, dtype=int).reshape(-1, 2), len(FRACTIONS), axis=0)
    first = np.tile(FRACTIONS, len(pairs))
    fractions = np.column_stack([first, 1.0 - first])
    levels = (np.inf,) if ground is None else MIXED_THICKNESSES
    return _over(coefficients, response, members, fractions, ground, levels)


def typical(
    points: Float[np.ndarray, "exemplars components"], rows: Int[np.ndarray, "own"]
) -> list[int]:
    """Exemplars that stand for a family, of those that are of it: the one nearest to the others,
    and the one furthest from that among the nearer half.
    """
    distances = np.sqrt(np.sum((points[rows][:, None] - points[rows]) ** 2, axis=-1))
    middle = int(np.median(distances, axis=1).argmin())
    out = [int(rows[middle])]
    if len(rows) > 2:
        nearer = np.argsort(distances[middle], kind="stable")[: max(2, (len(rows) + 1) // 2)]
        out.append(int(rows[nearer[-1]]))
    return out


def _over(
    coefficients: Coefficients,
    response: FilmResponse,
    members: Int[np.ndarray, "films 2"],
    fractions: Float[np.ndarray, "films 2"],
    ground: Bands | None,
    levels: Sequence[float],
) -> Templates:
    """Films of these mixtures at some thicknesses, in usual ones."""
    usual = usual_coat(coefficients)
    below = LIGHT_GROUND if ground is None else ground
    # Coefficients add by mass.
    k, s = (np.einsum("fm,fmb->fb", fractions, values[members]) for values in coefficients)
    readings = [
        hiding_body(response, k / s)
        if np.isinf(thickness)
        else coat_body(response, k * (thickness * usual), s * (thickness * usual), below)
        for thickness in levels
    ]
    return Templates(
        members=np.tile(members, (len(levels), 1)),
        fractions=np.tile(fractions, (len(levels), 1)),
        thickness=np.repeat(levels, len(members)),
        readings=np.concatenate(readings),
    )


def hiding_body(response: FilmResponse, ratio: FilmCurves) -> FilmCurves:
    """Readings of films that hide their ground, from k/s: one curve of one variable, computed at
    some points.
    """
    return np.interp(np.log(ratio), *_hiding_curve(response))


def hiding_ratio(response: FilmResponse, bodies: FilmCurves) -> FilmCurves:
    """k/s of films that hide their ground, from readings without the surface's part."""
    logs, curve = _hiding_curve(response)
    return np.exp(np.interp(bodies, curve[::-1], logs[::-1]))


def _hiding_curve(
    response: FilmResponse,
) -> tuple[Float[np.ndarray, "nodes"], Float[np.ndarray, "nodes"]]:
    """Log k/s, and what films that hide their ground then read: it falls."""
    nodes = np.geomspace(*_RATIOS, _NODES)
    s = np.full_like(nodes, _OPAQUE)
    curve = np.asarray(response.body(nodes * s, s, np.full_like(nodes, LIGHT_GROUND)))
    return np.log(nodes), curve


def coat_body(
    response: FilmResponse,
    absorption: FilmCurves,
    scattering: FilmCurves,
    ground: Bands | float,
) -> FilmCurves:
    """Readings of coats over a ground, from their optical thicknesses."""

    def run(rows: Int[np.ndarray, "block"]) -> Array:
        kd = absorption[rows]
        return _body(response, kd, scattering[rows], np.broadcast_to(ground, kd.shape))

    return by_blocks(len(absorption), _CHUNK, run)


_body = jax.jit(FilmResponse.body)
