"""One homogeneous film, tabulated: what it reflects over any Lambertian ground, at a fraction of
the solver's cost.

A film of optical thicknesses k d and s d on a ground rho reflects, exactly,

    R = black + gain rho / (1 - back rho)

the light that never reached the ground, and what did, with all its round trips. The three numbers
are smooth in log(c + k d) and log(c + s d); a bicubic spline through solved values gives them to
1e-5, with continuous second derivatives and down to films that do not absorb or scatter at all. The
inverse layer asks for single films over and over, so it asks the table; stacks of several coats are
solved.
"""

import abc
import functools
from importlib.resources import files
from typing import Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Float

from glazejax.geometry import Bidirectional, Geometry, Instrument
from glazejax.spectra import as_array, on_numpy_or_jax, small

from .optics import Optics
from .spline import HIGHEST, locate, look_up, nodes_of, patches, within

_NODES = 80

FilmNumber: TypeAlias = Float[Array, "*batch"]
"""A number for each film of a batch."""
GroundNumber: TypeAlias = Float[Array | np.ndarray, "*#batch"]
"""A number for each ground, or for each film over one."""

SHIPPED = {"d8": Instrument(), "45_0": Instrument(Bidirectional(45, 0))}
"""Instruments whose table lies next to this file: the defaults of
`glazefit`.
"""


def over_ground(black: Any, gain: Any, back: Any, ground: Any) -> Any:
    """Reading without the outer surface's part of a film, from its three numbers, on a ground."""
    return black + gain * ground / (1.0 - back * ground)


def ground_below(
    body: GroundNumber,
    gain: float | GroundNumber,
    back: float | GroundNumber,
) -> Any:
    """Internal reflectance of the Lambertian ground that reads ``body`` = gain rho/(1 - back rho)
    when it is bare.

    Args:
        body: reading without the outer surface's part, (...).
        gain, back: what the bare surface lets through and sends back; of a `FilmResponse` at no
            thickness, or others.

    Returns:
        rho, (...), in the kind of the arguments (numpy or JAX); not clipped to [0, 1].
    """
    return body / (gain + back * body)


def hiding_factor(absorption: FilmNumber, scattering: FilmNumber) -> FilmNumber:
    """Factor by which films of k d and s d, (...), are thinner than where a table of films ends,
    thick enough to hide whatever is below.
    """
    return 0.999 * jnp.minimum(HIGHEST[0] / absorption, HIGHEST[1] / scattering)


class Response(eqx.Module):
    """Model of one film."""

    @abc.abstractmethod
    def body(self, absorption: ArrayLike, scattering: ArrayLike, ground: ArrayLike) -> FilmNumber:
        """Reflectance without the outer surface's part, from k d, s d and the ground's internal
        reflectance.
        """


class FilmResponse(Response):
    """Bicubic spline of (black, gain, back) over optical thicknesses k d and s d, for one geometry
    and index.

    Not `glazejax.interpolated`: the numbers bend along a line of k/s that no product of polynomials
    follows. With 129 x 129 terms, the most that it takes, it has an error of .013 in these same
    logarithms where the spline's 80 x 80 nodes give 1e-5, and 100,000 films take it 4 s in place
    of .04 s: 16,641 products a number in place of 16.
    """

    patches: Float[Array, "cells 4 4 3"]  # spline coefficients around each cell

    def numbers(
        self,
        absorption: Float[ArrayLike, "*#batch"],
        scattering: Float[ArrayLike, "*#batch"],
    ) -> tuple[FilmNumber, FilmNumber, FilmNumber]:
        """Black, gain and back of films, each (...), from k d and s d, (...), >= 0."""
        k, s = as_array(absorption), as_array(scattering)
        # Few of each may make many films.
        films = np.broadcast_to(0.0, np.broadcast_shapes(k.shape, s.shape))
        if small(k, s) and small(films) and not isinstance(self.patches, Tracer):
            values = look_up(np, np.asarray(self.patches), np.asarray(k), np.asarray(s), _NODES)
        else:
            values = look_up(jnp, self.patches, k, s, _NODES)
        black, gain, back = (jnp.asarray(values[..., n]) for n in range(3))
        return black, gain, back

    def body_and_slopes(
        self,
        absorption: FilmNumber,
        scattering: FilmNumber,
        ground: Float[Array, "..."],
    ) -> tuple[Float[Array, "..."], Float[Array, "..."], Float[Array, "..."]]:
        """`body`, and its derivatives by k d and by s d: all from one look at the table, twice as
        fast as tangents.

        Args:
            absorption, scattering: optical thicknesses, (...), >= 0.
            ground: internal reflectance, broadcast against them.
        """
        k, s, beyond = within(jnp, absorption, scattering)
        row, over, over_slope = _spline_weights(k, HIGHEST[0])
        column, across, across_slope = _spline_weights(s, HIGHEST[1])
        patch = self.patches.at[row * (_NODES - 1) + column].get(mode="promise_in_bounds")
        along, along_slope = (
            jnp.sum(patch * a[..., None, :, None], axis=-2) for a in (across, across_slope)
        )
        factors = ((along, over), (along, over_slope), (along_slope, over))
        values, by_k, by_s = (jnp.sum(a * b[..., None], axis=-2) for a, b in factors)
        black, gain, back = (values[..., n] for n in range(3))
        ground_gain = ground / (1.0 - back * ground)

        def slope(off: Array) -> Array:
            return off[..., 0] + off[..., 1] * ground_gain + gain * ground_gain**2 * off[..., 2]

        slope_k, slope_s = slope(by_k), slope(by_s)
        # Beyond the table nothing changes with the thickness: that part of both slopes goes.
        thicker = (beyond > 1.0) * (k * slope_k + s * slope_s)
        ends_by_k = absorption * HIGHEST[1] > scattering * HIGHEST[0]
        slope_k = (slope_k - ends_by_k * thicker / HIGHEST[0]) / beyond
        slope_s = (slope_s - ~ends_by_k * thicker / HIGHEST[1]) / beyond
        return black + gain * ground_gain, slope_k, slope_s

    def body(self, absorption: ArrayLike, scattering: ArrayLike, ground: ArrayLike) -> FilmNumber:
        """Reflectance without the outer surface's part, (...).

        Args:
            absorption, scattering: optical thicknesses k d and s d, (...), >= 0.
            ground: internal reflectance of the Lambertian ground, (...), in [0, 1].
        """
        return on_numpy_or_jax(
            lambda _, *numbers: over_ground(*numbers),
            *self.numbers(absorption, scattering),
            ground,
        )

    def internal(self, body: FilmNumber) -> FilmNumber:
        """Internal reflectance of the Lambertian ground that, bare, reads `body` without the outer
        surface's part.
        """
        nothing = np.zeros((), body.dtype)
        numbers = self.numbers(nothing, nothing)
        return on_numpy_or_jax(
            lambda _, body, black, gain, back: ground_below(body - black, gain, back),
            body,
            *numbers,
        )


