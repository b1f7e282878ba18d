"""Many-flux Kubelka-Munk: layers with any phase function, all angles and azimuths, under a
refracting surface.

The light is followed in discrete directions inside the medium, one set for each Fourier mode of the
azimuth. Layers are operators made by doubling (`doubling`) or from eigenvectors (`eigenmodes`),
joined on a ground and under a surface (`star_product`), or with surfaces between layers of
different index too (`joined`); the directions of incidence and viewing are exact, not interpolated
(`bordered`). What the kept Legendre moments cannot follow is treated by delta-M, and light
scattered once by the whole phase function (`single`). Free-standing layers are in `free`, the light
inside in `manyflux_field`.

This is paper C (Shinya et al.) with its directions chosen for the surface. For isotropic scattering
it is the same quantity as `glazejax.stack_reflectance_factor`, found another way.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.inputs import Numbers, check_given, check_values, smallest_cosine
from .call import AngleAxes, Indices, StackInputs, prepare, solve_stacks, tables
from .effort import Solution
from .ground import GroundTable


def manyflux_reflectance_factor(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    azimuth: Numbers = 0.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
    ground: GroundTable | None = None,
) -> Float[Array, "*batch"]:
    """Reflectance factor pi L_out/E_in of layers with any phase function under a smooth surface.

    Args:
        phase: Legendre moments of the phase function (`glazejax.radiative.phase`), (terms,) for all
            layers or (..., layers, terms), where layers may be 1. By default scattering is
            isotropic. All functions of a batch share one compiled program; a call of its own with
            another function is compiled again where that needs other directions or moments. Traced
            by JAX, all terms are kept, and one program serves every function.
        refractive_index: of all layers, a number in [1, 2.5], or a sequence of one for each layer:
            light is then refracted and reflected between them too.
        azimuth: angle in degrees between the horizontal directions in which light travels before
            and after, (...): 0 is the side of the mirror direction, 180 back towards the light.
        tolerance: absolute error wanted, a Python number: picks the directions, moments and modes.
        streams: number of directions in each hemisphere, instead of those for the tolerance.
        solution: of the layers: "doubling", or "modes" (eigenvectors): the same to some 1e-12.
        ground: what the ground reflects over angles (`ground_table`), of which
            ``substrate_reflectance`` is a share; Lambertian without.
        The others as in `glazejax.stack_reflectance_factor`.

    Returns:
        Reflectance factor, shape of the broadcast batch, without the surface's own reflection and
        the mirror images in surfaces inside.

    Raises:
        ValueError: a value out of range, shapes that do not broadcast, or a refractive index that
            is not known.

    Source: paper C (Shinya et al.), equations (11)-(20), solved as described in the module.
    """
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
        ground=ground,
    )
    cosines = {"cos_incidence": cos_incidence, "cos_viewing": cos_viewing}
    check_given({"azimuth": azimuth})
    return solve_stacks(stack, cosines, azimuth)


def manyflux_hemispherical_reflectance(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    cos_incidence: Numbers = 1.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
    ground: GroundTable | None = None,
) -> Float[Array, "*batch"]:
    """Flux that leaves over flux of a collimated beam, without the surface's own reflection.

    By reciprocity also the reflectance factor under even light from all sides, seen at that angle.

    Arguments as in `manyflux_reflectance_factor`, result and errors too.
    """
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
        ground=ground,
    )
    return solve_stacks(stack, {"cos_incidence": cos_incidence})


def manyflux_diffuse_reflectance(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
    ground: GroundTable | None = None,
) -> Float[Array, "*batch"]:
    """Flux that leaves over flux of light that falls in evenly from all sides (equal radiance).

    Arguments as in `manyflux_reflectance_factor`, result and errors too; the surface's own
    reflection is not included.
    """
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
        ground=ground,
    )
    return solve_stacks(stack, {})


def brdf_table(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    cos_incidence: Numbers,
    cos_viewing: Numbers,
    azimuth: Numbers = (0.0,),
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
    ground: GroundTable | None = None,
) -> Float[Array, "*batch viewing incidence azimuths"]:
    """Table of the BRDF in 1/sr over angles of viewing, incidence and azimuth, each entry exact:
    one solution for all.

    Arguments that are not listed are as in `manyflux_reflectance_factor`.

    Args:
        cos_incidence, cos_viewing: cosines in air, (incidence,) and (viewing,), in (0, 1].
        azimuth: degrees, (azimuths,).

    Returns:
        (..., viewing, incidence, azimuths), the reflectance factor over pi.

    Raises:
        ValueError: as there, or an axis of angles that is not one-dimensional.
    """
    cosines = {"cos_incidence": cos_incidence, "cos_viewing": cos_viewing}
    angles = cosines | {"azimuth": azimuth}
    for name, values in angles.items():
        if np.ndim(values) != 1:  # pyright: ignore[reportArgumentType]
            raise ValueError(
                f"{name} must be one axis of angles, such as [1.0, 0.5], for a table; it is "
                f"{values}"
            )
    check_values(angles)
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
        ground=ground,
    )
    call = prepare(stack, {}, 0.0, least=smallest_cosine(cos_incidence, cos_viewing))
    dtype = call.layers.albedo.dtype
    viewing, incidence, turns = (
        jnp.asarray(a, dtype) for a in (cos_viewing, cos_incidence, azimuth)
    )
    axes = AngleAxes(viewing, incidence, jnp.deg2rad(turns))
    table = tables(call.layers, axes, ground, call.settings)
    return table.reshape(*call.batch, *table.shape[1:]) / np.pi
