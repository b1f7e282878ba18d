"""Readings of films of some paints on a grid of amounts, by the layered solver: for each way in
which the paints may lie.

The grid replaces a search: nothing that explains a spectrum is missed, and evidence is a sum.
"""

import functools
import itertools
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Array, Float, Int

from glazejax.programs import Program
from glazejax.radiative.common.chunks import by_blocks
from glazejax.spectra import Bands

from ...film.model.optics import Optics
from ...film.model.response import FilmResponse
from ..families.templates import FilmCurves, coat_body
from ..search.refine import FilmReadings, FilmSlopes
from .arrangement import Arrangement

FilmAmounts: TypeAlias = Float[np.ndarray, "films paints"]
"""Amounts of the paints of each film in usual ones, or their logs."""
LOG_AMOUNTS = (-3.6, 3.2)
"""Least and largest log of a paint's amount, in usual ones."""
NODES = {1: 29, 2: 15, 3: 9}
"""Nodes of the grid along each amount, by the number of paints."""
# Change of log k for a slope.
_STEP = 0.15
# Films that are solved at a time, so that one program does.
_CHUNK = 8192


class CoatedFilms(NamedTuple):
    """Films of a set of paints over one ground or several, as an instrument reads them.

    Attributes:
        coefficients: optical thicknesses of a usual amount of each paint, k then s.
        grounds: internal reflectance of what is below.
        optics: of the instrument, which solve any coats.
        response: of the instrument, a table that serves for one coat.
        hides: whether the lowest coat hides the ground, however much there is of it.
    """

    coefficients: Float[np.ndarray, "2 paints bands"]
    grounds: Float[np.ndarray, "grounds bands"]
    optics: Optics
    response: FilmResponse
    hides: bool = False

    def read(
        self, arrangement: Arrangement, amounts: Float[np.ndarray, "#2 films paints"]
    ) -> FilmReadings:
        """Readings over each ground, ground by ground, without the outer surface's part.

        Args:
            arrangement: how the paints lie.
            amounts: of the paints that absorb, and of those that scatter, in usual ones; a coat may
                have none.
        """
        amounts = np.broadcast_to(amounts, (2, *amounts.shape[1:]))
        coats = [list(coat) for coat in arrangement.coats if amounts[..., list(coat)].any()]
        depths = [
            np.einsum("cfp,cpb->cfb", amounts[..., coat], self.coefficients[:, coat], optimize=True)
            for coat in coats
        ]
        if not coats:
            # An optical thickness that does as if there were nothing.
            depths = [np.full((2, amounts.shape[1], self.grounds.shape[1]), 1e-9)]
        if self.hides and coats:
            scattering = np.median(depths[-1][1], axis=1, keepdims=True)
            # Scattering optical thickness of a coat that hides what is below: 200.
            depths[-1] = depths[-1] * (200.0 / scattering)
        over = [
            coat_body(self.response, depths[0][0], depths[0][1], ground)
            if len(depths) == 1
            else _solve(np.stack(depths, axis=-1), ground, self.optics)
            for ground in self.grounds
        ]
        return np.concatenate(over, axis=-1)

    def read_and_slopes(
        self, arrangement: Arrangement, amounts: FilmAmounts
    ) -> tuple[FilmReadings, FilmSlopes]:
        """Readings, and their slopes by the log of every paint's k, then s."""
        paints = range(amounts.shape[1])
        # The amounts as they are, then with more of each paint's k, then with more of its s.
        shifted = np.stack(
            [amounts * np.ones((2, 1, 1))]
            + [_shifted(amounts, quantity, paint) for quantity in (0, 1) for paint in paints]
        )
        # All in one call: the solver takes films by the thousand.
        rows = shifted.swapaxes(0, 1).reshape(2, -1, amounts.shape[1])
        readings = self.read(arrangement, rows).reshape(len(shifted), len(amounts), -1)
        return readings[0], ((readings[1:] - readings[0]) / _STEP).swapaxes(0, 1)


def _shifted(
    amounts: FilmAmounts, quantity: int, paint: int
) -> Float[np.ndarray, "2 films paints"]:
    """Amounts with more of one paint's k (quantity 0) or s (1)."""
    shifted = np.stack([amounts, amounts])
    shifted[quantity, :, paint] *= np.exp(_STEP)
    return shifted


class GridReadings(NamedTuple):
    """Readings of an arrangement at each node of the grid, without the outer surface's part.

    Attributes:
        readings: over each ground, ground by ground.
        slopes: by the log of each paint's k.
        patches: what is seen where a part of the film is missing: each a way in which it may be.
    """

    readings: Float[np.ndarray, "nodes readings"]
    slopes: Float[np.ndarray, "paints nodes readings"]
    patches: Float[np.ndarray, "ways nodes readings"]


def grid_readings(arrangement: Arrangement, films: CoatedFilms) -> GridReadings:
    """Readings of an arrangement on the grid of its paints' amounts."""
    paints = arrangement.paints
    # A node is one combination of amounts; paints that the arrangement lacks have none.
    axis = np.linspace(*LOG_AMOUNTS, NODES[len(paints)])
    logs = np.array(list(itertools.product(axis, repeat=len(paints))))
    amounts = np.zeros((len(logs), films.coefficients.shape[1]))
    amounts[:, paints] = np.exp(logs)
    readings = films.read(arrangement, amounts[None])
    # One-sided differences by the log of each paint's k.
    slopes = [
        (films.read(arrangement, _shifted(amounts, 0, paint)) - readings) / _STEP
        for paint in paints
    ]
    # The same amounts, but for the part that is missing.
    patches = [
        films.read(arrangement, amounts[None] * present)
        for present in _patches(arrangement, amounts.shape[1], films.hides)
    ]
    return GridReadings(
        readings=readings,
        slopes=np.array(slopes),
        patches=np.array(patches).reshape(len(patches), *readings.shape),
    )


def _patches(
    arrangement: Arrangement, count: int, hides: bool
) -> list[Float[np.ndarray, "paints"]]:
    """Paints that are there, 1 or 0, where a part of the film is missing: of several coats all but
    the upper one, of a mixture either paint alone, of one paint nothing.

    Args:
        arrangement: how the paints lie.
        count: of the set's paints.
        hides: whether the film hides its ground, which is then not known.
    """
    if len(arrangement.coats) > 1:
        present = np.ones(count)
        present[list(arrangement.coats[0])] = 0.0
        return [present]
    paints = arrangement.paints
    if len(paints) == 1:
        return [] if hides else [np.zeros(count)]
    return [np.eye(count)[paint] for paint in paints]


def _solve(
    depths: Float[np.ndarray, "2 films bands coats"], ground: Bands, optics: Optics
) -> FilmCurves:
    """Reflectance of stacks, k d and s d of their coats."""
    shape = depths.shape[1:3]
    flat = depths.reshape(2, -1, depths.shape[-1])
    below = np.broadcast_to(ground, shape).reshape(-1)

    def run(rows: Int[np.ndarray, "block"]) -> Array:
        return _body(*flat[:, rows], below[rows], optics)

    return by_blocks(len(below), _CHUNK, run).reshape(shape).astype(np.float64)


@functools.partial(Program, fixed=("optics",))
def _body(
    absorption: Float[Array, "films coats"],
    scattering: Float[Array, "films coats"],
    ground: Float[Array, "films"],
    optics: Optics,
) -> Float[Array, "films"]:
    return optics.body(absorption, scattering, ground, 1e-3)
