"""Readings of films of some paints on a grid of amounts, by the layered solver: for each way in
which the paints may lie.

The grid replaces a search: nothing that explains a spectrum is missed, and evidence is a sum.
"""

import functools
import itertools
from collections.abc import Sequence
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
from ..search.table import Grounds
from ..search.task import IdentificationTask
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
        wavelengths: of the bands, nm.
        optics: of the instrument, which solve any coats.
        response: of the instrument, a table that serves for one coat.
        hides: whether the lowest coat hides the ground, however much there is of it.
    """

    coefficients: Float[np.ndarray, "2 paints bands"]
    grounds: Grounds
    wavelengths: Bands
    optics: Optics
    response: FilmResponse
    hides: bool = False

    @classmethod
    def of(
        cls, task: IdentificationTask, members: Sequence[int], grounds: Grounds
    ) -> "CoatedFilms":
        """Films of some of a search's paints, by number."""
        return cls(
            coefficients=np.stack(task.paints)[:, list(members)].astype(float),
            grounds=grounds,
            wavelengths=task.wavelengths,
            optics=task.optics,
            response=task.response,
        )

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
        depths = [
            np.einsum("cfp,cpb->cfb", amounts[..., coat], self.coefficients[:, coat], optimize=True)
            for coat in map(list, arrangement.coats)
            if amounts[..., coat].any()
        ]
        if not depths:
            # An optical thickness that does as if there were nothing.
            depths = [np.full((2, amounts.shape[1], self.wavelengths.size), 1e-9)]
        elif self.hides:
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
        self, arrangement: Arrangement, amounts: FilmAmounts, quantities: Sequence[int] = (0, 1)
    ) -> tuple[FilmReadings, FilmSlopes]:
        """Readings, and their slopes by the log of every paint's k, then s.

        Args:
            arrangement: how the paints lie.
            amounts: of the paints, in usual ones.
            quantities: 0 for slopes by k, 1 for those by s.
        """
        # The amounts as they are, then with more of each paint's k, then with more of its s.
        shifts = [(quantity, paint) for quantity in quantities for paint in arrangement.paints]
        shifted = np.tile(amounts, (1 + len(shifts), 2, 1, 1))
        for number, (quantity, paint) in enumerate(shifts, start=1):
            shifted[number, quantity, :, paint] *= np.exp(_STEP)
        # All in one call: the solver takes films by the thousand.
        rows = shifted.swapaxes(0, 1).reshape(2, -1, amounts.shape[1])
        readings = self.read(arrangement, rows).reshape(len(shifted), len(amounts), -1)
        return readings[0], ((readings[1:] - readings[0]) / _STEP).swapaxes(0, 1)


def node_logs(count: int) -> FilmAmounts:
    """Log amounts of so many paints at the nodes of the grid: all their combinations."""
    axis = np.linspace(*LOG_AMOUNTS, NODES[count])
    return np.array(list(itertools.product(axis, repeat=count)))


class GridReadings(NamedTuple):
    """Readings of an arrangement at each node of the grid, without the outer surface's part.

    Attributes:
        readings: over each ground, ground by ground.
        slopes: by the log of each paint's k.
        patches: what is seen where a part of the film is missing, in each way in which it may be.
    """

    readings: Float[np.ndarray, "nodes readings"]
    slopes: Float[np.ndarray, "nodes paints readings"]
    patches: Sequence[Float[np.ndarray, "nodes readings"]]


def grid_readings(arrangement: Arrangement, films: CoatedFilms) -> GridReadings:
    """Readings of an arrangement on the grid of its paints' amounts."""
    paints = arrangement.paints
    logs = node_logs(len(paints))
    # Paints that the arrangement lacks have no amount.
    amounts = np.zeros((len(logs), films.coefficients.shape[1]))
    amounts[:, paints] = np.exp(logs)
    readings, slopes = films.read_and_slopes(arrangement, amounts, quantities=(0,))
    # Paints that remain where a part of the film is missing: of several coats all but those of the
    # upper one, of a mixture either paint alone, of one paint none. What is below a film that hides
    # its ground is not known.
    numbers = np.arange(amounts.shape[1])
    if arrangement.layered:
        remaining = [~np.isin(numbers, arrangement.coats[0])]
    elif len(paints) > 1:
        remaining = [numbers == paint for paint in paints]
    else:
        remaining = [] if films.hides else [numbers < 0]
    patches = [films.read(arrangement, (amounts * mask)[None]) for mask in remaining]
    return GridReadings(readings=readings, slopes=slopes, patches=patches)


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
