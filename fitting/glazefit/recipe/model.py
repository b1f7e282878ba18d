"""Readings of many stacks of coats, and their colour: paints, ground, instrument and light as
arrays.

A stack is an array (coats, paints), top first: what each paint takes of each coat's thickness.
Lengths are in micrometres here, k and s in 1/micrometre.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax import Pigment, colour
from glazejax.geometry import Instrument
from glazejax.programs import Program
from glazejax.radiative.common.chunks import by_blocks
from glazejax.spectra import as_array, on_numpy_or_jax

from ..film.model.optics import Optics
from ..film.model.response import FilmResponse, film_response
from .targets import Ground

Sizes: TypeAlias = Float[np.ndarray, "n coats paints"]
"""Stacks, um."""
OneStack: TypeAlias = Float[np.ndarray, "coats paints"]
"""One of them."""
READ_CHUNK = 128
"""Stacks that are read at a time, always as many, so that one program serves all."""


class StackModel(NamedTuple):
    """Paints, ground, instrument and light: all that does not change while a recipe is searched."""

    absorption: Float[Any, "paints bands"]  # 1/um
    scattering: Float[Any, "paints bands"]  # 1/um
    ground: Float[Any, "bands"]
    surface: Float[Any, ""]  # what the outer surface adds to a reading
    strength: Float[Any, "paints"]
    """How much a little of a paint shows, 1/um: by its absorption, or by its scattering where it is
    pale.
    """
    weights: Float[Any, "bands lights 3"]  # reflectance to XYZ
    film: FilmResponse

    def lab(
        self, spectra: Float[Array | np.ndarray, "*batch bands"]
    ) -> Float[Any, "*batch lights 3"]:
        """L*a*b* of readings under every light."""
        xyz = on_numpy_or_jax(_xyz_of, as_array(spectra), self.weights)
        return colour.xyz_to_lab(xyz, self.weights.sum(axis=0))

    def internal(self, body: Float[Array, "*batch bands"]) -> Float[Array, "*batch bands"]:
        """The coat below as a ground: the Lambertian one that, bare, reads `body` without the outer
        surface's part.
        """
        return jnp.clip(self.film.internal(body), 0.0, 1.0)


def _xyz_of(xp: Any, spectra: Any, weights: Any) -> Any:
    # One dot product a light and component; full precision also on an accelerator.
    precision = {} if xp is np else {"precision": "highest"}
    return xp.tensordot(spectra, weights, axes=1, **precision)


class Readings(NamedTuple):
    """Readings of stacks and their colours, with slopes."""

    spectrum: Float[Any, "n bands"]
    by_absorption: Float[Any, "n coats bands"]
    """Slopes of the spectrum by k d of each coat: a band's reading follows from that band alone."""
    by_scattering: Float[Any, "n coats bands"]
    """The same by s d."""
    lab: Float[Any, "n lights 3"]
    lab_by_spectrum: Float[Any, "n lights 3 bands"]


def make_model(
    pigments: Sequence[Pigment],
    ground: Ground,
    instrument: Instrument,
    illuminants: Sequence[str],
    observer: str,
) -> StackModel:
    """Model of stacks of some paints, whose k and s are in 1/m as everywhere else.

    Args:
        pigments: on one grid.
        ground: internal reflectance, scalar or (bands,).
        instrument: with the index of all coats.
        illuminants, observer: full names.
    """
    grid = pigments[0].wavelengths
    weights = np.stack(
        [colour.colour_weights(grid, name, observer) for name in illuminants], axis=1
    )
    absorption = np.stack([p.absorption for p in pigments]) * 1e-6
    scattering = np.stack([p.scattering for p in pigments]) * 1e-6
    return StackModel(
        absorption=absorption,
        scattering=scattering,
        strength=np.mean(absorption + 0.1 * scattering, axis=1) + 1e-9,
        ground=np.broadcast_to(np.asarray(ground, float), grid.shape),
        surface=np.asarray(instrument.seen_surface),
        weights=weights,
        film=film_response(instrument),
    )


def read(model: StackModel, sizes: Sizes, optics: Optics | None) -> Readings:
    """Readings of many stacks by the solver, or without `optics` by the table.

    The table is exact for one coat. A lower coat counts as the Lambertian ground that would read
    the same when bare, so that two coats are right to about one Delta E: it serves to choose what
    to look at more closely.
    """
    kd = sizes @ model.absorption
    sd = sizes @ model.scattering
    return by_blocks(len(sizes), READ_CHUNK, lambda rows: _read(model, kd[rows], sd[rows], optics))


def read_ahead(model: StackModel, coats: int, optics: Optics) -> None:
    """Begin to compile what reads stacks of so many coats, by the table and by the solver."""
    nothing = np.zeros((READ_CHUNK, coats, model.ground.size))
    for solver in (None, optics):
        _read.ahead(model, nothing, nothing, solver)


@functools.partial(Program, fixed=("optics",))
def _read(
    model: StackModel,
    kd: Float[Array | np.ndarray, "n coats bands"],
    sd: Float[Array | np.ndarray, "n coats bands"],
    optics: Optics | None,
) -> Readings:
    def reading(kd: Array, sd: Array) -> Array:
        if optics is not None:
            # An error of 1e-5 in the reading of a black would be a Delta E of a hundredth.
            body = optics.body(kd.mT, sd.mT, model.ground, 1e-6)
            return body + model.surface
        ground = model.ground
        body = ground
        for coat in reversed(range(kd.shape[1])):
            body = model.film.body(kd[:, coat], sd[:, coat], ground)
            if coat:
                ground = model.internal(body)
        return body + model.surface

    spectrum, back = jax.vjp(reading, kd, sd)
    # One pull-back of ones holds every slope, since no band's reading asks another band.
    by_absorption, by_scattering = back(jnp.ones_like(spectrum))
    return Readings(
        spectrum=spectrum,
        by_absorption=by_absorption,
        by_scattering=by_scattering,
        lab=model.lab(spectrum),
        lab_by_spectrum=jax.vmap(jax.jacfwd(model.lab))(spectrum),
    )
