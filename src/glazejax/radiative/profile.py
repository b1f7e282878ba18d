r"""Reflectance of a film whose absorption and scattering vary continuously with depth.

Paper A (Shinozawa et al. 2013) states its equations for an albedo q(tau) that varies with optical
depth, eqs (3)-(21). Two ways to the same number:

- "ordinates" cuts the film into homogeneous slices with the mean k and s of each, doubles their
  number and extrapolates (Romberg: the error goes in even powers of the slices' thickness) until
  the estimate is below the tolerance;
- "auxiliary" solves the integral equation with the true q(tau) at the nodes of a graded mesh, and
  halves its panels until the estimate is below the tolerance.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Literal, NamedTuple, TypeAlias, cast

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .auxiliary import graded as auxiliary_graded
from .auxiliary.panels import PanelMesh, Panels, graded_shares, rules
from .common.chunks import in_chunks
from .common.inputs import (
    BatchShape,
    Numbers,
    batch_shape,
    check_choice,
    check_given,
    check_mask,
    check_tolerance,
    check_values,
    concrete,
    flat_batch,
    is_amount,
    plain_number,
    refuse,
)
from .common.linalg import einsum
from .common.quadrature import gauss
from .common.rounding import FINEST_SINGLE
from .common.stack_arrays import StackArrays
from .stack import stack_hemispherical_reflectance, stack_reflectance_factor

DepthFunction: TypeAlias = Callable[[Array], Array]
"""A function of the depth, or of its share: (..., points) to (..., points)."""

Profile: TypeAlias = DepthFunction | Numbers
"""A callable of depth (m), or values at equally spaced depths from the surface to the ground."""

ProfileMethod: TypeAlias = Literal["ordinates", "auxiliary"]
"""How a profile is solved: in slices, or as an integral equation."""

Illumination: TypeAlias = dict[str, Any]
"""Ground, refractive index and cosines by name; without a viewing direction all of them count."""

# Bytes of the arrays of the films that go through at a time.
_CHUNK_BYTES = 2**24


def profile_reflectance_factor(
    absorption: Profile,
    scattering: Profile,
    thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    tolerance: float = 1e-6,
    method: ProfileMethod = "ordinates",
) -> Float[Array, "*batch"]:
    """Reflectance factor pi L_out / E_in of a film whose k and s vary continuously with depth.

    Args:
        absorption: k in 1/m, >= 0. Either a callable of the depth z in m below the surface, ((...,
            points) -> (..., points), with the batch axes of `thickness`), or values (..., points)
            at equally spaced depths from the surface to the ground, taken as piecewise linear.
        scattering: s in 1/m, >= 0, in the same way; of radiative transfer, isotropic.
        thickness: of the film in m, (...), >= 0.
        method: "ordinates" (slices, extrapolated) or "auxiliary" (the integral equation with the
            true albedo).
        The others as in `stack_reflectance_factor`.

    Returns:
        Reflectance factor, shape of the broadcast batch.

    Raises:
        ValueError: a value out of range, shapes that do not fit, an unknown method, or a profile
            that varies too fast to be resolved. Where a value that is traced is out of its
            range, the result is NaN.

    Notes:
        Callables should be smooth; a kink belongs into samples, a step is best made of two layers
        of
        `stack_reflectance_factor`. Under `jax.jit` errors cannot be estimated: then two doublings
        are made (of 8 slices, or of one a sample interval), or one halving of the auxiliary mesh
        for a film no thicker than 40.

    Source: paper A, eqs (3)-(21).
    """
    light: Illumination = {
        "substrate_reflectance": substrate_reflectance,
        "refractive_index": refractive_index,
        "cos_incidence": cos_incidence,
        "cos_viewing": cos_viewing,
    }
    profiles = {"absorption": absorption, "scattering": scattering}
    return _evaluate(profiles, thickness, light, tolerance, method)


def profile_hemispherical_reflectance(
    absorption: Profile,
    scattering: Profile,
    thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    tolerance: float = 1e-6,
    method: ProfileMethod = "ordinates",
) -> Float[Array, "*batch"]:
    """Directional-hemispherical reflectance of a film whose k and s vary continuously with depth.

    Arguments as in `profile_reflectance_factor`, errors and notes too; there is no viewing
    direction.

    Returns:
        Flux that leaves over flux of the beam that falls in, without the part reflected by the
        surface, (...).

    Source: paper A, eqs (3)-(21).
    """
    light: Illumination = {
        "substrate_reflectance": substrate_reflectance,
        "refractive_index": refractive_index,
        "cos_incidence": cos_incidence,
    }
    profiles = {"absorption": absorption, "scattering": scattering}
    return _evaluate(profiles, thickness, light, tolerance, method)


class _ProfileFilm(NamedTuple):
    """A profile in the share u of the film's depth, u in [0, 1]."""

    absorption: DepthFunction
    scattering: DepthFunction
    intervals: int | None  # equal parts of the depth in which samples are linear
    thickness: Array
    batch: BatchShape  # of everything


