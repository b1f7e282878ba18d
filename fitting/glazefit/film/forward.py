"""A film: coats of paints over a ground, and what an instrument reads of it.

A coat's k and s are its paints' sums, weighted by fraction, times its thickness; those of a coat of
unknown paint are sums of modes in log k d and log s d. One coat is read by its table, several by
the solver. Where the unknown coat is all that is open of several, a table is made of the whole
stack: the sampler asks a spline in place of the solver, at a tenth of its cost.
"""

import functools
import itertools
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.geometry import Instrument
from glazejax.programs import Program

from .films import CardReadings, Reading
from .model.optics import Optics
from .model.response import FilmResponse, film_response
from .model.spline import look_up, nodes_of, patches

OPAQUE_THICKNESS = (100.0, 400.0)
"""Optical thicknesses k d and s d at which every film is opaque."""
_NODES = 56

PerUnknown: TypeAlias = Float[Array, "dims"]
"""A number for each free unknown of one block, such as its value."""
Scalar: TypeAlias = Float[Array, ""]
"""One number of a block."""
Terms: TypeAlias = Float[Array, "rows"]
"""Residuals of one block, or readings in units of their errors."""
PerReading: TypeAlias = Float[Any, "*blocks bands grounds"]
"""A number for each reading of each block."""


class Slopes(NamedTuple):
    """Reflectance of coats without the surface's part, and its slopes.

    Errors are those of log k and of log s of the top coat, then of the next one.
    """

    body: Float[Array, "*films bands grounds"]
    by_ground: Float[Array, "*films bands grounds"]
    by_log: Float[Array, "*films errors bands grounds"]


class Expansion(NamedTuple):
    """Readings linear in the paints' errors (see `glazefit.film.errors`); rows are readings, band
    after band and ground after ground.
    """

    shift: Float[Any, "*blocks errors bands"]  # delta*, of log k and log s of each coat in turn
    offset: PerReading  # -J delta*
    whiten: Float[Any, "*blocks rows rows"]  # W
    spread: Float[Any, "*blocks rows"]  # roots of b
    place: Float[Any, "*blocks appearance"]  # of the film where it was made
    tilt: Float[Any, "*blocks appearance"]  # slopes of half the logarithm of C's determinant


class FilmData(NamedTuple):
    """Data of one film."""

    # k and s times the median thickness of the paint's coat
    absorption: Float[Any, "*blocks bands paints"]
    scattering: Float[Any, "*blocks bands paints"]
    shares: Float[Any, "*blocks paints"]  # fractions; of no meaning where they are unknown
    reflectance: PerReading
    ground: PerReading
    sd: PerReading
    ground_sd: PerReading
    # Independent errors of size one that the paints state, of log k and of log s
    stated: Float[Any, "*blocks modes paints 2 bands"]
    # Of a film that is not `Film.tabulated`.
    expansion: Expansion | None = None
    # Of one that is, of several coats: readings over each ground, their slopes by each ground, then
    # by each error of the known coats. A spline as `FilmResponse`'s, a table for each band, and for
    # the same reasons not `glazejax.interpolated` (100 times as slow, and off by .013).
    table: Float[Any, "*blocks bands cells 4 4 numbers"] | None = None


class FilmShared(NamedTuple):
    """Data that all films share."""

    response: FilmResponse | None  # of a single coat
    surface: Float[Any, ""]  # what a glossy surface adds to a reading
    smooth: Float[Any, "bands bands"]  # covariance of paints' errors of size 1
    # The model's own error: its size at a reflectance of 0, by how much that grows with the
    # reflectance, and its correlation, band after band and ground after ground
    model_size: Float[Any, "2"]
    model: Float[Any, "rows rows"]
    mean: Float[Any, "dims"]  # of the unknowns' prior
    sd: Float[Any, "dims"]
    levels: Float[Any, "2"]  # means of log k d and log s d of an unknown paint
    modes: Float[Any, "2 bands spectra"]  # their slopes by its unknowns


class Places(NamedTuple):
    """Slices of each unknown among the free ones; empty for what is known."""

    ratios: tuple[slice, ...]
    thickness: tuple[slice, ...]
    spectra: slice
    gloss: slice
    error: slice


