"""What people use to name pigments: spectral angle, derivatives, unmixing of -log R, Kubelka-Munk.
One film at a time.

Each method takes the films, the row that is sought, names of known films with their recipes by
family, and paints with k and s of a fit without the film. It returns sets of families, best first;
fractions of the best; and a misfit.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from benchmarks.paint.identification import UNIT, family
from benchmarks.paintbench.spectra import absorbance, cosine_distance, slopes
from benchmarks.rivals.baselines import Surface, film_reflectance, shares_of, unmix
from glazefit import Films, ground_from_air
from glazejax import Pigment

Found = tuple[list[frozenset[str]], dict[str, float], float]
Recipes = dict[str, dict[str, float]]
# Below this share a component counts as not there.
_PRESENT = 0.02
# At 8 degrees from air, diffuse from within; index 1.5.
_SURFACE = Surface(outer=0.0405, inner=0.596)


def _nearest(
    features: np.ndarray, films: Films, row: int, library: Sequence[str], recipes: Recipes
) -> Found:
    """Known films by the angle between features, each set of pigments once."""
    known = features[[films.names.index(name) for name in library]]
    score = cosine_distance(known, features[[row]], least=1)[:, 0]
    order = np.argsort(score)
    sets = list(dict.fromkeys(frozenset(recipes[library[int(i)]]) for i in order))
    return sets, recipes[library[int(order[0])]], float(score[order[0]])


def spectral_angle(
    films: Films, row: int, library: Sequence[str], recipes: Recipes, paints: list[Pigment]
) -> Found:
    """Least angle between spectra, both cards together."""
    spectra = np.concatenate([films.over_black, films.over_white], axis=1)
    return _nearest(spectra, films, row, library, recipes)


def derivative(
    films: Films, row: int, library: Sequence[str], recipes: Recipes, paints: list[Pigment]
) -> Found:
    """Least angle between slopes of -log R over white."""
    return _nearest(slopes(absorbance(films.over_white)), films, row, library, recipes)


def unmixing(
    films: Films, row: int, library: Sequence[str], recipes: Recipes, paints: list[Pigment]
) -> Found:
    """Non-negative least squares of -log R over white from the known pure films."""
    values = absorbance(films.over_white)
    pure = [name for name in library if len(recipes[name]) == 1]
    amounts, misfit = unmix(values[[films.names.index(name) for name in pure]].T, values[[row]])
    shares = family({next(iter(recipes[name])): 0.0 for name in pure})
    for name, part in zip(pure, shares_of(amounts)[0], strict=True):
        shares[next(iter(recipes[name]))] += part
    return _of_shares(shares, float(misfit[0]))


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
        inside = film_reflectance(2.0 * mixed_k, 0.75 * mixed_s, cards[:, None, None])
        outside = _SURFACE.reading(inside)
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


PEERS = {
    "spectral angle, nearest film": spectral_angle,
    "derivative of -log R, nearest film": derivative,
    "unmixing of -log R (NNLS)": unmixing,
    "Kubelka-Munk, the same paints": kubelka_munk,
}