def _evaluate(
    profiles: dict[str, Profile],
    thickness: Numbers,
    light: Illumination,
    tolerance: float,
    method: str,
) -> Array:
    """Reflectance of a film by its absorption and scattering, with a viewing direction in ``light``
    or for all directions together.
    """
    check_choice("method", method, ProfileMethod)
    check_tolerance(tolerance)
    check_given(light)
    check_values(light)
    film = _film(profiles, thickness, light)
    solve = _solve_sliced if method == "ordinates" else _solve_on_mesh
    return solve(film, light, tolerance)


def _film(
    profiles: dict[str, Profile], film_thickness: Numbers, light: Illumination
) -> _ProfileFilm:
    dtype = jnp.result_type(float)
    # JAX would take the numbers under a mask.
    for name, value in {**profiles, "thickness": film_thickness}.items():
        check_mask(name, value)
    thickness = jnp.asarray(film_thickness, dtype)
    refuse("thickness", concrete(thickness), "a length in m, >= 0 and finite", is_amount)
    functions = []
    counts = {}
    shapes = {"thickness": thickness.shape}
    for name, profile in profiles.items():
        if callable(profile):
            functions.append(_of_share(name, cast(DepthFunction, profile), thickness))
            # A function shows its batch at some depths.
            shapes[name] = functions[-1](jnp.linspace(0.0, 1.0, 9, dtype=dtype)).shape[:-1]
            continue
        samples = jnp.asarray(profile, dtype)
        if samples.ndim == 0:
            raise ValueError(
                f"{name} is a single number; give a callable of depth or values along a last axis"
            )
        refuse(name, concrete(samples), "in 1/m, >= 0 and finite", is_amount)
        if samples.shape[-1] == 0:
            raise ValueError(f"{name} has no values along its last axis; give at least one")
        counts[name] = samples.shape[-1] - 1
        shapes[name] = samples.shape[:-1]
        functions.append(_piecewise_linear(samples))
    # Samples of both at the same depths, so that slices hold no kink.
    several = {count for count in counts.values() if count > 0}
    if len(several) > 1:
        raise ValueError(
            f"absorption has {counts['absorption'] + 1} depths (last axis) but scattering has "
            f"{counts['scattering'] + 1}; give both at the same depths"
        )
    shapes |= {name: np.shape(value) for name, value in light.items()}
    batch = batch_shape(shapes, last="depths")
    return _ProfileFilm(
        absorption=functions[0],
        scattering=functions[1],
        intervals=max(several, default=None),
        thickness=thickness,
        batch=batch,
    )


def _of_share(name: str, profile: DepthFunction, thickness: Array) -> DepthFunction:
    def function(share: Array) -> Array:
        depth = share * thickness[..., None]
        values = jnp.asarray(profile(depth), depth.dtype)
        if values.ndim == 0 or values.shape[-1] not in (1, depth.shape[-1]):
            raise ValueError(
                f"{name} returned shape {values.shape} for depths {depth.shape}; it must return "
                "one value a depth"
            )
        refuse(name, concrete(values), "in 1/m, >= 0 and finite, at every depth", is_amount)
        return jnp.broadcast_to(values, (*values.shape[:-1], depth.shape[-1]))

    return function


def _piecewise_linear(samples: Array) -> DepthFunction:
    count = samples.shape[-1] - 1

    def function(share: Array) -> Array:
        if count == 0:
            return jnp.broadcast_to(samples, (*samples.shape[:-1], share.shape[-1]))
        position = share * count
        # The interval's number has no slope, only the share within it.
        lower = jnp.clip(jnp.floor(jax.lax.stop_gradient(position)), 0, count - 1)
        index = lower.astype(int)
        batch = jnp.broadcast_shapes(samples.shape[:-1], share.shape[:-1])
        values = jnp.broadcast_to(samples, (*batch, count + 1))
        index, fraction = (
            jnp.broadcast_to(a, (*batch, share.shape[-1])) for a in (index, position - lower)
        )
        low, high = (jnp.take_along_axis(values, index + i, axis=-1) for i in (0, 1))
        return low + (high - low) * fraction

    return function