@dataclass(frozen=True)
class Film:
    """Structure of a film's unknowns: fixed when a program is compiled, the same for all films side
    by side.

    The free unknowns, in order: for each coat the log-ratios of its fractions to the last, where
    they are unknown, and log thickness over its median, where that is; what log k d and log s d of
    an unknown paint are made of; logit gloss; log size of the paints' error.

    Attributes:
        sizes: paints of each coat, top first; 0 for the unknown one.
        fractions: whether those of a coat are unknown.
        thickness: whether that of a coat is.
        spectra: unknowns of an unknown paint; 0 if all paints are known.
        gloss: whether it is unknown.
        error: whether the size of the paints' error is.
        optics: of the instrument.
    """

    sizes: tuple[int, ...]
    fractions: tuple[bool, ...]
    thickness: tuple[bool, ...]
    spectra: int
    gloss: bool
    error: bool
    optics: Optics

    @property
    def unknown_coat(self) -> int | None:
        """Number of the coat whose paint is unknown, from 0."""
        return self.sizes.index(0) if 0 in self.sizes else None

    @property
    def tabulated(self) -> bool:
        """True if one coat is unknown and everything is known of all others: readings and slopes
        then come from a table at every place.
        """
        return self.unknown_coat is not None and not any((*self.fractions, *self.thickness))

    @property
    def paints(self) -> tuple[slice, ...]:
        """Slices of each coat's paints among all."""
        return _slices(self.sizes)

    @property
    def places(self) -> Places:
        """Slices of each unknown."""
        coats = zip(self.sizes, self.fractions, self.thickness, strict=True)
        counts = [n for size, unknown, thick in coats for n in (unknown * (size - 1), thick)]
        ends = _slices((*counts, self.spectra, self.gloss, self.error))
        return Places(ends[:-3:2], ends[1:-3:2], *ends[-3:])

    @property
    def dims(self) -> int:
        """Number of the free unknowns."""
        return self.places.error.stop

    def unknown_logs(self, free: PerUnknown, shared: FilmShared) -> Float[Array, "2 bands"]:
        """Log k d and log s d of the coat of unknown paint."""
        return shared.levels[:, None] + shared.modes @ free[self.places.spectra]

    def optical(
        self, free: PerUnknown, data: FilmData, shared: FilmShared
    ) -> Float[Array, "2 bands coats"]:
        """Optical thicknesses k d and s d of all coats, top first, without errors of the paints."""
        coats = []
        for n in range(len(self.sizes)):
            if n == self.unknown_coat:
                coats.append(jnp.exp(self.unknown_logs(free, shared)))
                continue
            coats.append(self.parts(n, free, data).sum(axis=-1))
        return jnp.stack(coats, axis=-1)

    def parts(self, n: int, free: PerUnknown, data: FilmData) -> Float[Array, "2 bands paints"]:
        """Optical thicknesses k d and s d of each paint of a coat, without errors of the paints."""
        members, positions = self.paints[n], self.places
        amounts = data.shares[members]
        if self.fractions[n]:
            amounts = jnp.exp(log_fractions(free[positions.ratios[n]]))
        # Of no unknown the sum is 0.
        amounts = amounts * jnp.exp(jnp.sum(free[positions.thickness[n]]))
        return jnp.stack([data.absorption[:, members], data.scattering[:, members]]) * amounts

    def surface(self, free: PerUnknown, shared: FilmShared) -> Scalar:
        """Reflectance that the surface adds to a reading."""
        return shared.surface * jnp.prod(jax.nn.sigmoid(free[self.places.gloss]))

    def body(
        self,
        response: FilmResponse | None,
        thickness: Float[Array, "2 *#batch coats"],
        ground: Float[Array, "*#batch"],
    ) -> Float[Array, "*batch"]:
        """Reflectance without the surface's part, from k d and s d of all coats, top first.

        Args:
            response: table of a single coat; None for the solver.
            thickness: optical thicknesses.
            ground: internal reflectance.
        """
        k, s = thickness
        if response is not None:
            return response.body(k[..., 0], s[..., 0], ground)
        # The solver's error is well below any instrument's.
        return self.optics.body(k, s, ground, tolerance=1e-4)

    def read(
        self,
        free: PerUnknown,
        data: FilmData,
        shared: FilmShared,
        errors: Float[Array, "2 #bands #coats"] | float = 0.0,
    ) -> Float[Array, "bands grounds"]:
        """Readings of the instrument where log k and log s of the coats have these errors."""
        coats = self.optical(free, data, shared) * jnp.exp(errors)
        body = self.body(shared.response, coats[:, :, None], data.ground)
        return self.surface(free, shared) + body

    def look_up(
        self, thickness: Float[Array, "2 bands"], data: FilmData, shared: FilmShared
    ) -> Slopes:
        """From k d and s d of the unknown coat of a film that is `tabulated`."""
        bands, grounds = data.ground.shape
        if data.table is None:
            assert shared.response is not None
            black, gain, back = (n[:, None] for n in shared.response.numbers(*thickness))
            denominator = 1.0 - back * data.ground
            return Slopes(
                body=black + gain / denominator * data.ground,
                by_ground=jnp.maximum(gain / denominator, 0.0) / denominator,
                by_log=jnp.zeros((0, bands, grounds)),
            )
        numbers = jax.vmap(lambda table, kd, sd: look_up(jnp, table, kd, sd, _NODES))(
            data.table, *thickness
        )
        values = jnp.moveaxis(numbers.reshape(bands, -1, grounds), 1, 0)
        return Slopes(body=values[0], by_ground=values[1], by_log=values[2:])


