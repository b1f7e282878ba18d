"""Which mixtures may explain a spectrum: sets of paints, and a coarse search that says where to
start each.

A candidate is a set of one to three paints; its unknowns are the amounts a_i = thickness times
fraction, in units of a usual thickness, so that k d = sum a_i k_i. Sets of one and two paints are
all tried on a grid of amounts (`glazefit.identify.search.table`). Sets of three grow from the best pairs,
so that the cost stays in proportion to the number of paints.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from glazejax import Pigment

from ...film.response import FilmResponse

# Fractions of the first paint of a pair: strong paints show at a thousandth, weak ones drown at
# nine tenths.
_FRACTIONS = np.array([0.002, 0.008, 0.03, 0.1, 0.25, 0.5, 0.75, 0.9, 0.97, 0.992, 0.998])
# Totals in standard deviations of their logarithm.
_TOTALS = np.linspace(-4.3, 4.0, 13)
# Amounts of a third paint, as a share of the pair's.
_THIRDS = np.array([0.003, 0.02, 0.1, 0.4, 1.5])


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
            jnp.asarray(thickness * np.asarray([getattr(p, part) for p in pigments], float), float)
            for part in ("absorption", "scattering")
        )
    )


def sets_of(count: int, size: int) -> Int[np.ndarray, "sets size"]:
    """All sets of `size` different paints out of `count`, numbers ascending."""
    sets = list(itertools.combinations(range(count), size))
    return np.asarray(sets, dtype=np.int32).reshape(-1, size)


def amounts_grid(size: int, spread: float) -> Float[np.ndarray, "points size"]:
    """Amounts at which sets of one or two paints are tried.

    Args:
        size: 1 or 2.
        spread: standard deviation of the log of the total.

    Raises:
        ValueError: another size.
    """
    totals = np.exp(spread * _TOTALS)
    if size == 1:
        return totals[:, None]
    if size == 2:
        shares = np.stack([_FRACTIONS, 1.0 - _FRACTIONS], axis=-1)
        return (totals[:, None, None] * shares).reshape(-1, 2)
    raise ValueError(f"there is a grid for one or two paints, not for {size}")


def film_readings(
    response: FilmResponse, paints: Paints, sets: Array, amounts: Array, ground: Array
) -> Float[Array, "sets tries readings"]:
    """What films read over each ground, ground by ground, without the surface's part.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: paints in each film, (sets, size).
        amounts: of each paint, several for each set, (sets, tries, size).
        ground: internal reflectance, (grounds, bands).
    """
    k = jnp.einsum("ntm,nmb->ntb", amounts, paints.absorption[sets])
    s = jnp.einsum("ntm,nmb->ntb", amounts, paints.scattering[sets])
    black, gain, back = (a[:, :, None, :] for a in response.numbers(k, s))
    return (black + gain * ground / (1.0 - back * ground)).reshape(*k.shape[:2], -1)


def grow(
    pairs: Int[np.ndarray, "spectra pairs 2"],
    amounts: Float[np.ndarray, "spectra pairs 2"],
    count: int,
) -> tuple[Int[np.ndarray, "spectra triples 3"], Float[np.ndarray, "spectra triples shares 3"]]:
    """Sets of three from pairs, each with every other paint, and amounts to try.

    Returns:
        Sets, not sorted and some of them twice, pair first; and their amounts, a few of the third
        paint's.
    """
    spectra, kept, _ = pairs.shape
    thirds = np.broadcast_to(np.arange(count, dtype=np.int32), (spectra, kept, count))
    rest = (thirds[..., None] != pairs[:, :, None, :]).all(axis=-1)
    thirds = thirds[rest].reshape(spectra, kept, count - 2)
    both = np.broadcast_to(pairs[:, :, None, :], (*thirds.shape, 2))
    sets = np.concatenate([both, thirds[..., None]], axis=-1)
    total = amounts.sum(axis=-1)[..., None, None] * _THIRDS
    tried = np.broadcast_to(amounts[:, :, None, None, :], (*thirds.shape, _THIRDS.size, 2))
    third = np.broadcast_to(total, tried.shape[:-1])
    tried = np.concatenate([tried, third[..., None]], axis=-1)
    return sets.reshape(spectra, -1, 3), tried.reshape(spectra, -1, _THIRDS.size, 3)


@jax.jit
def score(
    response: FilmResponse,
    paints: Paints,
    sets: Array,
    amounts: Array,
    ground: Array,
    target: Array,
    whitening: Array,
) -> tuple[Float[Array, "spectra sets"], Int[Array, "spectra sets"]]:
    """Least cost of sets over the amounts to try, and which of these it is; each spectrum has sets
    of its own.

    Args:
        response: of the instrument.
        paints: of the catalogue.
        sets: (spectra, sets, size).
        amounts: to try, (spectra, sets, tries, size).
        ground: internal reflectance, (spectra, grounds, bands).
        target: spectra without the surface, in units of their errors, (spectra, readings).
        whitening: (readings, readings).
    """

    def one(spectrum: tuple) -> tuple[Array, Array]:
        sets, amounts, ground, target = spectrum
        films = film_readings(response, paints, sets, amounts, ground)
        cost = jnp.sum((target - films @ whitening.T) ** 2, axis=-1)
        return cost.min(axis=-1), jnp.argmin(cost, axis=-1)

    return jax.lax.map(one, (sets, amounts, ground, target))


def unique_best(
    sets: Int[np.ndarray, "sets size"], cost: Float[np.ndarray, "sets"], keep: int
) -> Int[np.ndarray, "kept"]:
    """Numbers of the `keep` cheapest different sets (fewer if there are fewer)."""
    order = np.argsort(cost, kind="stable")
    members = np.sort(sets[order], axis=-1)
    _, first = np.unique(members, axis=0, return_index=True)
    return order[np.sort(first)[:keep]]
