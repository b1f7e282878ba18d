"""What people use to name pigments: spectral angle, derivatives, unmixing of -log R, Kubelka-Munk.
One film at a time.

Each method takes the films, the row that is sought, names of known films with their recipes by
family, and paints with k and s of a fit without the film. It returns sets of families, best first;
fractions of the best; and a misfit.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from benchmarks.paint.identification import UNIT, family
from glazefit import Films, ground_from_air
from glazejax import Pigment

Found = tuple[list[frozenset[str]], dict[str, float], float]
Recipes = dict[str, dict[str, float]]
# Below this share a component counts as not there.
_PRESENT = 0.02
_SURFACE, _INSIDE = 0.0405, 0.596  # at 8 degrees from air, diffuse from within; index 1.5


def _ranked(score: np.ndarray, library: Sequence[str], recipes: Recipes) -> Found:
    """Nearest known films, each set of pigments once."""
    order = np.argsort(score)
    sets = list(dict.fromkeys(frozenset(recipes[library[int(i)]]) for i in order))
    return sets, recipes[library[int(order[0])]], float(score[order[0]])


def spectral_angle(
    films: Films, row: int, library: Sequence[str], recipes: Recipes, paints: list[Pigment]
) -> Found:
    """Least angle between spectra, both cards together."""
    spectra = np.concatenate([films.over_black, films.over_white], axis=1)
    unit = spectra / np.linalg.norm(spectra, axis=1, keepdims=True)
    known = unit[[films.names.index(name) for name in library]]
    return _ranked(np.degrees(np.arccos(np.clip(known @ unit[row], -1, 1))), library, recipes)


def derivative(
    films: Films, row: int, library: Sequence[str], recipes: Recipes, paints: list[Pigment]
) -> Found:
    """Most alike slopes of -log R over white: correlation of first derivatives."""
    slopes = np.diff(-np.log(np.maximum(films.over_white, 1e-3)), axis=1)
    slopes = slopes - slopes.mean(axis=1, keepdims=True)
    unit = slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
    known = unit[[films.names.index(name) for name in library]]
    return _ranked(1.0 - known @ unit[row], library, recipes)


def unmixing(
    films: Films, row: int, library: Sequence[str], recipes: Recipes, paints: list[Pigment]
) -> Found:
    """Non-negative least squares of -log R over white from the known pure films."""
    absorbance = -np.log(np.maximum(films.over_white, 1e-3))
    pure = [name for name in library if len(recipes[name]) == 1]
    matrix = absorbance[[films.names.index(name) for name in pure]].T
    amounts, left = nnls(matrix, absorbance[row])
    shares = family({next(iter(recipes[name])): 0.0 for name in pure})
    for name, part in zip(pure, amounts / amounts.sum(), strict=True):
        shares[next(iter(recipes[name]))] += part
    return _of_shares(shares, left / np.sqrt(absorbance.shape[1]))


def _of_shares(shares: dict[str, float], misfit: float) -> Found:
    there = {paint: part for paint, part in shares.items() if part > _PRESENT}
    ordered = sorted(there, key=lambda paint: -there[paint])
    sets = [frozenset(ordered), *(frozenset(ordered[:n]) for n in range(len(ordered) - 1, 0, -1))]
    return sets, there, misfit


def kubelka_munk(
    films: Films, row: int, library: Sequence[str], recipes: Recipes, paints: list[Pigment]
) -> Found:
    """Two-constant Kubelka-Munk with the same paints: singles and pairs on a grid of amounts, over
    both cards.

    K = 2 k and S = 3/4 s, Saunderson's correction; the least root mean square wins, a pair only
    where it halves it.
    """
    k, s = (
        np.stack([np.asarray(getattr(p, what)) for p in paints]) * UNIT
        for what in ("absorption", "scattering")
    )
    cards = ground_from_air(np.stack([films.bare_black[row], films.bare_white[row]]))
    seen = np.stack([films.over_black[row], films.over_white[row]])
    totals = np.geomspace(0.1, 12.0, 25)
    parts = np.array(
        [0.002, 0.008, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 0.98, 0.992, 0.998]
    )
    best: dict[frozenset[str], tuple[float, dict[str, float]]] = {}
    for members in [
        *((i, i) for i in range(len(paints))),
        *itertools.combinations(range(len(paints)), 2),
    ]:
        single = members[0] == members[1]
        first = np.ones(1) if single else parts
        weights = totals[:, None, None] * np.stack([first, 1.0 - first], axis=-1)
        mixed_k, mixed_s = (weights @ a[list(members)] for a in (k, s))
        inside = _layer(2.0 * mixed_k, 0.75 * mixed_s, cards[:, None, None])
        outside = _SURFACE + (1.0 - _SURFACE) * (1.0 - _INSIDE) * inside / (1.0 - _INSIDE * inside)
        off = np.sqrt(np.mean((outside - seen[:, None, None]) ** 2, axis=(0, -1)))
        where = np.unravel_index(off.argmin(), off.shape)
        part = float(first[where[1]])
        recipe = [(paints[members[0]].name, part), (paints[members[1]].name, 1.0 - part)]
        shares = family({paints[members[0]].name: 1.0} if single else dict(recipe))
        score = float(off[where]) * (1.0 if single else 2.0)
        pigments = frozenset(shares)
        if score < best.get(pigments, (np.inf, {}))[0]:
            best[pigments] = score, shares
    ordered = sorted(best, key=lambda pigments: best[pigments][0])
    score, shares = best[ordered[0]]
    return ordered, shares, score


def _layer(absorption: np.ndarray, scattering: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Kubelka-Munk's internal reflectance of a layer on a ground."""
    s = np.maximum(scattering, 1e-9)
    a = 1.0 + absorption / s
    b = np.sqrt(a**2 - 1.0) + 1e-12
    coth = 1.0 / np.tanh(np.minimum(b * s, 300.0))
    return (1.0 - ground * (a - b * coth)) / (a - ground + b * coth)


PEERS = {
    "spectral angle, nearest film": spectral_angle,
    "derivative of -log R, nearest film": derivative,
    "unmixing of -log R (NNLS)": unmixing,
    "Kubelka-Munk, the same paints": kubelka_munk,
}
