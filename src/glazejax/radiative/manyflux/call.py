"""From the arguments of the many-flux functions to compiled programs: checks, effort, batches in
pieces.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.chunks import in_chunks
from ..common.inputs import (
    BatchShape,
    Numbers,
    batch_of_stacks,
    check_given,
    check_tolerance,
    check_values,
    concrete,
    flat_batch,
    plain_number,
    smallest_cosine,
)
from ..common.phase import check_moments, isotropic
from ..common.rounding import FINEST_SINGLE, warn_of_rounding
from . import joined as manyflux_joined
from . import solve as manyflux_solve
from .effort import FluxEffort, Solution, choose_effort
from .ground import GroundTable
from .media import Media
from .method import ROUNDING
from .solve import Layers

# Bytes of one chunk's matrices.
_CHUNK_BYTES = 2**22

Indices: TypeAlias = Numbers
"""One for all layers, or one for each."""
NamedAngles: TypeAlias = dict[str, Array]
"""Cosines in air and the azimuth in radians, by name; of each stack of a batch, or of one."""


class StackInputs(NamedTuple):
    """Layers, what lies below them, how well and how to solve them; see
    `manyflux.manyflux_reflectance_factor`.
    """

    albedo: Numbers
    optical_thickness: Numbers
    phase: Numbers | None
    refractive_index: Indices
    tolerance: float
    streams: int | None
    solution: Solution
    substrate_reflectance: Numbers = 0.0  # of free-standing layers, which have no ground
    ground: GroundTable | None = None
    index_below: float | None = None
    """Of a medium below, in place of a ground."""


class AngleAxes(NamedTuple):
    """Axes of a table of directions."""

    viewing: Array  # cosines in air
    incidence: Array  # cosines in air
    azimuth: Array  # radians


class ProgramSettings(NamedTuple):
    """Settings fixed when a program is compiled."""

    media: float | Media
    effort: FluxEffort
    downward: bool


class CheckedBatch(NamedTuple):
    """Checked arguments as a flat batch."""

    layers: Layers  # leading axis: batch; the phase function's may be 1
    angles: NamedAngles
    settings: ProgramSettings
    batch: BatchShape


def prepare(
    stack: StackInputs,
    cosines: dict[str, Any],
    azimuth: Any = None,
    *,
    least: float | None = None,
    cos_inside: Float[np.ndarray, "inside"] | None = None,
    downward: bool = False,
) -> CheckedBatch:
    """Checked arguments.

    Args:
        stack: as given.
        cosines: by name, those that vary with the batch.
        azimuth: degrees; None if the result does not depend on it.
        least: smallest cosine of any direction outside where it is not among ``cosines``.
        cos_inside: of directions in the layers that are followed, too.
        downward: whether the light is seen from below.
    """
    # What is known decides which program there is to be, before JAX may trace the rest.
    check_tolerance(stack.tolerance)
    check_given(cosines)
    moments = isotropic() if stack.phase is None else stack.phase
    check_moments(moments)
    known_moments = concrete(moments)
    dtype = jnp.result_type(float)
    moments = jnp.atleast_2d(jnp.asarray(moments, dtype))
    of_phase = moments.shape[:-2]
    # One batch of stacks, angles and phase functions.
    named = {
        name: getattr(stack, name)
        for name in ("albedo", "optical_thickness", "substrate_reflectance")
    }
    shapes = {"phase": of_phase}
    if azimuth is not None:
        check_values({"azimuth": azimuth})
        azimuth = jnp.deg2rad(jnp.asarray(azimuth, dtype))
        shapes["azimuth"] = azimuth.shape
    checked = batch_of_stacks(named | cosines, shapes=shapes)
    media = _media(stack, checked.layers)
    if moments.shape[-2] not in (1, checked.layers):
        raise ValueError(
            f"phase has {moments.shape[-2]} layers (last but one axis) but albedo has "
            f"{checked.layers}"
        )
    terms = moments.shape[-1]
    # A phase function that all stacks share keeps a batch of one.
    shared = int(np.prod(of_phase)) == 1
    flat = checked.flat()
    phases = (1,) * len(of_phase) if shared else checked.batch
    layers = Layers(
        albedo=flat["albedo"],
        optical_thickness=flat["optical_thickness"],
        moments=flat_batch(moments, phases, checked.layers, terms),
        ground=flat["substrate_reflectance"],
    )
    angles = {name: flat[name] for name in cosines}
    if azimuth is not None:
        angles["azimuth"] = flat_batch(azimuth, checked.batch)
    # Below what single precision can hold, more directions would only add rounding.
    single = dtype == jnp.float32
    effort = choose_effort(
        tolerance=max(stack.tolerance, FINEST_SINGLE) if single else stack.tolerance,
        media=media,
        moments=known_moments,
        terms=terms,
        optical_thickness=stack.optical_thickness,
        least_cosine=smallest_cosine(*cosines.values()) if least is None else least,
        streams=stack.streams,
        azimuthal=azimuth is not None,
        solution=stack.solution,
        cos_inside=cos_inside,
    )
    if single:
        warn_of_rounding(
            ROUNDING[stack.solution],
            stack.albedo,
            stack.optical_thickness,
            stack.tolerance,
        )
    return CheckedBatch(
        layers=layers,
        angles=angles,
        settings=ProgramSettings(media, effort, downward),
        batch=checked.batch,
    )


def _media(stack: StackInputs, count: int) -> float | Media:
    """One index where one is enough: no interfaces inside, a Lambertian ground."""
    index = stack.refractive_index
    of_layers = index if isinstance(index, Sequence) else [index] * count
    # Indices decide directions and surfaces when the program is compiled: each must be a number.
    indices = tuple(n for n in map(plain_number, of_layers) if n is not None)
    if len(indices) < len(of_layers):
        raise ValueError(
            "refractive_index must be a number here, such as 1.5, or a sequence of one for each "
            "layer, such as (1.5, 1.4): the same for the whole batch"
        )
    if len(indices) != count:
        raise ValueError(
            f"refractive_index has {len(indices)} values but albedo has {count} layers (last axis)"
        )
    check_values({"refractive_index": np.array(indices)})
    below = stack.index_below
    if below is not None and not 1.0 <= below <= min(indices):
        raise ValueError(
            f"index_below is {below}; it must be at least 1 and at most that of "
            f"every layer, {min(indices)}"
        )
    if len(set(indices)) == 1 and stack.ground is None and below is None:
        return indices[0]
    return Media(indices, None if below is None else float(below))


def solve_stacks(
    stack: StackInputs, cosines: dict[str, Any], azimuth: Any = None, *, downward: bool = False
) -> Array:
    """Factor of each stack between its two cosines, or flux that leaves over that of its beam, or,
    without cosines, over that of even light; arguments as for `prepare`.
    """
    call = prepare(stack, cosines, azimuth, downward=downward)
    return _results(call.layers, call.angles, stack.ground, call.settings).reshape(call.batch)


@functools.partial(jax.jit, static_argnums=3)
def _results(
    layers: Layers, angles: NamedAngles, table: GroundTable | None, settings: ProgramSettings
) -> Array:
    media, effort, downward = settings

    def one(layers: Layers, angles: NamedAngles) -> Array:
        # Without angles no direction is added to the nodes: the light falls in evenly.
        lit = angles["cos_incidence"][None] if angles else layers.albedo[:0]
        # With an azimuth a radiance is asked for, else a flux.
        if "azimuth" in angles:
            axes = AngleAxes(angles["cos_viewing"][None], lit, angles["azimuth"][None])
            return _factor(layers, axes, table, settings)[0, 0, 0]
        if not isinstance(media, Media):
            if angles:
                return manyflux_solve.hemispherical_reflectance(layers, media, lit, effort)[0]
            return manyflux_solve.diffuse_reflectance(layers, media, effort)
        joined = manyflux_joined.joined_stack(
            layers, media, layers.albedo[:0], lit, effort, table=table, downward=downward
        )
        if angles:
            return manyflux_joined.flux_of_beam(joined)[0]
        return manyflux_joined.flux_of_even_light(joined)

    return _map_stacks(one, layers, angles, settings, min(len(angles), 1))


@functools.partial(jax.jit, static_argnums=3)
def tables(
    layers: Layers,
    axes: AngleAxes,
    table: GroundTable | None,
    settings: ProgramSettings,
) -> Array:
    """Factors for all pairs of directions, (batch, viewing, incidence, azimuths)."""

    def one(layers: Layers, _) -> Array:
        return _factor(layers, axes, table, settings)

    return _map_stacks(one, layers, {}, settings, max(axes.viewing.size, axes.incidence.size))


def _factor(
    layers: Layers,
    axes: AngleAxes,
    table: GroundTable | None,
    settings: ProgramSettings,
) -> Array:
    viewing, incidence, azimuth = axes
    media, effort, downward = settings
    if not isinstance(media, Media):
        return manyflux_solve.reflectance_factor(layers, media, viewing, incidence, azimuth, effort)
    joined = manyflux_joined.joined_stack(
        layers, media, viewing, incidence, effort, table=table, downward=downward
    )
    return manyflux_joined.factor(joined, azimuth)


def _map_stacks(
    function: Callable,
    layers: Layers,
    angles: NamedAngles,
    settings: ProgramSettings,
    added: int,
) -> Array:
    """Apply to every stack, some at a time, so that memory stays bounded whatever the batch."""
    count = layers.albedo.shape[1]
    effort = settings.effort
    # A stack's operators are matrices over all directions, for each layer and azimuth mode.
    width = effort.width + added
    chunk = max(1, _CHUNK_BYTES // (count * effort.modes * width**2 * layers.albedo.dtype.itemsize))
    moments = layers.moments
    # A shared phase function's moments stay out of the batch.
    shared = len(moments) == 1

    def one(stack: Layers, angles: NamedAngles) -> Array:
        return function(stack._replace(moments=moments[0]) if shared else stack, angles)

    batch = (layers._replace(moments=None) if shared else layers, angles)
    return in_chunks(lambda piece: jax.vmap(one)(*piece), batch, chunk)
