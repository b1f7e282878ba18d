"""A catalogue's films in a table, each as a few numbers, so that spectra are compared with all of
them at once.

What films read varies smoothly with the wavelength and with their amounts: in the units of common
errors some twenty numbers separate two films well enough for a ranking. A spectrum is compared
with all films of a table by one product of matrices in single precision; the best of them are then
fitted.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from glazejax import Pigment
from glazejax.programs import Program
from glazejax.radiative.common.chunks import by_blocks

from ...film.model.response import FilmResponse, over_ground
from .pool import NOBODY

WhiteningMatrix: TypeAlias = Float[np.ndarray, "readings readings"]
"""W, so that errors common to all films are |W r|^2."""
FlatReadings: TypeAlias = Float[np.ndarray, "spectra readings"]
"""Readings of each spectrum over all grounds in one row."""
Grounds: TypeAlias = Float[np.ndarray, "grounds bands"]
"""Internal reflectance of each ground below a film."""
Block: TypeAlias = Int[np.ndarray, "block"]
"""Numbers of the films, or of the spectra, that are computed together."""
COMPONENTS = 20
"""Numbers that stand for a film's readings while sets are ranked."""
_FILMS_AT_A_TIME = 4096
# Fractions of the first paint of a pair: strong paints show at a thousandth, weak ones drown at
# nine tenths.
_FRACTIONS = np.array([0.002, 0.008, 0.03, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 0.992, 0.998])
# Shares of sets of one paint, and of two.
_SHARES = (np.array([[1.0, 0.0]]), np.stack([_FRACTIONS, 1.0 - _FRACTIONS], axis=-1))
# Totals in standard deviations of their logarithm.
_TOTALS = np.linspace(-4.3, 4.0, 13)


class Paints(NamedTuple):
    """Optical thicknesses of the catalogue's paints at the usual thickness, on the grid of the
    spectra.
    """

    absorption: Float[Array, "paints bands"]
    scattering: Float[Array, "paints bands"]


def paints_of(pigments: Sequence[Pigment], thickness: float) -> Paints:
    """Pigments on the grid of the spectra, with this thickness (m) as the usual one."""
    return Paints(
        *(
            jnp.asarray(
                thickness * np.asarray([getattr(p, quantity) for p in pigments], float), float
            )
            for quantity in ("absorption", "scattering")
        )
    )


def sets_of(count: int, size: int) -> Int[np.ndarray, "sets size"]:
    """All sets of `size` different paints out of `count`, numbers ascending."""
    sets = list(itertools.combinations(range(count), size))
    return np.asarray(sets, dtype=np.int32).reshape(-1, size)


def film_readings(
    response: FilmResponse, paints: Paints, sets: Array, amounts: Array, ground: Array
) -> Float[Array, "sets tries readings"]:
    """Readings of films over each ground, ground by ground, without the surface's part.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: paints in each film, (sets, size).
        amounts: of each paint, several for each set, (sets, tries, size).
        ground: internal reflectance, (grounds, bands).
    """
    k = jnp.einsum("ntm,nmb->ntb", amounts, paints.absorption[sets])
    s = jnp.einsum("ntm,nmb->ntb", amounts, paints.scattering[sets])
    numbers = (a[:, :, None, :] for a in response.numbers(k, s))
    return over_ground(*numbers, ground=ground).reshape(*k.shape[:2], -1)


_read = Program(film_readings)


class TableOfSize(NamedTuple):
    """Films of all sets of one size, with room for two paints."""

    sets: Int[np.ndarray, "sets 2"]
    grid: Float[np.ndarray, "points 2"]  # amounts of each paint
    films: Float[np.ndarray, "components+1 films"]  # all sets at one point of the grid after
    # another, single precision; below them minus half their square


