"""From the arguments of the many-flux functions to compiled programs: checks, effort, batches in pieces."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..common.inputs import (
    Numbers,
    at_least_one_layer,
    batch_shape,
    check_tolerance,
    check_values,
    concrete,
)
from ..common.phase import check_moments, isotropic
from . import joined as manyflux_joined
from . import solve as manyflux_solve
from .effort import Effort, Solution, choose_effort, smallest_cosine
from .ground import GroundTable
from .media import Media
from .solve import Layers

# Bytes of one chunk's matrices.
_CHUNK_BYTES = 2**22

Indices = float | Sequence[float]


class Stack(NamedTuple):
    """Layers and what lies below them, as given."""

    albedo: Numbers
    optical_thickness: Numbers
    substrate_reflectance: Numbers
    phase: Numbers | None
    refractive_index: Indices
    ground: GroundTable | None = None
    index_below: float | None = None
    """Of a medium below, in place of a ground."""


class Wish(NamedTuple):
    """How well and how; see `manyflux.manyflux_reflectance_factor`."""

    tolerance: float
    streams: int | None
    solution: Solution


class Options(NamedTuple):
    """What is fixed when a program is compiled."""

    media: float | Media
    effort: Effort
    downward: bool


class Call(NamedTuple):
    """Checked arguments as a flat batch."""

    layers: Layers  # leading axis: batch; the phase function's may be 1
    angles: dict[str, Array]  # (batch,)
    table: GroundTable | None
    options: Options
    batch: tuple[int, ...]


def prepare(
    stack: Stack,
    wish: Wish,
    cosines: dict[str, Any],
    azimuth: Any = None,
    *,
    least: float | None = None,
    downward: bool = False,
) -> Call:
    """Checked arguments.

    Args:
        stack: layers.
        wish: accuracy.
        cosines: by name, those that vary with the batch.
        azimuth: degrees; None if the result does not depend on it.
        least: smallest cosine of any direction where it is not among ``cosines``.
        downward: whether the light is seen from below.
    """
    check_tolerance(wish.tolerance)
    named = {name: getattr(stack, name) for name in ("albedo", "optical_thickness", "substrate_reflectance")}
    check_values(named | cosines)
    moments = isotropic() if stack.phase is None else stack.phase
    check_moments(moments)
    known = concrete(moments)
    dtype = jnp.result_type(float)
    q, d, count = at_least_one_layer(jnp.asarray(stack.albedo, dtype), jnp.asarray(stack.optical_thickness, dtype))
    media = _media(stack, count)
    moments = jnp.asarray(moments, dtype)
    if moments.ndim == 1:
        moments = moments[None]
    if moments.shape[-2] not in (1, count):
        raise ValueError(f"phase has {moments.shape[-2]} layers (last but one axis) but albedo has {count}")
    rho = jnp.asarray(stack.substrate_reflectance, dtype)
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
    thickest = concrete(stack.optical_thickness)
    effort = choose_effort(
        wish.tolerance if dtype == jnp.float64 else max(wish.tolerance, 1e-5),
        media,
        known,
        terms,
        None if thickest is None else float(thickest.max(initial=0.0)),
        smallest_cosine(*cosines.values()) if least is None else least,
        wish.streams,
        azimuthal=azimuth is not None,
        solution=wish.solution,
    )
    return Call(layers, flat, stack.ground, Options(media, effort, downward), batch)


def _media(stack: Stack, count: int) -> float | Media:
    """One index where one is enough: no interfaces inside, a Lambertian ground."""
    index = stack.refractive_index
    single = isinstance(index, int | float | np.floating | np.integer)
    if not single and not (
        isinstance(index, Sequence) and all(isinstance(n, int | float | np.floating | np.integer) for n in index)
    ):
        raise ValueError(
            "refractive_index must be a number here, such as 1.5, or a sequence of one for each layer, "
            "such as (1.5, 1.4): the same for the whole batch"
        )
    each = (float(index),) * count if single else tuple(float(n) for n in index)  # pyright: ignore[reportArgumentType]
    if len(each) != count:
        raise ValueError(f"refractive_index has {len(each)} values but albedo has {count} layers (last axis)")
    check_values({"refractive_index": np.array(each)})
    if stack.index_below is not None and not 1.0 <= stack.index_below <= min(each):
        raise ValueError(
            f"index_below is {stack.index_below}; it must be at least 1 and at most that of every layer, {min(each)}"
        )
    if len(set(each)) == 1 and stack.ground is None and stack.index_below is None:
        return each[0]
    return Media(each, None if stack.index_below is None else float(stack.index_below))


@functools.partial(jax.jit, static_argnums=3)
def factors(layers: Layers, angles: dict[str, Array], table: GroundTable | None, options: Options) -> Array:
    """Reflectance or transmittance factor of each stack in its own directions, (batch,)."""

    def one(layers: Layers, angles: dict[str, Array]) -> Array:
        seen, lit, turned = (angles[name][None] for name in ("cos_viewing", "cos_incidence", "azimuth"))
        return _factor(layers, (seen, lit, turned), table, options)[0, 0, 0]

    return _mapped(one, layers, angles, options, 1)


@functools.partial(jax.jit, static_argnums=3)
def tables(layers: Layers, axes: tuple[Array, Array, Array], table: GroundTable | None, options: Options) -> Array:
    """The same for all pairs of directions, (batch, viewing, incidence, azimuths)."""

    def one(layers: Layers, _) -> Array:
        return _factor(layers, axes, table, options)

    return _mapped(one, layers, {}, options, max(axes[0].size, axes[1].size))


@functools.partial(jax.jit, static_argnums=3)
def fluxes(layers: Layers, angles: dict[str, Array], table: GroundTable | None, options: Options) -> Array:
    """Flux that leaves over flux of a beam, (batch,)."""
    media, effort, downward = options

    def one(layers: Layers, angles: dict[str, Array]) -> Array:
        lit = angles["cos_incidence"][None]
        if not isinstance(media, Media):
            return manyflux_solve.hemispherical_reflectance(layers, media, lit, effort)[0]
        joined = manyflux_joined.joined_stack(layers, media, lit[:0], lit, effort, 1, table=table, downward=downward)
        return manyflux_joined.flux_of_beam(joined, downward=downward)[0]

    return _mapped(one, layers, angles, options, 1)


@functools.partial(jax.jit, static_argnums=2)
def diffuse(layers: Layers, table: GroundTable | None, options: Options) -> Array:
    """Flux that leaves over flux of even light, (batch,)."""
    media, effort, downward = options

    def one(layers: Layers, _) -> Array:
        if not isinstance(media, Media):
            return manyflux_solve.diffuse_reflectance(layers, media, effort)
        nothing = layers.albedo[:0]
        joined = manyflux_joined.joined_stack(
            layers, media, nothing, nothing, effort, 1, table=table, downward=downward
        )
        return manyflux_joined.flux_of_even_light(joined, downward=downward)

    return _mapped(one, layers, {}, options, 0)


def _factor(layers: Layers, axes: tuple[Array, Array, Array], table: GroundTable | None, options: Options) -> Array:
    seen, lit, turned = axes
    media, effort, downward = options
    if not isinstance(media, Media):
        return manyflux_solve.reflectance_factor(layers, media, seen, lit, turned, effort)
    joined = manyflux_joined.joined_stack(
        layers, media, seen, lit, effort, effort.modes, table=table, downward=downward
    )
    return manyflux_joined.factor(joined, turned, effort.modes, downward=downward)


def _mapped(function: Callable, layers: Layers, angles: dict[str, Array], options: Options, added: int) -> Array:
    """Apply to every stack, some at a time, so that memory stays bounded whatever the batch."""
    size, count = layers.albedo.shape
    shared = layers.moments.shape[0] == 1
    common = layers.moments[0]
    effort = options.effort
    width = effort.width + added
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
