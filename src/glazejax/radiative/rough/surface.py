r"""Reflection by a rough dielectric surface alone, with what its facets hide from each other.

Single facets: B. Walter, S. Marschner, H. Li, K. Torrance, EGSR 2007, with GGX, Smith's separable
masking and Fresnel's exact reflectance, as Mitsuba's `roughdielectric`. Of light from x they lose
k(x). What really becomes of it, after several facets, is modelled by a reciprocal term without
azimuth that keeps all energy,

    f_r = f_single + k(i) k(o)/C,
    C = int k dm  over both sides,  dm = cos dw in air, n^2 cos dw in the paint

(after C. Kulla, A. Conty, SIGGRAPH course 2017). Light that is lost in air also enters the paint
so, and the reverse.
"""

import functools
from collections.abc import Callable
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.fresnel import cos_refracted, dielectric_reflectance
from ..common.inputs import Numbers, check_choice, check_values, concrete
from ..common.quadrature import gauss
from .basis import lagrange
from .facets import scatter
from .lobes import facets_between
from .resolution import check_surface, index_by_index, resolve

Side = Literal["air", "paint"]
"""Where a direction is."""

# What the functions of a surface alone are computed to.
_TOLERANCE = 1e-5
_PAINT_NODES = 40


def surface_reflectance_factor(
    cos_incidence: Numbers,
    cos_viewing: Numbers,
    azimuth: Numbers = 0.0,
    *,
    roughness: float,
    refractive_index: Numbers = 1.5,
) -> Float[Array, "*batch"]:
    """Reflectance factor pi f_r of a rough surface alone, of light that never entered the paint.

    Args:
        cos_incidence, cos_viewing: cosines in air, (...), in (0, 1].
        azimuth: degrees between the horizontal directions of the light before and after, (...): 0
            is the side of the mirror direction, 180 back towards the light, as in
            `glazejax.Bidirectional`.
        roughness: alpha of the GGX distribution, a number in (0, 1].
        refractive_index: known numbers, (...), in [1.02, 2.5].

    Returns:
        pi f_r, shape of the broadcast batch, with the compensation for what single facets lose.

    Raises:
        ValueError: a value out of range, or a smooth surface: its reflection is a mirror's, and no
            number.
    """
    alpha = check_surface(roughness, refractive_index)
    if alpha == 0.0:
        raise ValueError(
            "roughness is 0: a smooth surface reflects in the mirror direction only, and has no "
            "reflectance factor; surface_albedo says how much"
        )
    check_values({"cos_incidence": cos_incidence, "cos_viewing": cos_viewing, "azimuth": azimuth})

    def one(index: float, c_in: Array, c_out: Array, degrees: Array) -> Array:
        met, density = facets_between(jnp, c_in, c_out, degrees, alpha)
        hidden = _masking_over_cosine(c_in, alpha) * _masking_over_cosine(c_out, alpha)
        # pi f of single facets: F pi D G1 G1/(4 c_in c_out).
        single = 0.25 * dielectric_reflectance(met, index) * density * hidden
        operators = resolve(index, alpha, _TOLERANCE).operators()
        # k(i) k(o)/C: what facets lose to one another, spread over all directions.
        return single + operators.loss(c_in) * operators.loss(c_out) / operators.constant

    return _by_index(one, refractive_index, cos_incidence, cos_viewing, azimuth)


def surface_albedo(
    cos_incidence: Numbers, *, roughness: float, refractive_index: Numbers = 1.5
) -> Float[Array, "*batch"]:
    """Directional-hemispherical reflectance of the surface alone; of a smooth one Fresnel's.

    What is not reflected enters the paint: `rough_hemispherical_reflectance` over it adds up to one
    with this.

    Args, raises as for `surface_reflectance_factor`; the index of a smooth surface may be traced.
    """
    alpha = check_surface(roughness, refractive_index)
    check_values({"cos_incidence": cos_incidence, "refractive_index": refractive_index})
    if alpha == 0.0:
        # A formula, which takes an index that is traced, too.
        dtype = jnp.result_type(float)
        return dielectric_reflectance(
            jnp.asarray(cos_incidence, dtype), jnp.asarray(refractive_index, dtype)
        )

    def one(index: float, cosine: Array) -> Array:
        # All energy is kept: what does not enter is reflected.
        operators = resolve(index, alpha, _TOLERANCE).operators()
        return 1.0 - jnp.sum(operators.enters(cosine), axis=-1)

    return _by_index(one, refractive_index, cos_incidence)