def _albedo(absorption: Array, scattering: Array) -> Array:
    """s/(k + s), and 0 where there is nothing."""
    extinction = absorption + scattering
    return jnp.where(extinction > 0, scattering / jnp.where(extinction > 0, extinction, 1.0), 0.0)


def _solve_sliced(film: _ProfileFilm, light: Illumination, tolerance: float) -> Array:
    x, w = gauss(4)
    viewed = "cos_viewing" in light
    solve = stack_reflectance_factor if viewed else stack_hemispherical_reflectance
    # The solver may take a third of the tolerance, the slices the rest.
    solver_tolerance = 0.3 * tolerance
    if film.thickness.dtype == jnp.float32:
        # The solver warns below 1e-6, which is right only where the user asked for less.
        solver_tolerance = max(solver_tolerance, min(tolerance, 1e-6))

    def reflectance(count: int) -> Array:
        # Gauss's points in each slice, as shares of the film's depth.
        share = jnp.asarray(((np.arange(count)[:, None] + x) / count).ravel(), film.thickness.dtype)

        # Mean k and s of each slice, by Gauss's rule in it.
        def mean(profile: DepthFunction) -> Array:
            values = profile(share)
            slices = values.reshape(*values.shape[:-1], count, len(x))
            return einsum("...i,i->...", slices, jnp.asarray(w, values.dtype))

        k = mean(film.absorption)
        s = mean(film.scattering)
        # Optical thickness of a slice: k and s in 1/m, times its share of the film.
        depth = (k + s) * film.thickness[..., None] / count
        return jnp.broadcast_to(
            solve(_albedo(k, s), depth, tolerance=solver_tolerance, **light), film.batch
        )

    # At least 8 slices: as many as samples, or a multiple, so that no slice holds a kink.
    intervals = film.intervals or 1
    slices = intervals * -(-8 // intervals)
    row = [reflectance(slices)]
    while True:
        slices *= 2
        # Romberg's extrapolation: errors go with even powers of the slices' width.
        before = row
        value = reflectance(slices)
        row = [value]
        for order, coarser in enumerate(before, 1):
            value = value + (value - coarser) / (4.0**order - 1.0)
            row.append(value)
        change = concrete(value - before[-1])
        if change is None:
            # Where values are traced there is nothing to compare: two doublings are done.
            if len(row) > 2:
                return value
        elif _has_settled(change, value, tolerance, last=2 * slices > 2048):
            return value


def _has_settled(change: np.ndarray, value: Array, tolerance: float, *, last: bool) -> bool:
    """Test whether the last change of an estimate lies within the tolerance.

    Raises:
        ValueError: it doesn't, and the estimate can't be refined any more.
    """
    error = np.max(np.abs(change), initial=0.0)
    # Rounding of a difference bounds the estimate from below; in single precision it grows with the
    # slices.
    single = value.dtype == jnp.float32
    rounding = FINEST_SINGLE if single else 50.0 * float(jnp.finfo(value.dtype).eps)
    settled = bool(error < max(0.7 * tolerance, rounding))
    if last and not settled:
        raise ValueError(
            f"tolerance is {tolerance} but the profile varies too fast: an error of some "
            f"{error:.1e} is left; give steps as layers of stack_reflectance_factor, kinks as "
            "samples, or ask for a larger tolerance"
        )
    return settled


def _solve_on_mesh(film: _ProfileFilm, light: Illumination, tolerance: float) -> Array:
    dtype = film.thickness.dtype
    flat = {
        name: flat_batch(jnp.asarray(value, dtype), film.batch) for name, value in light.items()
    }
    fixed = plain_number(light["refractive_index"])
    index = concrete(light["refractive_index"])
    lowest = 1.0 if index is None else float(np.min(index, initial=2.5))
    # The whole optical thickness, which sets the mesh.
    share = jnp.linspace(0.0, 1.0, 257, dtype=dtype)
    total = jnp.mean(film.absorption(share) + film.scattering(share), axis=-1) * film.thickness
    depths = concrete(total)
    thickest = 40.0 if depths is None else float(np.max(depths, initial=0.0))
    mesh = auxiliary_graded.resolve(tolerance, min(thickest, 40.0), lowest)
    # Deeper films by more panels of the same proportions, so that the narrowest stay as narrow.
    deeper = int(np.ceil(np.log2(min(max(thickest / 40.0, 1.0), 1e6))))
    mesh = mesh._replace(graded=mesh.graded + deeper)

    def reflectance(halvings: int) -> Array:
        panels = _film_panels(film, mesh, halvings)
        count = panels.width.shape[-1]
        bytes_each = auxiliary_graded.bytes_each(mesh, count, dtype.itemsize)
        chunk = max(1, _CHUNK_BYTES // bytes_each)
        return _on_panels((panels, flat), mesh, fixed, chunk).reshape(film.batch)

    # Panels are halved until the answer stays.
    halvings = 0
    before = reflectance(0) if depths is not None else None
    while True:
        halvings += 1
        value = reflectance(halvings)
        change = None if before is None else concrete(value - before)
        if change is None or _has_settled(change, value, tolerance, last=halvings == 4):
            return value
        before = value


@functools.partial(jax.jit, static_argnums=(1, 2, 3))
def _on_panels(
    batch: tuple[Panels, dict[str, Array]],
    mesh: PanelMesh,
    refractive_index: float | None,
    chunk: int,
) -> Array:
    """Reflectance of films on their panels, so many at a time; an index that is None is in the
    batch.
    """
    table = rules(mesh.nodes, mesh.points, batch[0].width.dtype)

    def one(piece: tuple[Panels, dict[str, Array]]) -> Array:
        local, lit = piece
        index = lit["refractive_index"] if refractive_index is None else refractive_index
        stack = StackArrays(
            albedo=local.albedo,
            optical_thickness=local.width,
            ground=lit["substrate_reflectance"],
            refractive_index=index,
            cos_incidence=lit["cos_incidence"],
            cos_viewing=lit.get("cos_viewing"),
        )
        return auxiliary_graded.reflectance_on(local._replace(rules=table), stack)

    # Chunk by chunk, and computed again for a reverse pass rather than kept.
    return in_chunks(jax.checkpoint(one), batch, chunk)


def _film_panels(film: _ProfileFilm, mesh: PanelMesh, halvings: int) -> Panels:
    """Panels whose edges are fixed shares of the depth, with the true albedo at their nodes; batch
    axis flattened, without rules.
    """
    edges = graded_shares(mesh)
    # Samples have kinks at their depths: these become edges, so that each panel is smooth.
    if film.intervals is not None:
        edges = np.unique(
            np.round(np.concatenate([edges, np.linspace(0, 1, film.intervals + 1)]), 12)
        )
    # Each panel is cut into equal pieces.
    pieces = 2**halvings
    inner = np.linspace(edges[:-1], edges[1:], pieces, endpoint=False).T.ravel()
    edges = np.r_[inner, 1.0]
    table = rules(mesh.nodes, mesh.points, film.thickness.dtype)
    start = edges[:-1, None]
    span = np.diff(edges)[:, None]
    x, w = gauss(10)

    def extinction(
        share: Array,
    ) -> Array:  # (..., panels, points) of the film's share, in optical depth per share
        flat = share.reshape(*share.shape[:-2], -1)
        values = film.absorption(flat) + film.scattering(flat)
        values = values * film.thickness[..., None]
        return values.reshape(*values.shape[:-1], *share.shape[-2:])

    def depth_within(
        fraction: Array,
    ) -> Array:  # optical depth from the panel's top to its share `fraction`, (..., panels, p)
        points = fraction[..., None] * x  # (..., panels, p, m)
        share = start + span * points.reshape(*points.shape[:-2], -1)
        values = extinction(share).reshape(
            *jnp.broadcast_shapes(film.batch, points.shape[:-3]), *points.shape[-3:]
        )
        return span * fraction * (values @ jnp.asarray(w, values.dtype))

    dtype = film.thickness.dtype
    ones = jnp.ones((*film.batch, len(start), 1), dtype)
    width = depth_within(ones)[..., 0]
    fraction = jnp.broadcast_to(table.nodes, (*film.batch, len(start), mesh.nodes))
    for _ in range(8):  # where the optical depth reaches the nodes
        slope = span * extinction(start + span * fraction)
        miss = depth_within(fraction) - width[..., None] * table.nodes
        # Newton's step, at most as long as the panel.
        step = miss / jnp.maximum(slope, jnp.finfo(dtype).tiny)
        fraction = jnp.clip(fraction - jnp.clip(step, -1.0, 1.0), 0.0, 1.0)
    share = (start + span * fraction).reshape(*film.batch, -1)
    albedo = _albedo(film.absorption(share), film.scattering(share))
    size = int(np.prod(film.batch))
    width = width.reshape(size, -1)
    albedo = jnp.broadcast_to(albedo, share.shape).reshape(size, len(start), mesh.nodes)
    depth = jnp.cumsum(width, axis=-1)
    return Panels(top=depth - width, width=width, albedo=albedo, total=depth[:, -1], rules=None)
