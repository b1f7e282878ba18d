"""Many-flux Kubelka-Munk: layers with any phase function, all angles and azimuths, under a refracting surface.

The light is followed in discrete directions inside the medium, one set for each Fourier mode of the azimuth. Layers
are operators made by doubling (`manyflux_layer`), joined on a ground and under a surface (`manyflux_stack`); the
directions of incidence and viewing are exact, not interpolated (`manyflux_bordered`). What the kept Legendre moments
cannot follow is treated by delta-M, and light scattered once by the whole phase function (`manyflux_solve`).

This is paper C (Shinya et al.) with its directions chosen for the surface. For isotropic scattering it is the
same quantity as `glazejax.stack_reflectance_factor`, found another way.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from glazejax.radiative import manyflux_solve
from glazejax.radiative.inputs import Numbers, at_least_one_layer, batch_shape, check_tolerance, check_values, concrete
from glazejax.radiative.manyflux_effort import Effort, Solution, choose_effort
from glazejax.radiative.manyflux_solve import Layers
from glazejax.radiative.phase import check_moments, isotropic

# Bytes of one chunk's matrices.
_CHUNK_BYTES = 2**22


def manyflux_reflectance_factor(
    albedo: Float[Numbers, "*batch layers"],
    optical_thickness: Float[Numbers, "*batch layers"],
    substrate_reflectance: Float[Numbers, "*batch"],
    *,
    phase: Float[Numbers, "*#batch #layers terms"] | None = None,
    refractive_index: float = 1.5,
    cos_incidence: Float[Numbers, "*batch"] = 1.0,
    cos_viewing: Float[Numbers, "*batch"] = 1.0,
    azimuth: Float[Numbers, "*batch"] = 0.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Float[Array, "*batch"]:
    """Reflectance factor pi L_out/E_in of layers with any phase function under a smooth surface.

    Args:
        albedo: single-scattering albedo of each layer, top first, (..., layers), in [0, 1].
        optical_thickness: (k + s) times thickness, (..., layers), >= 0.
        substrate_reflectance: of the Lambertian ground, as seen from inside the medium, (...), in [0, 1].
        phase: Legendre moments of the phase function (`glazejax.radiative.phase`), (terms,) for all layers or
            (..., layers, terms), where layers may be 1. By default scattering is isotropic.
        refractive_index: of all layers, a number in [1, 2.5].
        cos_incidence, cos_viewing: cosines in air, (...), in (0, 1].
        azimuth: angle in degrees between the horizontal directions in which light travels before and after, (...): 0 is
            the side of the mirror direction, 180 back towards the light.
        tolerance: absolute error wanted, a Python number: picks the directions, moments and modes.
        streams: number of directions in each hemisphere, instead of those for the tolerance.
        solution: of the layers: "doubling", or "modes" (eigenvectors): the same to some 1e-12.

    Returns:
        Reflectance factor, shape of the broadcast batch, without the surface's own reflection.

    Raises:
        ValueError: a value out of range, shapes that do not broadcast, or a refractive index that is not a number.

    Source: paper C (Shinya et al.), equations (11)-(20), solved as described in the module.
    """
    given = {"cos_incidence": cos_incidence, "cos_viewing": cos_viewing}
    batch, call = _prepare(
        albedo,
        optical_thickness,
        substrate_reflectance,
        phase,
        refractive_index,
        given,
        azimuth,
        tolerance,
        streams,
        solution,
    )
    return _factors(call.layers, call.angles, call.options).reshape(batch)


def manyflux_hemispherical_reflectance(
    albedo: Float[Numbers, "*batch layers"],
    optical_thickness: Float[Numbers, "*batch layers"],
    substrate_reflectance: Float[Numbers, "*batch"],
    *,
    phase: Float[Numbers, "*#batch #layers terms"] | None = None,
    refractive_index: float = 1.5,
    cos_incidence: Float[Numbers, "*batch"] = 1.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Float[Array, "*batch"]:
    """Flux that leaves over flux of a collimated beam, without the surface's own reflection.

    By reciprocity also the reflectance factor under even light from all sides, seen at that angle.

    Args, returns and raises as for `manyflux_reflectance_factor`.
    """
    batch, call = _prepare(
        albedo,
        optical_thickness,
        substrate_reflectance,
        phase,
        refractive_index,
        {"cos_incidence": cos_incidence},
        None,
        tolerance,
        streams,
        solution,
    )
    return _fluxes(call.layers, call.angles, call.options).reshape(batch)


def manyflux_diffuse_reflectance(
    albedo: Float[Numbers, "*batch layers"],
    optical_thickness: Float[Numbers, "*batch layers"],
    substrate_reflectance: Float[Numbers, "*batch"],
    *,
    phase: Float[Numbers, "*#batch #layers terms"] | None = None,
    refractive_index: float = 1.5,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Float[Array, "*batch"]:
    """Flux that leaves over flux of light that falls in evenly from all sides (equal radiance).

    Args, returns and raises as for `manyflux_reflectance_factor`; the surface's own reflection is not included.
    """
    batch, call = _prepare(
        albedo,
        optical_thickness,
        substrate_reflectance,
        phase,
        refractive_index,
        {},
        None,
        tolerance,
        streams,
        solution,
    )
    return _diffuse(call.layers, call.options).reshape(batch)


def brdf_table(
    albedo: Float[Numbers, "*batch layers"],
    optical_thickness: Float[Numbers, "*batch layers"],
    substrate_reflectance: Float[Numbers, "*batch"],
    *,
    phase: Float[Numbers, "*#batch #layers terms"] | None = None,
    refractive_index: float = 1.5,
    cos_incidence: Float[Numbers, "incidence"],
    cos_viewing: Float[Numbers, "viewing"],
    azimuth: Float[Numbers, "azimuths"] = (0.0,),
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Float[Array, "*batch viewing incidence azimuths"]:
    """Table of the BRDF in 1/sr over angles of viewing, incidence and azimuth, each entry exact: one solution for all.

    Args:
        cos_incidence, cos_viewing: cosines in air, (incidence,) and (viewing,), in (0, 1].
        azimuth: degrees, (azimuths,).
        The others as for `manyflux_reflectance_factor`.

    Returns:
        (..., viewing, incidence, azimuths), the reflectance factor over pi.

    Raises:
        ValueError: as there, or an axis of angles that is not one-dimensional.
    """
    axes = {"cos_incidence": cos_incidence, "cos_viewing": cos_viewing, "azimuth": azimuth}
    for name, values in axes.items():
        if np.ndim(values) != 1:  # pyright: ignore[reportArgumentType]
            raise ValueError(f"{name} must be one axis of angles, such as [1.0, 0.5], for a table; it is {values}")
    check_values({name: axes[name] for name in ("cos_incidence", "cos_viewing")})
    least = _least_cosine(cos_incidence, cos_viewing)
    batch, call = _prepare(
        albedo,
        optical_thickness,
        substrate_reflectance,
        phase,
        refractive_index,
        {},
        0.0,
        tolerance,
        streams,
        solution,
        least,
    )
    dtype = call.layers.albedo.dtype
    seen, lit, turned = (jnp.asarray(a, dtype) for a in (cos_viewing, cos_incidence, azimuth))
    table = _table(call.layers, (seen, lit, jnp.deg2rad(turned)), call.options)
    return table.reshape(*batch, *table.shape[1:]) / np.pi


class _Options(NamedTuple):
    """What is fixed when a program is compiled."""

    refractive_index: float
    effort: Effort


class _Call(NamedTuple):
    layers: Layers  # leading axis: batch; the phase function's may be 1
    angles: dict[str, Array]  # (batch,)
    options: _Options


def _prepare(
    albedo: Any,
    thickness: Any,
    ground: Any,
    phase: Any,
    index: Any,
    cosines: dict[str, Any],
    azimuth: Any,
    tolerance: float,
    streams: int | None,
    solution: Solution,
    least: float | None = None,
) -> tuple[tuple[int, ...], _Call]:
    """Checked arguments as a flat batch, and the batch's shape."""
    check_tolerance(tolerance)
    if not isinstance(index, int | float | np.floating | np.integer):
        raise ValueError("refractive_index must be a number here, such as 1.5, the same for the whole batch")
    named = {"albedo": albedo, "optical_thickness": thickness, "substrate_reflectance": ground}
    check_values(named | {"refractive_index": index} | cosines)
    moments = isotropic() if phase is None else phase
    check_moments(moments)
    known = concrete(moments)
    dtype = jnp.result_type(float)
    q, d = jnp.asarray(albedo, dtype), jnp.asarray(thickness, dtype)
    q, d, count = at_least_one_layer(q, d)
    moments = jnp.asarray(moments, dtype)
    if moments.ndim == 1:
        moments = moments[None]
    if moments.shape[-2] not in (1, count):
        raise ValueError(f"phase has {moments.shape[-2]} layers (last but one axis) but albedo has {count}")
    rho = jnp.asarray(ground, dtype)
    angles = {name: jnp.asarray(value, dtype) for name, value in cosines.items()}
    if azimuth is not None:
        angles["azimuth"] = jnp.deg2rad(jnp.asarray(azimuth, dtype))
    shapes = {"albedo": q.shape[:-1], "optical_thickness": d.shape[:-1], "substrate_reflectance": rho.shape}
    shapes |= {"phase": moments.shape[:-2]} | {name: a.shape for name, a in angles.items()}
    batch = batch_shape(shapes)
    size = int(np.prod(batch))
    terms = moments.shape[-1]
    shared = int(np.prod(moments.shape[:-2])) == 1
    layers = Layers(
        jnp.broadcast_to(q, (*batch, count)).reshape(size, count),
        jnp.broadcast_to(d, (*batch, count)).reshape(size, count),
        jnp.broadcast_to(moments, (*((1,) * len(batch) if shared else batch), count, terms)).reshape(-1, count, terms),
        jnp.broadcast_to(rho, batch).reshape(size),
    )
    flat = {name: jnp.broadcast_to(a, batch).reshape(size) for name, a in angles.items()}
    thickest = concrete(thickness)
    least = _least_cosine(*cosines.values()) if least is None else least
    effort = choose_effort(
        tolerance if dtype == jnp.float64 else max(tolerance, 1e-5),
        float(index),
        known,
        terms,
        None if thickest is None else float(thickest.max(initial=0.0)),
        least,
        streams,
        azimuthal=azimuth is not None,
        solution=solution,
    )
    return batch, _Call(layers, flat, _Options(float(index), effort))


