"""What films of some paints read on a grid of amounts, by the layered solver: for each way in which
the paints may lie.

The grid replaces a search: nothing that explains a spectrum is missed, and evidence is a sum.
"""

import functools
import itertools
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.programs import Program

from ...film.model.optics import Optics
from ...film.model.response import FilmResponse
from ..families.templates import coat_body
from .arrangement import Arrangement

LOG_AMOUNTS = (-3.6, 3.2)
"""Least and largest log of a paint's amount, in usual ones."""
NODES = {1: 29, 2: 15, 3: 9}
"""Nodes of the grid along each amount, by the number of paints."""
_TOLERANCE = 1e-3
# Change of log k for a slope.
_STEP = 0.15
# Scattering optical thickness of a coat that hides what is below.
_HIDING = 200.0
# Optical thickness that does as if there were nothing.
_NEXT_TO_NOTHING = 1e-9
# Films that are solved at a time, so that one program does.
_CHUNK = 8192


class Paints(NamedTuple):
    """Paints of a set on the bands of the readings.

    Attributes:
        absorption, scattering: optical thicknesses of a usual amount, (paints, bands).
    """

    absorption: Float[np.ndarray, "paints bands"]
    scattering: Float[np.ndarray, "paints bands"]

    def with_scattering(self, factors: Float[np.ndarray, "paints"]) -> "Paints":
        """The same paints, each with a multiple of its scattering."""
        return self._replace(scattering=self.scattering * factors[:, None])


class Solver(NamedTuple):
    """An instrument: exact for any coats, and a table that serves for one."""

    optics: Optics
    response: FilmResponse


class GridReadings(NamedTuple):
    """What an arrangement reads at each node of the grid, without the outer surface's part.

    Attributes:
        readings: (nodes, bands).
        slopes: by the log of each paint's k, (paints, nodes, bands).
        patches: what is seen where a part of the film is missing: each a way in which it may be,
            (ways, nodes, bands).
    """

    readings: Float[np.ndarray, "nodes bands"]
    slopes: Float[np.ndarray, "paints nodes bands"]
    patches: Float[np.ndarray, "ways nodes bands"]


def log_amounts(count: int) -> Float[np.ndarray, "nodes paints"]:
    """Logs of the amounts at the nodes of a grid."""
    axis = np.linspace(*LOG_AMOUNTS, NODES[count])
    return np.array(list(itertools.product(axis, repeat=count)))


def grid_readings(
    arrangement: Arrangement,
    paints: Paints,
    solver: Solver,
    ground: Float[np.ndarray, "bands"] | None,
) -> GridReadings:
    """Readings of an arrangement on the grid of its paints' amounts.

    Args:
        arrangement: how the paints lie.
        paints: of the set.
        solver: of the instrument.
        ground: internal reflectance of what is below, or None for films that hide it: then the
            lowest coat does.
    """
    own = arrangement.paints
    logs = log_amounts(len(own))
    amounts = np.zeros((len(logs), len(paints.absorption)))
    amounts[:, own] = np.exp(logs)

    def read(amounts: np.ndarray, absorption: np.ndarray) -> np.ndarray:
        moved = paints._replace(absorption=absorption)
        return _read(arrangement, moved, amounts, solver, ground)

    readings = read(amounts, paints.absorption)
    slopes = []
    for place in own:
        more = paints.absorption.copy()
        more[place] *= np.exp(_STEP)
        slopes.append((read(amounts, more) - readings) / _STEP)
    parts = _parts(arrangement, amounts.shape[1], ground is None)
    patches = [read(amounts * there, paints.absorption) for there in parts]
    return GridReadings(
        readings=readings,
        slopes=np.array(slopes),
        patches=np.array(patches).reshape(len(parts), *readings.shape),
    )


def _parts(arrangement: Arrangement, count: int, hides: bool) -> list[Float[np.ndarray, "paints"]]:
    """What is there where a part is missing: of several coats all but the upper one, of a mixture
    either paint alone, of one paint nothing.

    Args:
        arrangement: how the paints lie.
        count: of the set's paints.
        hides: whether the film hides its ground, which is then not known.
    """
    if len(arrangement.coats) > 1:
        there = np.ones(count)
        there[list(arrangement.coats[0])] = 0.0
        return [there]
    paints = arrangement.paints
    if len(paints) == 1:
        return [] if hides else [np.zeros(count)]
    return [np.eye(count)[place] for place in paints]


def _read(
    arrangement: Arrangement,
    paints: Paints,
    amounts: Float[np.ndarray, "nodes paints"],
    solver: Solver,
    ground: Float[np.ndarray, "bands"] | None,
) -> Float[np.ndarray, "nodes bands"]:
    """Readings of coats of these amounts, some of which may be 0."""
    coats = [coat for coat in arrangement.coats if amounts[:, list(coat)].any()]
    absorption = []
    scattering = []
    for number, coat in enumerate(coats):
        inside = np.zeros_like(amounts)
        inside[:, list(coat)] = amounts[:, list(coat)]
        if ground is None and number == len(coats) - 1:
            # The lowest coat hides what is below, however much there is of it.
            depth = inside @ paints.scattering
            inside = inside * (_HIDING / np.median(depth, axis=1, keepdims=True))
        absorption.append(inside @ paints.absorption)
        scattering.append(inside @ paints.scattering)
    below = np.full(paints.absorption.shape[1], 0.5) if ground is None else ground
    if not coats:
        absorption = scattering = [np.full((len(amounts), below.size), _NEXT_TO_NOTHING)]
    if len(absorption) == 1:
        return coat_body(solver.response, absorption[0], scattering[0], 1.0, below)
    return _solve(np.stack(absorption, -1), np.stack(scattering, -1), below, solver.optics)


def _solve(
    absorption: Float[np.ndarray, "nodes bands coats"],
    scattering: Float[np.ndarray, "nodes bands coats"],
    ground: Float[np.ndarray, "bands"],
    optics: Optics,
) -> Float[np.ndarray, "nodes bands"]:
    """Reflectance of stacks, in pieces of one shape."""
    shape = absorption.shape[:2]
    coats = max(absorption.shape[-1], 2)
    flat = np.zeros((2, shape[0] * shape[1], coats))
    flat[0, :, : absorption.shape[-1]] = absorption.reshape(-1, absorption.shape[-1])
    flat[1, :, : scattering.shape[-1]] = scattering.reshape(-1, scattering.shape[-1])
    below = np.broadcast_to(ground, shape).reshape(-1)
    count = flat.shape[1]
    # The first films fill up the last piece.
    whole = np.resize(np.arange(count), -(-count // _CHUNK) * _CHUNK)
    pieces = [
        np.asarray(_body(flat[0, piece], flat[1, piece], below[piece], optics))
        for piece in np.split(whole, len(whole) // _CHUNK)
    ]
    return np.concatenate(pieces)[:count].reshape(shape).astype(np.float64)


@functools.partial(Program, fixed=("optics",))
def _body(
    absorption: Float[Array, "films coats"],
    scattering: Float[Array, "films coats"],
    ground: Float[Array, "films"],
    optics: Optics,
) -> Float[Array, "films"]:
    return optics.body(
        jnp.asarray(absorption, float),
        jnp.asarray(scattering, float),
        jnp.asarray(ground, float),
        _TOLERANCE,
    )
