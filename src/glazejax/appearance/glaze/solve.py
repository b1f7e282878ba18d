"""The glaze of a material as the solver wants it: on the scene's wavelengths, with the thicknesses
of a map.
"""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...paint.media import Glaze, Layer, Mixture
from ...radiative.plan.plan import plan_stacks
from ...radiative.stack import stack_reflectance_factor
from ...spectra import (
    Grid,
    Numbers,
    as_array,
    as_float_array,
    on_numpy_or_jax,
    resample,
    validate_wavelengths,
)


def on_grid(glaze: Glaze, wavelengths_nm: Grid) -> Glaze:
    """The glaze on the wavelengths of the scene, its ground with one value for each.

    Raises:
        ValueError: it has batch axes or phase functions, or the wavelengths reach beyond those of
            its paints.
    """
    if glaze.phase is not None:
        raise ValueError(
            "a paint here has a phase function, and then the azimuth matters too: a table of "
            "angles takes isotropic scattering only; use glazejax.reflectance for single "
            "directions"
        )
    if (
        any(coat.thickness.ndim for coat in glaze.coats)
        or glaze.albedo.ndim > 2
        or glaze.ground.ndim > 1
    ):
        raise ValueError(
            "a material is one glaze, without batch axes; give a map of thicknesses as thickness"
        )
    new = validate_wavelengths(wavelengths_nm)
    old = glaze.wavelengths if glaze.coats else new

    def at(values: Numbers) -> Numbers:
        # One value for all bands stays one; a spectrum is resampled.
        array = as_array(values)
        return array if array.ndim == 0 or array.shape[-1] == 1 else resample(old, array, new)

    coats = [Layer(coat.medium.resample(new), coat.thickness) for coat in glaze.coats]
    ground = jnp.broadcast_to(as_float_array(at(glaze.ground)), new.shape)
    index = glaze.refractive_index
    return Glaze(coats, ground, index if isinstance(index, float) else at(index))


def check_layer(glaze: Glaze, layer: int, *, mixed: bool = False) -> None:
    """Refuse a coat that there is not, or, if its fraction is to vary, one that is no mixture of
    two.

    Raises:
        ValueError: the message names the coat and the value.
    """
    if not 0 <= layer < len(glaze.coats):
        raise ValueError(
            f"layer is {layer}, but the glaze has {len(glaze.coats)} coats, the top one is number 0"
        )
    medium = glaze.coats[layer].medium
    if mixed and not (isinstance(medium, Mixture) and len(medium.pigments) == 2):
        raise ValueError(
            f"fraction is the share of the second paint of coat {layer}, but that is "
            f"{medium.name}: write it as a mixture of two paints, such as "
            "0.5*ZincWhite+0.5*Eosin:12um"
        )


def with_variables(
    glaze: Glaze, layer: int, thickness: Numbers | None, fraction: Numbers | None = None
) -> Glaze:
    """The glaze with other thicknesses, m, and other shares of the second paint of one coat,
    (points,) each; None leaves the coat's own.
    """
    coats = list(glaze.coats)
    medium = coats[layer].medium
    depth = coats[layer].thickness
    if fraction is not None:
        assert isinstance(medium, Mixture)
        # Shares of the second paint, and what they leave for the first.
        shares = on_numpy_or_jax(
            lambda xp, share: xp.stack([1.0 - share, share], axis=-1), as_array(fraction)
        )
        medium = Mixture(medium.pigments, shares, medium.name)
    coats[layer] = Layer(medium, depth if thickness is None else thickness)
    return Glaze(coats, glaze.ground, glaze.refractive_index)


def fixed_thickness(glaze: Glaze, layer: int) -> Float[Array, "1"]:
    """Thickness of the layer as it is, in m; 0 for a glaze without coats."""
    return glaze.coats[layer].thickness.reshape(1) if glaze.coats else jnp.zeros(1)


def indices(glaze: Glaze, bands: int) -> Float[Array, "bands"]:
    """Refractive index of each band."""
    return jnp.broadcast_to(as_float_array(glaze.refractive_index), (bands,))


def factor(
    glaze: Glaze, cos_in: Numbers, cos_out: Numbers, tolerance: float
) -> Float[Array, "*batch bands"]:
    """The solver's reflectance factor of a glaze that JAX may trace; cosines end in an axis for the
    bands.
    """
    return stack_reflectance_factor(**_stack(glaze, cos_in, cos_out, tolerance))


def planned_factor(
    glaze: Glaze, cos_in: Numbers, cos_out: Numbers, tolerance: float
) -> Float[np.ndarray, "..."]:
    """The same for a known glaze: exchanged directions, hidden coats and equal stacks are computed
    once or not at all.

    Programs are compiled for few sizes, which serve every glaze of as many coats.
    """
    return np.asarray(plan_stacks(**_stack(glaze, cos_in, cos_out, tolerance)).run())


def _stack(glaze: Glaze, cos_in: Numbers, cos_out: Numbers, tolerance: float) -> dict[str, Any]:
    """Stack that both ask the solver for."""
    return {
        "albedo": glaze.albedo,
        "optical_thickness": glaze.optical_thickness,
        "substrate_reflectance": glaze.ground,
        "refractive_index": glaze.refractive_index,
        "cos_incidence": cos_in,
        "cos_viewing": cos_out,
        "tolerance": tolerance,
    }


def on_nodes(
    glaze: Glaze,
    cos_in: Array | np.ndarray,
    cos_out: Array | np.ndarray,
    depths: Numbers | None,
    layer: int,
    tolerance: float,
    solve: Callable[..., Any] = factor,
) -> Any:
    """Reflectance factor on the tensor grid of nodes, (bands, in, out, thickness).

    Args:
        glaze: of `on_grid`.
        cos_in, cos_out: nodes, (in,) and (out,).
        depths: thicknesses of `layer` in m, (thickness,), or None for one node, its own.
        layer: number of the layer that varies.
        tolerance: of the solver.
        solve: `factor`, whose result is JAX's, or `planned_factor`, whose result is NumPy's.
    """
    varied = glaze if depths is None else with_variables(glaze, layer, depths)
    values = solve(varied, cos_in[:, None, None, None], cos_out[:, None, None], tolerance)
    return (np if isinstance(values, np.ndarray) else jnp).moveaxis(values, -1, 0)
