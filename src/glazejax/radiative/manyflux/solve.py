"""One stack of layers solved for given directions: from numbers to operators to what an instrument
reads.

Everything here is for one stack and is mapped over batches by `manyflux`.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..common.directions import half_range
from ..common.fresnel import cos_refracted, dielectric_reflectance
from ..common.linalg import einsum
from .bordered import Bordered, Diagonal
from .directions import NodeSpread, spread_directions
from .doubling import LayerOperators, layer_by_doubling
from .effort import FluxEffort
from .eigenmodes import layer_by_modes
from .media import SharedSpread
from .scattering import Layers, ScaledScattering, azimuth_waves, scatter_between
from .single import ScatteredOnce, missing_once
from .star_product import lambert, stack_reflection, under_surface


class DiscreteStack(NamedTuple):
    """Directions and scattering of a stack."""

    cosines: Diagonal
    roots: Diagonal  # sqrt(mu w); added directions as if of weight one
    surface: Diagonal  # Fresnel reflectance
    scaled: ScaledScattering


def discrete_stack(
    layers: Layers,
    index: Any,
    cos_viewing: Array,
    cos_incidence: Array,
    effort: FluxEffort,
    *,
    viewed_inside: bool = False,
) -> DiscreteStack:
    """Directions and scattering; cosines are outside, those of viewing inside the paint if
    ``viewed_inside``.
    """
    dtype = layers.albedo.dtype
    rule = effort.directions
    assert not isinstance(rule, SharedSpread), "media of several indices are joined elsewhere"
    rule_values = (
        spread_directions(index, rule) if isinstance(rule, NodeSpread) else half_range(index, rule)
    )
    mu, weights, reflectance = (jnp.asarray(a, dtype) for a in rule_values)
    viewing = cos_viewing if viewed_inside else cos_refracted(cos_viewing, index)
    incidence = cos_refracted(cos_incidence, index)
    # An eye inside sees the surface from below, beyond the critical angle as a mirror.
    back = (
        _reflected_back(viewing, index)
        if viewed_inside
        else dielectric_reflectance(cos_viewing, index)
    )
    cosines = Diagonal(mu, viewing, incidence)
    scaled = scatter_between(layers, cosines, jnp.sqrt(weights), effort.terms, effort.modes)
    entering = dielectric_reflectance(cos_incidence, index)
    return DiscreteStack(
        cosines=cosines,
        roots=Diagonal(jnp.sqrt(mu * weights), jnp.sqrt(viewing), jnp.sqrt(incidence)),
        surface=Diagonal(reflectance, back, entering),
        scaled=scaled,
    )


def _outside(stack: DiscreteStack, ground: Array, effort: FluxEffort) -> Bordered:
    """Reflection as seen from outside, (modes, ...)."""
    scaled = stack.scaled
    layer = layer_operators(*scaled.rates(stack.cosines), scaled.thickness[:, None], effort)
    below = lambert(ground, stack.roots, effort.modes)
    return under_surface(stack_reflection(*layer, below), stack.surface)


def _reflected_back(cosines: Array, index: Array | float) -> Array:
    """Fresnel's reflectance of the surface for light from inside, total beyond the
    critical angle.
    """
    # Cosine outside by Snell's law; beyond the critical angle 1, so that its slope is finite.
    squared = 1.0 - index**2 * (1.0 - cosines**2)
    outside = jnp.sqrt(jnp.where(squared > 0, squared, 1.0))
    reflected: Array = dielectric_reflectance(outside, index)
    return jnp.where(squared > 0, reflected, 1.0)


def layer_operators(
    a: Bordered, b: Bordered, thickness: Array, effort: FluxEffort
) -> LayerOperators:
    """R and U = 1 - T of layers, by the solution chosen."""
    if effort.doublings is None:
        return layer_by_modes(a, b, thickness)
    return layer_by_doubling(a, b, thickness, effort.doublings)


def reflectance_factor(
    layers: Layers,
    index: float | Float[Array, ""],
    cos_viewing: Float[Array, "v"],
    cos_incidence: Float[Array, "i"],
    azimuth: Float[Array, "k"],
    effort: FluxEffort,
) -> Float[Array, "v i k"]:
    """pi L_out/E_in for all pairs of directions and relative azimuths (radians).

    The light scattered once is that of the whole phase function and all modes; the operators add
    what is scattered more often (Nakajima and Tanaka, J. Quant. Spectrosc. Radiat. Transfer 40
    (1988) 51, their TMS).
    """
    stack = discrete_stack(layers, index, cos_viewing, cos_incidence, effort)
    outside = _outside(stack, layers.ground, effort)
    waves = azimuth_waves(azimuth, effort.modes)
    all_light = einsum("mvi,mk->vik", outside.corner, waves)
    # A perfect white has 2 sqrt(mu) sqrt(mu_0) in its corner (`lambert`); radiance falls by n^2 on
    # its way out.
    unit = 2.0 * index**2 * stack.roots.viewing[:, None] * stack.roots.incidence
    factor = all_light / unit[..., None]
    # One moment in one mode: nothing of light scattered once was cut off.
    if effort.modes == 1 and layers.moments.shape[-1] == 1:
        return factor
    viewing = stack.cosines.viewing
    incidence = stack.cosines.incidence
    shape = (layers.albedo.size, viewing.size, incidence.size)
    # Through the surface on both ways, and radiance falls by n^2 on its way out.
    through = (1.0 - stack.surface.viewing[:, None]) * (1.0 - stack.surface.incidence) / index**2
    once = ScatteredOnce(
        layers=layers,
        scaled=stack.scaled,
        cos_seen=jnp.broadcast_to(viewing, shape[:2]),
        cos_lit=jnp.broadcast_to(incidence, (shape[0], shape[2])),
        passing=jnp.broadcast_to(through, shape),
    )
    return factor + missing_once(once, azimuth, waves)


def hemispherical_reflectance(
    layers: Layers,
    index: float | Float[Array, ""],
    cos_incidence: Float[Array, "i"],
    effort: FluxEffort,
) -> Float[Array, "i"]:
    """Flux that leaves over flux of a collimated beam, for each direction of incidence."""
    stack = discrete_stack(layers, index, cos_incidence[:0], cos_incidence, effort)
    outside = _outside(stack, layers.ground, effort)
    # sqrt(mu w) times the operator's sqrt(mu w) I is the flux of each node.
    return einsum("n,ni->i", stack.roots.nodes, outside.columns[0]) / stack.roots.incidence


def diffuse_reflectance(
    layers: Layers, index: float | Float[Array, ""], effort: FluxEffort
) -> Float[Array, ""]:
    """Flux that leaves over flux of light of equal radiance from all directions outside."""
    nothing = layers.albedo[:0]
    stack = discrete_stack(layers, index, nothing, nothing, effort)
    outside = _outside(stack, layers.ground, effort)
    # Only the cone of refraction is lit: its flux is 1/n^2 of that of all directions inside.
    return (
        2.0 * index**2 * einsum("i,ij,j->", stack.roots.nodes, outside.core[0], stack.roots.nodes)
    )
