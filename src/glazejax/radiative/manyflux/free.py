"""Free-standing layers: what they reflect and let through, with smooth surfaces on both sides.

    air, index 1
    layers, any indices and phase functions
    what lies below, index_below (air by default)

Light comes from above. With ``transmitted`` the result is what leaves below, else what comes back
to the air.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..common.inputs import Numbers, check_given
from .call import Indices, StackInputs, solve_stacks
from .effort import Solution


def free_factor(
    albedo: Numbers,
    optical_thickness: Numbers,
    *,
    transmitted: bool,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    index_below: float = 1.0,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    azimuth: Numbers = 0.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Float[Array, "*batch"]:
    """Reflectance or transmittance factor pi L_out/E_in of scattered light.

    Arguments that are not listed are as in `manyflux_reflectance_factor`.

    Args:
        transmitted: whether the light is seen from below, else from above.
        index_below: refractive index of what lies below, at least 1 and at most that of every
            layer.
        cos_viewing: in the medium of the eye: in air, or below where ``transmitted``.
        azimuth: degrees between the horizontal directions of travel; 0 is straight on.

    Returns:
        Factor, shape of the broadcast batch. Light that goes straight through or is mirrored by a
        surface goes in one direction only and is not in it.

    Raises:
        ValueError: as there, or an ``index_below`` out of range.
    """
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
        index_below=index_below,
    )
    cosines = {"cos_incidence": cos_incidence, "cos_viewing": cos_viewing}
    check_given({"azimuth": azimuth})
    return solve_stacks(stack, cosines, azimuth, downward=transmitted)


def free_hemispherical(
    albedo: Numbers,
    optical_thickness: Numbers,
    *,
    transmitted: bool,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    index_below: float = 1.0,
    cos_incidence: Numbers = 1.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Float[Array, "*batch"]:
    """Flux that leaves above or below over flux of a collimated beam.

    All light is in it, straight and mirrored too, but not what the outer surface reflects at once.
    Arguments, result and errors as for `free_factor`.
    """
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
        index_below=index_below,
    )
    return solve_stacks(stack, {"cos_incidence": cos_incidence}, downward=transmitted)


def free_diffuse(
    albedo: Numbers,
    optical_thickness: Numbers,
    *,
    transmitted: bool,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    index_below: float = 1.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Float[Array, "*batch"]:
    """Flux that leaves above or below over flux of light that falls in evenly from all sides (equal
    radiance).

    As `free_hemispherical` otherwise.
    """
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
        index_below=index_below,
    )
    return solve_stacks(stack, {}, downward=transmitted)


def free_regular(
    albedo: Numbers,
    optical_thickness: Numbers,
    *,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    index_below: float = 1.0,
    cos_incidence: Numbers = 1.0,
) -> Float[Array, "*batch"]:
    """Share of a beam that goes straight through, with all its reflections between the surfaces.

    The rest of what `free_hemispherical` lets through was scattered. Arguments as there.
    """
    # Without scattering only the beam gets through, exactly, however coarse the directions.
    nothing = jnp.zeros_like(jnp.asarray(albedo, jnp.result_type(float)))
    return free_hemispherical(
        nothing,
        optical_thickness,
        transmitted=True,
        phase=phase,
        refractive_index=refractive_index,
        index_below=index_below,
        cos_incidence=cos_incidence,
        tolerance=1e-3,
    )
