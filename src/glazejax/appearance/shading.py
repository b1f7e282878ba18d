"""Light reflected by a point of a surface, band by band: Lambert, Phong and Torrance-Sparrow, as
paper B prints them.

Directions point away from the surface: N the normal, L to the light, V to the eye, H half-way
between L and V. The functions take the cosines between them, so that a scene computes each once.
They are elementwise and can be differentiated by every argument. Cosines have shape (...), spectra
(..., bands); a light that does not reach the front of the surface gives nothing.

What comes back is the spectrum that reaches the eye, on the scale of the light: a white Lambert
surface that faces a light of spectrum I returns I. A scene may leave the light out (``light=1.0``)
and multiply by it later.

Source: paper B (Tominaga 1993), sections 3.1, 3.2 and 5.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..spectra import Numbers, as_float_array


def lambert(
    reflectance: Numbers, cos_light: Numbers, light: Numbers = 1.0
) -> Float[Array, "*batch bands"]:
    """Perfectly diffuse reflection: S_d (N.L) I.

    Args:
        reflectance: S_d, (..., bands), in [0, 1].
        cos_light: N.L, (...); nothing comes from below 0.
        light: spectrum I of the light, (..., bands) or one number.

    Source: paper B, first term of eq (4).
    """
    return as_float_array(reflectance) * _front(cos_light)[..., None] * as_float_array(light)


def phong(
    body: Numbers,
    light: Numbers,
    cos_light: Numbers,
    cos_mirror: Numbers,
    *,
    specular: Numbers = 1.0,
    exponent: Numbers = 11.0,
) -> Float[Array, "*batch bands"]:
    """Phong's model of an inhomogeneous material: S_d (N.L) I + S_s (R_v.L)^n I.

    The second part has the colour of the light, so chromaticities lie between those of body and
    light.

    Args:
        body: diffuse reflectance S_d, (..., bands), in [0, 1].
        light: spectrum I of the light, (..., bands) or one number.
        cos_light: N.L, (...).
        cos_mirror: R_v.L, (...), between the light and the mirror image of the view.
        specular: S_s, the same in all bands, (...).
        exponent: n > 0, (...); the larger, the smaller the highlight. Paper B's spheres have 11.

    Source: paper B, eq (4); several lights, eq (24), are its sum.
    """
    shine = _front(cos_mirror)
    # A power of zero has no slope by the exponent; there the highlight is nothing.
    dark = shine <= 0.0
    highlight = jnp.where(dark, 0.0, jnp.where(dark, 1.0, shine) ** as_float_array(exponent))
    # The highlight belongs to the front too: without this, a light below the horizon would show.
    lit = as_float_array(cos_light) > 0.0
    highlight = jnp.where(lit, as_float_array(specular) * highlight, 0.0)
    return lambert(body, cos_light, light) + highlight[..., None] * as_float_array(light)


def facet_distribution(cos_half: Numbers, width: Numbers) -> Float[Array, "*batch"]:
    """Share D of facets that face H: a Gaussian of the angle alpha between N and H.

    Args:
        cos_half: N.H, (...), in [-1, 1].
        width: beta, (...), the angle in radians at which D falls to one half, > 0.

    Source: paper B, eq (7), D = exp(-ln 2 alpha^2 / beta^2).
    """
    return jnp.exp(
        -math.log(2.0) * _squared_angle(as_float_array(cos_half)) / as_float_array(width) ** 2
    )


def masking(
    cos_half: Numbers, cos_view: Numbers, cos_light: Numbers, cos_view_half: Numbers
) -> Float[Array, "*batch"]:
    """Share G of light that facets neither shadow nor hide.

    Args:
        cos_half, cos_view, cos_light: N.H, N.V and N.L, (...).
        cos_view_half: V.H, (...), which equals L.H.

    Returns:
        min{1, 2 (N.H)(N.V)/(V.H), 2 (N.H)(N.L)/(V.H)}; 0 where light or eye is behind the surface.

    Source: paper B, eq (8).
    """
    half = as_float_array(cos_half)
    view = _front(cos_view)
    light = _front(cos_light)
    between = as_float_array(cos_view_half)
    # In front of a surface V.H is positive; it is zero only for opposite directions.
    opposite = between <= 0.0
    slope = 2.0 * half / jnp.where(opposite, 1.0, between)
    least = jnp.minimum(jnp.minimum(1.0, slope * view), slope * light)
    return jnp.where(opposite, 0.0, jnp.maximum(least, 0.0))


def torrance_sparrow(
    fresnel: Numbers,
    light: Numbers,
    cos_light: Numbers,
    cos_view: Numbers,
    cos_half: Numbers,
    cos_view_half: Numbers,
    *,
    width: Numbers,
    body: Numbers = 0.0,
) -> Float[Array, "*batch bands"]:
    """Torrance and Sparrow's model of a rough metal: S_d (N.L) I + D G F I / (N.V).

    Args:
        fresnel: F, (..., bands): the facets' reflectance at the angle whose cosine is
            `cos_view_half`, such as
            `glazejax.radiative.fresnel.conductor_reflectance`.
        light: spectrum I of the light, (..., bands) or one number.
        cos_light, cos_view, cos_half: N.L, N.V and N.H, (...).
        cos_view_half: V.H, (...), which equals L.H.
        width: beta of `facet_distribution`, radians, (...).
        body: diffuse reflectance S_d, (..., bands) or one number; next to nothing for metals.

    Returns:
        (..., bands); nothing where light or eye is behind the surface.

    Notes:
        As printed, D is 1 at its peak and there is no factor that keeps energy: a broad
        distribution reflects more light in all than a narrow one.

    Source: paper B, eqs (5)-(8).
    """
    view = as_float_array(cos_view)
    front = (view > 0.0) & (as_float_array(cos_light) > 0.0)
    shape = facet_distribution(cos_half, width) * masking(
        cos_half, cos_view, cos_light, cos_view_half
    )
    shape = jnp.where(front, shape / jnp.where(view > 0.0, view, 1.0), 0.0)
    shine = as_float_array(fresnel) * shape[..., None] * as_float_array(light)
    lit_cosine = jnp.where(view > 0.0, as_float_array(cos_light), 0.0)
    return shine + lambert(body, lit_cosine, light)


def _front(cosine: Numbers) -> Float[Array, "..."]:
    """Cosine, or 0 where it is negative."""
    return jnp.maximum(as_float_array(cosine), 0.0)


def _squared_angle(cosine: Float[Array, "..."]) -> Float[Array, "..."]:
    """arccos(c)^2, with finite slope at c = 1 and c = -1."""
    u = 1.0 - cosine
    # Below this 1 - cos the squared angle is summed as a series, whose slope at zero is finite.
    near = u < 0.05
    # arcsin(x)^2 = 1/2 sum (2x)^(2n) / (n^2 binomial(2n, n)), with x^2 = u / 2.
    series = jnp.zeros_like(u)
    for n in range(12, 0, -1):
        series = 2.0 * u * (series + 1.0 / (n**2 * math.comb(2 * n, n)))
    # Just above -1 the slope of arccos has no bound; no direction in front of a surface comes
    # there.
    clipped = jnp.clip(jnp.where(near, 0.0, cosine), -1.0 + 1e-7, 1.0)
    return jnp.where(near, 2.0 * series, jnp.arccos(clipped) ** 2)
