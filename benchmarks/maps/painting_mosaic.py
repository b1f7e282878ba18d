"""A mosaic of measured films, as a camera would see it: no spectrum in it was computed.

Each tile is a film of the revigo set over its white card, as it was measured. The camera's part is
put on: light that is uneven, blur over the edges of tiles, noise. The paints that a map is given
are those of a joint fit without the films that the mosaic is made of; `FOREIGN` paints it is not
given at all.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter

from benchmarks.measured import measured_films
from benchmarks.rivals.known_painting import NOISE, PLACES, TRUTH, Scenery
from benchmarks.rivals.known_painting_scene import FOREIGN, Waves
from glazefit import ground_from_air, recover_jointly
from glazefit.film.films import Films
from glazefit.recover.joint import UNIT
from glazejax import Pigment
from glazejax.geometry import resolve_instrument

GAIN = 0.02
"""Standard deviation of the light over the mosaic."""
BLUR = 0.8
"""Standard deviation of the camera's blur, pixels."""
_TILE = 28
# How far edges of tiles are bent, how far the blur is followed, and how near an edge is one; pixels.
_BENT = 5.0
_HALO = 4
_EDGE = 2


@dataclass(frozen=True)
class Mosaic(Scenery):
    """A mosaic that is computed where it is asked for.

    Attributes:
        foreign: names of paints that a map is not given.
        films: readings of the films, (films, bands).
        recipes: of each film, name of a paint -> share by mass.
    """

    foreign: tuple[str, ...]
    films: Float[np.ndarray, "films bands"]
    recipes: tuple[dict[str, float], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Paints by the number that the truth gives them."""
        return (*(paint.name for paint in self.paints), *self.foreign)

    @cached_property
    def _bends(self) -> list[Waves]:
        rng = np.random.default_rng([self.seed, 1])
        return [Waves(rng, (4, 20)), Waves(rng, (4, 20)), Waves(rng, (0.5, 3))]

    @cached_property
    def _tiles(self) -> Int[np.ndarray, "rows columns"]:
        size = [2 * int(2 * _BENT) // _TILE + length // _TILE + 4 for length in self.shape]
        return np.random.default_rng([self.seed, 2]).integers(0, len(self.films), size)

    def labels(self, y0: int, y1: int) -> Int[np.ndarray, "rows columns"]:
        """Number of the film of each pixel in rows y0 to y1, which may lie beyond the mosaic."""
        x = np.arange(self.shape[1])
        y = np.arange(y0, y1)
        across, down = x / self.shape[1], y / self.shape[0]
        one, two, _ = self._bends
        column = (x[None] + _BENT * one(across, down)) // _TILE + 1
        row = (y[:, None] + _BENT * two(across, down)) // _TILE + 1
        rows, columns = self._tiles.shape
        return self._tiles[
            np.clip(row, 0, rows - 1).astype(int), np.clip(column, 0, columns - 1).astype(int)
        ]

    def inside(self, y0: int, y1: int) -> Bool[np.ndarray, "rows columns"]:
        """Which pixels of rows y0 to y1 see next to nothing but one film."""
        around = self.labels(y0 - _EDGE, y1 + _EDGE)
        least, most = (
            bound(around, 2 * _EDGE + 1, mode="nearest")
            for bound in (minimum_filter, maximum_filter)
        )
        return (least == most)[_EDGE:-_EDGE]

    def rows(self, y0: int, y1: int) -> Float[np.ndarray, "rows x bands"]:
        """Reflectance of rows y0 to y1 as the camera gives it, float32."""
        clear = self.films[self.labels(y0 - _HALO, y1 + _HALO)].astype(np.float32)
        seen = gaussian_filter(clear, (BLUR, BLUR, 0), mode="nearest", radius=(_HALO, _HALO, 0))
        found = seen[_HALO:-_HALO]
        light = self._bends[2](
            np.arange(self.shape[1]) / self.shape[1], np.arange(y0, y1) / self.shape[0]
        )
        found *= (1.0 + GAIN * light)[..., None]
        self.add_noise(found, y0, stream=3)
        return found

    def truth(self, y0: int, y1: int) -> dict[str, np.ndarray]:
        """Recipes of rows y0 to y1, by the names of `benchmarks.rivals.known_painting.TRUTH`; amounts are
        shares by mass, since nobody measured the films' thickness.
        """
        labels = self.labels(y0, y1)
        number_of = {name: n for n, name in enumerate(self.names)}
        members = np.full((len(self.films), PLACES), -1)
        shares = np.zeros((len(self.films), PLACES))
        for film, recipe in enumerate(self.recipes):
            parts = sorted((number_of[name], share) for name, share in recipe.items())
            members[film, : len(parts)] = [number for number, _ in parts]
            shares[film, : len(parts)] = [share for _, share in parts]
        foreign = np.asarray((members >= len(self.paints)).any(axis=1))
        found = {
            "members": members[labels],
            "coats": np.zeros((*labels.shape, PLACES)),
            "amounts": shares[labels],
            "region": labels,
            "foreign": foreign[labels],
        }
        return {name: values.astype(TRUTH[name]) for name, values in found.items()}


def mosaic(shape: tuple[int, int], seed: int = 0, paints: list[Pigment] | None = None) -> Mosaic:
    """A mosaic of the films that its paints' fit has not seen.

    Every second film of several paints is left out of the fit, and every film with foreign paint.

    Args:
        shape: (y, x) in pixels.
        seed: another seed is another mosaic of the same films.
        paints: of the fit, where they are known already.

    Raises:
        SystemExit: the measurements are not there.
    """
    films, weights = measured_films()
    recipes = {
        name: {paint: weight for paint, weight in weights[name].items() if weight > 0}
        for name in films.names
    }
    foreign = [name for name in films.names if set(FOREIGN) & set(recipes[name])]
    several = [name for name in films.names if len(recipes[name]) > 1 and name not in foreign]
    left_out = several[::2]
    if paints is None:
        paints = fitted_paints(films, weights, [*foreign, *left_out])
    known = {paint.name for paint in paints}
    shown = [name for name in (*left_out, *foreign) if set(recipes[name]) <= known | set(FOREIGN)]
    chosen = films.select(shown)
    totals = [sum(recipes[name].values()) for name in shown]
    card = np.asarray(films.bare_white).mean(axis=0)
    return Mosaic(
        shape=shape,
        wavelengths=np.asarray(films.wavelengths, float),
        paints=paints,
        foreign=FOREIGN,
        noise=NOISE,
        ground=np.asarray(ground_from_air(card, resolve_instrument("d:8"))),
        films=np.asarray(chosen.over_white),
        recipes=tuple(
            {paint: weight / total for paint, weight in recipes[name].items()}
            for name, total in zip(shown, totals, strict=True)
        ),
        seed=seed,
    )


def fitted_paints(
    films: Films, recipes: dict[str, dict[str, float]], left_out: list[str]
) -> list[Pigment]:
    """Paints of a joint fit without some of the films."""
    kept = films.select([name for name in films.names if name not in left_out])
    fit = recover_jointly(kept, {name: recipes[name] for name in kept.names})
    return list(fit.pigments(UNIT).values())