def pose_each_band(
    instrument: Instrument,
    surface: float | np.ndarray,
    modes: Float[np.ndarray, "2 2"],
    readings: CardReadings | Reading,
) -> tuple[Film, FilmData, FilmShared]:
    """Every band a film of its own: one coat of unknown paint, whose spectra are two numbers.

    Args:
        instrument: that read the bands.
        surface: what a smooth surface adds to a reading.
        modes: slopes of log k d and log s d by the two numbers.
        readings: of all bands, (bands, grounds).
    """
    film = Film(
        sizes=(0,),
        fractions=(False,),
        thickness=(False,),
        spectra=2,
        gloss=False,
        error=False,
        optics=Optics.of(instrument),
    )
    no_paint = np.zeros((len(readings.reflectance), 1, 0))
    shared = FilmShared(
        response=film_response(instrument),
        surface=np.array(surface),
        smooth=np.ones((1, 1)),
        model_size=np.zeros(2),
        model=np.eye(readings.ground.shape[-1]),
        mean=np.zeros(2),
        sd=np.ones(2),
        levels=np.zeros(2),
        modes=modes[:, None],
    )
    data = FilmData(
        absorption=no_paint,
        scattering=no_paint,
        shares=no_paint[:, 0],
        stated=np.zeros((len(no_paint), 0, 0, 2, 1)),
        **{what: getattr(readings, what)[:, None] for what in CardReadings._fields},
    )
    return film, data, shared


def _slices(counts: tuple[int, ...]) -> tuple[slice, ...]:
    """Places of so many things each, one after another."""
    ends = np.cumsum([0, *counts]).tolist()
    return tuple(slice(first, last) for first, last in itertools.pairwise(ends))


def log_fractions(ratios: Float[Array, "*n ratios"]) -> Float[Array, "*n paints"]:
    """Logarithms of the fractions from their log-ratios to the last one."""
    return jax.nn.log_softmax(jnp.concatenate([ratios, jnp.zeros_like(ratios[..., :1])], axis=-1))


@functools.partial(Program, fixed=("film",))
def slopes(
    film: Film,
    response: FilmResponse | None,
    logs: Float[Array, "films errors bands"],
    ground: Float[Array, "films bands grounds"],
) -> Slopes:
    """Reflectance and slopes at these log k d and log s d; an unknown paint has no error."""
    films, errors, bands = logs.shape
    coats = jnp.moveaxis(logs.reshape(films, errors // 2, 2, bands), (2, 1), (0, -1))
    wide = jnp.broadcast_to(coats[..., None, :], (2, *ground.shape, errors // 2))

    def total(coats: Array, ground: Array) -> tuple[Array, Array]:
        body = film.body(response, jnp.exp(coats), ground)
        return jnp.sum(body), body

    (by_log, by_ground), body = jax.grad(total, argnums=(0, 1), has_aux=True)(wide, ground)
    if film.unknown_coat is not None:
        by_log = by_log.at[..., film.unknown_coat].set(0.0)
    by_log = jnp.moveaxis(by_log, (-1, 0), (1, 2)).reshape(films, errors, *ground.shape[1:])
    return Slopes(body=body, by_ground=by_ground, by_log=by_log)


def tabulate(
    film: Film,
    logs: Float[np.ndarray, "errors bands"],
    ground: Float[np.ndarray, "bands grounds"],
) -> Float[np.ndarray, "bands cells 4 4 numbers"]:
    """Table of one film whose unknown coat is all that is open (see `FilmData.table`), from log k d
    and log s d of all coats; those of the unknown coat do not matter.
    """
    assert film.unknown_coat is not None
    unknown = slice(2 * film.unknown_coat, 2 * film.unknown_coat + 2)
    nodes = np.stack(np.meshgrid(*nodes_of(_NODES), indexing="ij")).reshape(2, -1)
    bands = []
    for band, below in enumerate(ground):
        stack = np.repeat(logs[:, band, None], nodes.shape[1], axis=1)
        # A coat that does not absorb or scatter at all is one of the nodes.
        stack[unknown] = np.log(np.maximum(nodes, 1e-300))
        wide = np.broadcast_to(below, (1, nodes.shape[1], below.size))
        linear = slopes(film, None, stack[None], wide)
        # Those of the unknown coat are no errors.
        by_log = np.delete(np.asarray(linear.by_log)[0], unknown, axis=0)
        solved = np.concatenate([linear.body, linear.by_ground, by_log])
        bands.append(patches(np.swapaxes(solved, 1, 2).reshape(-1, _NODES, _NODES)))
    return np.stack(bands)