def _least_cosine(*cosines: Any) -> float:
    """Smallest known cosine; one that is traced may be as small as 1e-4."""
    found = [concrete(c) for c in cosines]
    return float(min((1e-4 if c is None else c.min(initial=1.0) for c in found), default=1.0))


@functools.partial(jax.jit, static_argnums=2)
def _factors(layers: Layers, angles: dict[str, Array], options: _Options) -> Array:
    def one(layers: Layers, angles: dict[str, Array]) -> Array:
        seen, lit, turned = (angles[name][None] for name in ("cos_viewing", "cos_incidence", "azimuth"))
        return manyflux_solve.reflectance_factor(layers, options.refractive_index, seen, lit, turned, options.effort)[
            0, 0, 0
        ]

    return _mapped(one, layers, angles, options, 1)


@functools.partial(jax.jit, static_argnums=2)
def _fluxes(layers: Layers, angles: dict[str, Array], options: _Options) -> Array:
    def one(layers: Layers, angles: dict[str, Array]) -> Array:
        lit = angles["cos_incidence"][None]
        return manyflux_solve.hemispherical_reflectance(layers, options.refractive_index, lit, options.effort)[0]

    return _mapped(one, layers, angles, options, 1)


@functools.partial(jax.jit, static_argnums=1)
def _diffuse(layers: Layers, options: _Options) -> Array:
    def one(layers: Layers, _) -> Array:
        return manyflux_solve.diffuse_reflectance(layers, options.refractive_index, options.effort)

    return _mapped(one, layers, {}, options, 0)