class FilmTable(NamedTuple):
    """Films over one ground.

    Attributes:
        project: from readings to components; errors of unit covariance stay so.
        middle: components of the mean film.
        white: W, so that errors common to all films are |W r|^2.
        sizes: films of one paint, of two paints.
    """

    project: Float[np.ndarray, "components readings"]
    middle: Float[np.ndarray, "components"]
    white: WhiteningMatrix
    sizes: tuple[TableOfSize, ...]

    def nearest(self, target: FlatReadings, keep: int) -> "NearestSets":
        """Sets that come nearest to each spectrum, those of one paint before those of two.

        Args:
            target: spectra without the mean surface.
            keep: sets of two paints that are kept, the nearest; of one paint all are.
        """
        spectra = (target @ self.project.T - self.middle).astype(np.float32)
        # Minus half of the misfit that differs, by one product: the spectrum's components, and 1.
        augmented = np.concatenate([spectra, np.ones((len(spectra), 1), np.float32)], axis=1)

        def look(n: Block) -> NearestSets:
            sets = []
            amounts = []
            for kind, count in zip(self.sizes, (None, keep), strict=False):
                near = (augmented[n] @ kind.films).reshape(-1, len(kind.grid), len(kind.sets))
                best = np.argsort(-near.max(axis=1), axis=1, kind="stable")[:, :count]
                where = np.argmax(np.take_along_axis(near, best[:, None], axis=2), axis=1)
                sets.append(kind.sets[best])
                amounts.append(kind.grid[where])
            return NearestSets(np.concatenate(sets, axis=1), np.concatenate(amounts, axis=1))

        # Sixteen spectra at a time bound the memory.
        return by_blocks(len(spectra), min(16, len(spectra)), look)


class NearestSets(NamedTuple):
    """Sets that come near each spectrum, of a size the nearest first; they are filled up with
    `NOBODY`.
    """

    sets: Int[np.ndarray, "spectra kept size"]
    amounts: Float[np.ndarray, "spectra kept size"]  # of each paint


def film_table(
    response: FilmResponse,
    paints: Paints,
    largest: int,
    spread: float,
    ground: Grounds,
    white: WhiteningMatrix,
) -> FilmTable:
    """Films of all sets of one paint, and of two if `largest` is more than one.

    Args:
        response, paints: of the instrument and of the catalogue, in single precision.
        largest: set that is looked for, of no more paints than there are.
        spread: standard deviation of the log of a film's total.
        ground: internal reflectance under the films.
        white: W, so that errors common to all films are |W r|^2.
    """
    count = len(paints.absorption)
    totals = np.exp(spread * _TOTALS)[:, None, None]
    # Of one paint: nothing of a second one.
    kinds = [
        (
            np.pad(sets_of(count, size), ((0, 0), (0, 2 - size)), constant_values=NOBODY),
            (totals * shares).reshape(-1, 2),
        )
        for size, shares in enumerate(_SHARES[:largest], start=1)
    ]
    project = np.eye(ground.size)
    middle = np.zeros(ground.size)

    def read(
        sets: np.ndarray, grid: np.ndarray, to: np.ndarray
    ) -> Float[np.ndarray, "films components"]:
        """Components of films, set by set and in each point by point of the grid.

        Of one shape for films of one paint and of two, so that one program is compiled.
        """
        amounts = grid[:, None].astype(np.float32)
        below = ground.astype(np.float32)

        def run(n: Block) -> np.ndarray:
            members, tries = sets[n // len(grid)], amounts[n % len(grid)]
            films = _read(response, paints, members, tries, below)
            return np.asarray(films, np.float64).reshape(len(n), -1) @ to.T

        return by_blocks(len(sets) * len(grid), _FILMS_AT_A_TIME, run)

    if ground.size > COMPONENTS:
        # Many readings are projected to the components that films span.
        some = []
        for sets, grid in kinds:
            # Sets from all over them, at every point of the grid.
            some_sets = max(1, _FILMS_AT_A_TIME // len(grid))
            chosen = np.linspace(0, len(sets) - 1, some_sets).astype(int)
            some.append(read(sets[chosen], grid, white))
        films = np.concatenate(some)
        middle = films.mean(axis=0)
        off = films - middle
        # The directions in which films differ most.
        project = np.linalg.eigh(off.T @ off)[1][:, : -COMPONENTS - 1 : -1].T
    # All sets at all amounts, in components.
    to_components = project @ white
    middle = project @ middle
    tables = []
    for sets, grid in kinds:
        films = (read(sets, grid, to_components) - middle).astype(np.float32)
        films = films.reshape(len(sets), len(grid), -1).transpose(2, 1, 0).reshape(len(middle), -1)
        half = -0.5 * np.sum(films**2, axis=0)
        tables.append(TableOfSize(sets, grid, np.concatenate([films, half[None]])))
    return FilmTable(to_components, middle, white, tuple(tables))