def _spline_weights(thickness: Array, highest: float) -> tuple[Array, Array, Array]:
    """Cell, weights and the derivatives of the weights by the optical thickness, which is in the
    table.
    """

    def weights(thickness: Array) -> tuple[Array, Array]:
        cell, along = locate(jnp, thickness, highest, _NODES)
        return along, cell

    unit = jnp.ones_like(thickness)
    along, slopes, cell = jax.jvp(weights, (thickness,), (unit,), has_aux=True)
    return cell, along, slopes


def film_response(instrument: Instrument | Geometry | str) -> FilmResponse:
    """Table for an instrument: those of `SHIPPED` are read, any other is made once (some seconds)
    and kept.

    Args:
        instrument: see `glazejax.geometry.resolve_instrument`; angles must be known numbers, and
            its `specular` flag does not matter here.

    Raises:
        ValueError: an angle that is an array or traced.
    """
    return FilmResponse(jnp.asarray(_patches(Optics.of(instrument))))


@functools.lru_cache(maxsize=8)
def _patches(optics: Optics) -> Float[np.ndarray, "cells 4 4 3"]:
    """Spline coefficients from solved films."""
    values = _load_shipped(optics)
    return patches(solved_table(optics) if values is None else values)


def _load_shipped(optics: Optics) -> Float[np.ndarray, "3 nodes nodes"] | None:
    """Load what `python -m benchmarks.make.film_tables` wrote for these optics, if it did."""
    for name, instrument in SHIPPED.items():
        if Optics.of(instrument) == optics:
            with files("glazefit.film").joinpath("tables.npz").open("rb") as file:
                return np.load(file)[name]
    return None


def solved_table(optics: Optics) -> Float[np.ndarray, "3 nodes nodes"]:
    """Black, gain and back at the nodes, by the solver."""
    kd, sd = np.meshgrid(*nodes_of(_NODES), indexing="ij")

    @jax.jit
    def over_three_grounds(kd: Array, sd: Array) -> Array:
        return optics.body(kd, sd, jnp.asarray([0.0, 0.5, 1.0]), 1e-6)

    pieces = [a.reshape(-1, 3200, 1, 1) for a in (kd, sd)]
    solved = [np.asarray(over_three_grounds(*piece)) for piece in zip(*pieces, strict=True)]
    black, half, white = np.moveaxis(np.concatenate(solved).reshape(_NODES, _NODES, 3), -1, 0)
    return np.stack([black, *_gain_and_back(half - black, white - black)])


def _gain_and_back(half: np.ndarray, white: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From what grounds of .5 and 1 add: half = .5 gain/(1 - .5 back), white = gain/(1 - back)."""
    from scipy.ndimage import distance_transform_edt

    half = np.maximum(half, 0.0)
    white = np.maximum(white, 0.0)
    # An opaque film's back multiplies nothing: any smooth continuation will do.
    through = half > 1e-7
    ratio = np.where(through, white, 3.0) / np.where(through, half, 1.0)
    back = np.where(through, (ratio - 2.0) / (ratio - 1.0), 0.0)
    nearest = distance_transform_edt(~through, return_distances=False, return_indices=True)
    assert nearest is not None
    back = np.clip(back, 0.0, 1.0)[tuple(nearest)]
    return white * (1.0 - back), back