@functools.partial(jax.jit, static_argnums=2)
def _table(layers: Layers, axes: tuple[Array, Array, Array], options: _Options) -> Array:
    def one(layers: Layers, _) -> Array:
        return manyflux_solve.reflectance_factor(layers, options.refractive_index, *axes, options.effort)

    return _mapped(one, layers, {}, options, max(axes[0].size, axes[1].size))


def _mapped(function: Callable, layers: Layers, angles: dict[str, Array], options: _Options, added: int) -> Array:
    """Apply to every stack, some at a time, so that memory stays bounded whatever the batch."""
    size, count = layers.albedo.shape
    shared = layers.moments.shape[0] == 1
    common = layers.moments[0]
    effort = options.effort
    width = sum(effort.directions[:2]) + added
    chunk = max(1, _CHUNK_BYTES // (count * effort.modes * width**2 * layers.albedo.dtype.itemsize))
    pieces = -(-size // min(chunk, size)) if size else 1
    each = -(-size // pieces)

    def some(batch) -> Array:
        layers, angles = batch
        if shared:
            return jax.vmap(lambda q, d, g, a: function(Layers(q, d, common, g), a))(
                layers.albedo, layers.optical_thickness, layers.ground, angles
            )
        return jax.vmap(function)(layers, angles)

    # A shared phase function's moments stay out of the batch.
    batch = (layers._replace(moments=jnp.zeros((size, 0), common.dtype)) if shared else layers, angles)
    if pieces == 1:
        return some(batch)

    def split(leaf: Array) -> Array:
        spare = pieces * each - size
        padded = jnp.concatenate([leaf, jnp.broadcast_to(leaf[:1], (spare, *leaf.shape[1:]))]) if spare else leaf
        return padded.reshape(pieces, each, *leaf.shape[1:])

    out = jax.lax.map(some, jax.tree.map(split, batch))
    return out.reshape(pieces * each, *out.shape[2:])[:size]