def surface_loss(
    cosine: Numbers, *, roughness: float, refractive_index: Numbers = 1.5, side: Side = "air"
) -> Float[Array, "*batch"]:
    """Share k of light that single facets lose, which the compensation spreads.

    Args:
        cosine: in air or in the paint, (...), in (0, 1].
        roughness: alpha, a number in [0, 1]; without roughness nothing is lost.
        refractive_index: known numbers, (...); without roughness it may be traced.
        side: "air" or "paint", where the light comes from.
    """
    alpha = check_surface(roughness, refractive_index)
    check_choice("side", side, Side)
    check_values({"cos_incidence": cosine})
    if alpha == 0.0:
        dtype = jnp.result_type(float)
        both = (jnp.asarray(values, dtype) for values in (cosine, refractive_index))
        return jnp.zeros_like(jnp.broadcast_arrays(*both)[0])

    def one(index: float, cosine: Array) -> Array:
        if side == "air":
            return resolve(index, alpha, _TOLERANCE).operators().loss(cosine)
        split = float(cos_refracted(0.0, index))
        below, above = (jnp.asarray(losses, cosine.dtype) for losses in _paint_losses(index, alpha))
        # Each side of the critical angle has its own polynomial: the loss bends there.
        low = lagrange(jnp.clip(cosine / split, 0.0, 1.0), _PAINT_NODES)
        high = lagrange(jnp.clip((cosine - split) / (1.0 - split), 0.0, 1.0), _PAINT_NODES)
        return jnp.where(cosine < split, low @ below, high @ above)

    return _by_index(one, refractive_index, cosine)


def loss_constant(*, roughness: float, refractive_index: float = 1.5) -> float:
    """C = int k dm over both sides, in the units of a BRDF: f_r of the compensation is k(i) k(o)/C.

    Args:
        roughness: alpha, a number in [0, 1]; 0 gives 0, and what is not 0 at least 1e-5 pi.
        refractive_index: a number in [1.02, 2.5].
    """
    alpha = check_surface(roughness, refractive_index)
    if alpha == 0.0:
        return 0.0
    return np.pi * resolve(float(refractive_index), alpha, _TOLERANCE).operators().constant


def _masking_over_cosine(cosine: Array, roughness: float) -> Array:
    """G1/c, finite where light grazes."""
    return 2.0 / (cosine + jnp.sqrt(cosine**2 + roughness**2 * (1.0 - cosine) * (1.0 + cosine)))


@functools.lru_cache(maxsize=64)
def _paint_losses(index: float, roughness: float) -> tuple[np.ndarray, np.ndarray]:
    """k inside the paint on Gauss' nodes below and above the critical angle."""
    nodes = gauss(_PAINT_NODES)[0]
    split = float(cos_refracted(0.0, index))
    facets = resolve(index, roughness, _TOLERANCE).size.facets
    losses = []
    for cosines in (split * nodes, split + (1.0 - split) * nodes):
        scattered = scatter(cosines, roughness, index, facets, from_paint=True)
        losses.append(scattered.loss())
    return losses[0], losses[1]


def _by_index(
    evaluate_one: Callable[..., Array], refractive_index: Numbers, *arrays: Numbers
) -> Array:
    """``one(index, *arrays)``, index by index where there are several."""
    dtype = jnp.result_type(float)
    indices = np.asarray(concrete(refractive_index), float)
    values = [jnp.asarray(a, dtype) for a in arrays]
    values = jnp.broadcast_arrays(*values, jnp.zeros(indices.shape, dtype))[:-1]
    return index_by_index(indices, lambda index: evaluate_one(index, *values))
