"""The two reflectances of paint under a rough surface: checks, batches, one surface for
each index.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...spectra import concrete
from ..common.inputs import (
    BatchOfStacks,
    Numbers,
    batch_of_stacks,
    check_tolerance,
    check_values,
)
from ..stack import stack_hemispherical_reflectance, stack_reflectance_factor
from .body import Lit, Surface, reflectance
from .resolution import check_surface, index_by_index, resolve


def rough_reflectance_factor(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    roughness: float,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    tolerance: float = 1e-4,
) -> Float[Array, "*batch"]:
    """Reflectance factor pi L_out / E_in of layers of paint under a rough surface, the body alone.

    As `glazejax.stack_reflectance_factor`, whose value it is at a roughness of zero, but the
    surface is one of GGX
    facets: light is let in, reflected inside and let out in all directions that they turn it to.
    What the surface itself reflects is not in it (`surface_reflectance_factor`). The result does
    not depend on azimuth, for the first scattering forgets it, and is the same with incidence and
    viewing exchanged.

    Args:
        roughness: alpha of the GGX distribution, a Python number in [0, 1]: that of Mitsuba's
            `roughdielectric`, the square of OpenPBR's and Disney's roughness.
        refractive_index: of all layers, (...), known numbers in [1.02, 2.5], or down to 1 if the
            surface is smooth.
        tolerance: absolute error wanted, a Python number; 1e-5 is the least. See Notes.
        The others as in `stack_reflectance_factor`.

    Returns:
        Reflectance factor, shape of the broadcast batch.

    Notes:
        `tolerance` picks the numbers of nodes, facets, beams and angles. They were chosen on random
        stacks of two layers (optical thickness 0.003 to 30, albedo up to 1 - 1e-6, grounds 0 to 1,
        cosines from 0.05) under surfaces of roughness 0.001 to 1 and index 1.05 to 2.5 against a
        run with more of each: the worst error is less than half the tolerance (`python -m
        benchmarks.solver.rough_surface`). A cosine below 0.05 and an index below 1.05 can miss it
        by a few times.

    Raises:
        ValueError: as `stack_reflectance_factor`; and a roughness out of range, or a roughness or
            an index that is traced or differentiated by: the surface's operators are made once for
            each pair of them.

    Source: `glazejax.radiative.rough.facets`, `operators` and `body`.
    """
    arguments: dict[str, Any] = {
        "albedo": albedo,
        "optical_thickness": optical_thickness,
        "substrate_reflectance": substrate_reflectance,
        "cos_incidence": cos_incidence,
        "cos_viewing": cos_viewing,
    }
    if check_surface(roughness, refractive_index) == 0.0:
        return stack_reflectance_factor(
            **arguments, refractive_index=refractive_index, tolerance=tolerance
        )
    return evaluate(arguments, roughness, refractive_index, tolerance)


def rough_hemispherical_reflectance(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    roughness: float,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    tolerance: float = 1e-4,
) -> Float[Array, "*batch"]:
    """Directional-hemispherical reflectance of layers of paint under a rough surface, the body
    alone.

    Flux that leaves over flux of the beam, without what the surface itself reflects
    (`surface_albedo`). With an albedo and a ground of one the two add up to one.

    Args, raises and notes as for `rough_reflectance_factor`; there is no viewing direction.

    Returns:
        Reflectance, shape of the broadcast batch.

    Source: as `rough_reflectance_factor`.
    """
    arguments: dict[str, Any] = {
        "albedo": albedo,
        "optical_thickness": optical_thickness,
        "substrate_reflectance": substrate_reflectance,
        "cos_incidence": cos_incidence,
    }
    if check_surface(roughness, refractive_index) == 0.0:
        return stack_hemispherical_reflectance(
            **arguments, refractive_index=refractive_index, tolerance=tolerance
        )
    return evaluate(arguments, roughness, refractive_index, tolerance)


def evaluate(
    arguments: dict[str, Any], roughness: float, refractive_index: Numbers, tolerance: float
) -> Array:
    """Reflectance of checked arguments; without a viewing direction the hemispherical one."""

    def one(stacks: BatchOfStacks, surface: Surface) -> Array:
        body = _compiled(lit_stacks(stacks.flat(), surface), surface)
        return (body / surface.refractive_index**2).reshape(stacks.batch)

    return by_index(arguments, roughness, refractive_index, tolerance, one)


def by_index(
    arguments: dict[str, Any],
    roughness: float,
    refractive_index: Numbers,
    tolerance: float,
    evaluate_one: Callable[[BatchOfStacks, Surface], Any],
) -> Any:
    """Apply ``evaluate_one`` to a batch of stacks under one surface; index by index where there are
    several.

    Args:
        arguments: by name, as `batch_of_stacks` takes them.
        evaluate_one: from stacks, and their surface, to a pytree of arrays in the shape of their
            batch.
    """
    check_tolerance(tolerance)
    indices = concrete(refractive_index)
    if indices is None:
        raise ValueError(
            "refractive_index is traced, but a surface's operators need known numbers: under jit "
            "or vmap pass it as a static argument, and take slopes by it by differences"
        )
    check_values({"refractive_index": indices})
    # The index belongs to the surface; the stacks are solved without it.
    stacks = batch_of_stacks(arguments, shapes={"refractive_index": indices.shape})
    return index_by_index(
        indices, lambda index: evaluate_one(stacks, resolve(index, roughness, tolerance))
    )


def lit_stacks(flat: dict[str, Any], surface: Surface) -> Lit:
    """A flat batch with what enters of light and view; of the view everything where there is no
    direction.
    """
    operators = surface.operators()
    dtype = jnp.result_type(float)
    # Light and view both enter the paint by the surface's functions of their angle.
    light = operators.enters(jnp.asarray(flat["cos_incidence"], dtype))
    if "cos_viewing" in flat:
        view = operators.enters(jnp.asarray(flat["cos_viewing"], dtype))
    else:
        view = jnp.broadcast_to(jnp.asarray(operators.leaves, dtype), light.shape)
    return Lit(
        albedo=jnp.asarray(flat["albedo"], dtype),
        optical_thickness=jnp.asarray(flat["optical_thickness"], dtype),
        ground=jnp.asarray(flat["substrate_reflectance"], dtype),
        enters=jnp.stack([light, view], axis=1),
        from_ground=jnp.zeros((light.shape[0], 2), dtype),
    )


_compiled = jax.jit(reflectance, static_argnums=1)
