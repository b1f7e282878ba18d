"""What people use to name pigments: spectral angle, derivatives, unmixing of -log R, Kubelka-Munk.
One film at a time.

Each method returns sets of families, best first; fractions of the best; and a misfit.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.paint.identification import UNIT, family
from benchmarks.paintbench.spectra import absorbance, cosine_distance, slopes
from benchmarks.rivals.baselines import Surface, film_reflectance, shares_of, spectra_of, unmix
from glazefit import Films, ground_from_air
from glazejax import Pigment

Found = tuple[list[frozenset[str]], dict[str, float], float]
Recipes = dict[str, dict[str, float]]


class Query(NamedTuple):
    """What a method may look at.

    Attributes:
        films: all readings.
        row: of the film in question.
        library: names of known films.
        recipes: of all films, by family.
        paints: k and s of a fit without the film.
    """

    films: Films
    row: int
    library: Sequence[str]
    recipes: Recipes
    paints: list[Pigment]

    def rows_of(self, values: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Rows of films by name."""
        return values[[self.films.names.index(name) for name in names]]


# Below this share a component counts as not there.
_PRESENT = 0.02
# At 8 degrees from air, diffuse from within; index 1.5.
_SURFACE = Surface(outer=0.0405, inner=0.596)


def _nearest(features: np.ndarray, query: Query) -> Found:
    """Known films by the angle between features, each set of pigments once."""
    known = query.rows_of(features, query.library)
    score = cosine_distance(known, features[[query.row]], least=1)[:, 0]
    order = np.argsort(score)
    ranked = [query.recipes[query.library[int(i)]] for i in order]
    return list(dict.fromkeys(map(frozenset, ranked))), ranked[0], float(score[order[0]])


def spectral_angle(query: Query) -> Found:
    """Least angle between spectra, both cards together."""
    films = query.films
    return _nearest(films.over_cards.reshape(len(films), -1), query)


def derivative(query: Query) -> Found:
    """Least angle between slopes of -log R over white."""
    return _nearest(slopes(absorbance(query.films.over_white)), query)


def unmixing(query: Query) -> Found:
    """Non-negative least squares of -log R over white from the known pure films."""
    values = absorbance(query.films.over_white)
    pure = [name for name in query.library if len(query.recipes[name]) == 1]
    amounts, misfit = unmix(query.rows_of(values, pure).T, values[[query.row]])
    shares: dict[str, float] = {}
    for name, part in zip(pure, shares_of(amounts)[0], strict=True):
        paint = next(iter(query.recipes[name]))
        shares[paint] = shares.get(paint, 0.0) + part
    return _of_shares(shares, float(misfit[0]))


def _of_shares(shares: dict[str, float], misfit: float) -> Found:
    there = {paint: part for paint, part in shares.items() if part > _PRESENT}
    ordered = sorted(there, key=lambda paint: -there[paint])
    sets = [frozenset(ordered), *(frozenset(ordered[:n]) for n in range(len(ordered) - 1, 0, -1))]
    return sets, there, misfit


def kubelka_munk(query: Query) -> Found:
    """Two-constant Kubelka-Munk with the same paints: singles and pairs on a grid of amounts, over
    both cards.

    K = 2 k and S = 3/4 s, Saunderson's correction; the least root mean square wins, a pair only
    where it halves it.
    """
    films, row, paints = query.films, query.row, query.paints
    k, s = np.moveaxis(spectra_of(paints), 1, 0) * UNIT
    cards = ground_from_air(films.bare_cards[row])
    seen = films.over_cards[row]
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
