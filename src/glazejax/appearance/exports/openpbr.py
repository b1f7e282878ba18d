"""OpenPBR Surface 1.1 in numbers: what its parameters reflect between two directions, and over a
hemisphere.

Of the model these parts are here: the opaque dielectric base (an energy-preserving rough diffuse
body, EON, under a dielectric surface) and the coat (Fresnel reflection, absorption, darkening).
Left out are metal, subsurface, transmission, thin film, fuzz, emission and anisotropy, which a fit
of paint has no use for.

OpenPBR defines its truth as light transport through slabs and leaves it to programs how near they
come. Two ways are common, and a third is better; `Layering` names them:

- "materialx": the node graph of MaterialX 1.39, `libraries/bxdf/open_pbr_surface.mtlx`. A layer
  takes its albedo, towards the eye, from what lies below; the coat's colour is one factor for all
  angles.
- "specification": the formulas that the specification suggests: the coat absorbs along refracted
  paths, and its darkening weighs a smooth base against a rough one.
- "reciprocal": as the specification, but a layer takes its share on the light's way in as well as
  on the way out, so that light and eye may be exchanged, as they may with paint: after C. Kelemen,
  L. Szirmay-Kalos, A microfacet based coupled specular-matte BRDF model with importance sampling
  (2001).

One thing is more exact here than in either program: albedos of the surface lobes are integrated
from the same lobes with Fresnel's equations, where shaders take fits or tables with Schlick's
approximation.

Sources: OpenPBR Surface specification 1.1 (ASWF, 2024), "Layering", "Glossy-diffuse" and "Coat"; J.
Portsmouth, P. Kutz, S. Hill, EON: a practical energy-preserving rough diffuse BRDF (2024); E.
Turquin, Practical multiple scattering compensation for microfacet models (2019).
"""

from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from ...radiative.common.fresnel import cos_refracted, dielectric_reflectance
from ...radiative.common.quadrature import gauss
from ...radiative.rough.lobes import SMOOTH, cos_between, lobe_albedo, lobe_factor
from .rgb import Triples, Values
from .spaces import Layering

Cosines: TypeAlias = Float[np.ndarray, "..."] | float
"""Cosines of angles from the normal, above 0, or azimuths, degrees."""

Colour: TypeAlias = tuple[float, float, float]

COLOURS = ("base_color", "coat_color")
"""Parameters that are colours; all others are one number."""

# Constants of Fujii's lobe.
_FUJII = 0.5 - 2.0 / (3.0 * np.pi)
_FUJII_MEAN = 2.0 / 3.0 - 28.0 / (15.0 * np.pi)


@dataclass(frozen=True)
class OpenPBR:
    """Parameters of OpenPBR that matter for paint, by the names and with the defaults of the
    specification.

    Colours are linear RGB in a space of your choice, in [0, 1]; roughnesses are in [0, 1], and
    their squares are the alpha of GGX; indices are in [1, 3].

    Raises:
        ValueError: a value is outside; the message names it.
    """

    base_weight: float = 1.0
    base_color: Colour = (0.8, 0.8, 0.8)
    base_diffuse_roughness: float = 0.0
    specular_weight: float = 1.0
    specular_roughness: float = 0.3
    specular_ior: float = 1.5
    coat_weight: float = 0.0
    coat_color: Colour = (1.0, 1.0, 1.0)
    coat_roughness: float = 0.0
    coat_ior: float = 1.6
    coat_darkening: float = 1.0

    def __post_init__(self) -> None:
        for name, value in self.parameters().items():
            low, high = (1.0, 3.0) if name.endswith("ior") else (0.0, 1.0)
            values = np.asarray(value, float)
            if values.shape != ((3,) if name in COLOURS else ()):
                raise ValueError(f"{name} is {value!r}; a colour has three numbers, all else one")
            if not np.all((values >= low) & (values <= high)):
                raise ValueError(f"{name} is {value}; OpenPBR takes {low:g} to {high:g} here")

    def parameters(self) -> dict[str, Any]:
        """Name and value of every parameter."""
        return asdict(self)


def paint_surface(index: float, alpha: float, *, coated: bool = False) -> OpenPBR:
    """Surface of paint, of its index and of an alpha of GGX, and no colour yet.

    Below a coat lies paint of the same index: there is no second surface.
    """
    rough = float(np.sqrt(alpha))
    surface = OpenPBR(specular_ior=index, specular_roughness=rough)
    if coated:
        return replace(surface, coat_weight=1.0, coat_ior=index, coat_roughness=rough)
    return surface


def reflectance_factor(
    material: OpenPBR,
    cos_in: Cosines,
    cos_out: Cosines,
    azimuth: Cosines = 90.0,
    *,
    layering: Layering = "materialx",
    gloss: bool = True,
) -> Triples:
    """Reflectance factor pi f between two directions, (..., 3).

    Args:
        material: of OpenPBR.
        cos_in, cos_out: cosines of the light's and the eye's angle from the normal, (...), above 0.
        azimuth: between them, degrees, (...); 0 is the mirror side.
        layering: how layers are put together, see the module.
        gloss: with the reflection of rough surfaces; without, the body alone. A smooth surface is a
            mirror, which has no reflectance factor and is never in it.
    """
    # In double precision: near a mirror's direction two numbers near one are subtracted.
    angles = (np.asarray(x, float) for x in (cos_in, cos_out, azimuth))
    directions = np.broadcast_arrays(*angles)
    mu_in, mu_out, turn = (np.atleast_1d(x) for x in directions)
    shape = (*directions[0].shape, 3)
    alpha, index = _base_surface(material)
    body = diffuse_factor(
        np.asarray(material.base_color, float), material.base_diffuse_roughness, mu_in, mu_out, turn
    )
    base = (
        material.base_weight * body * _let_through(mu_in, mu_out, alpha, index, layering)[..., None]
    )
    if gloss:
        base = base + lobe_factor(mu_in, mu_out, turn, alpha, index)[..., None]
    if material.coat_weight == 0:
        return np.reshape(base, shape)
    factor = base * _through_coat(material, mu_in, mu_out, layering)
    if gloss:
        lobe = lobe_factor(mu_in, mu_out, turn, material.coat_roughness**2, material.coat_ior)
        factor = factor + material.coat_weight * lobe[..., None]
    return np.reshape(factor, shape)


def surface_albedo(
    material: OpenPBR,
    cos_out: Cosines,
    *,
    layering: Layering = "materialx",
) -> Triples:
    """Share of an even white sky that the surfaces reflect towards an angle, smooth or rough, (...,
    3).

    The base's surface under a coat takes the coat's colour, along the path of a mirror reflection.
    """
    shape = (*np.shape(cos_out), 3)
    mu = np.atleast_1d(np.asarray(cos_out, float))
    albedo = np.repeat(lobe_albedo(mu, *_base_surface(material))[..., None], 3, axis=-1)
    if material.coat_weight > 0:
        coat = material.coat_weight * lobe_albedo(mu, material.coat_roughness**2, material.coat_ior)
        albedo = coat[..., None] + albedo * _through_coat(material, mu, mu, layering)
    return np.reshape(albedo, shape)


def directional_albedo(
    material: OpenPBR,
    cos_out: Cosines,
    *,
    layering: Layering = "materialx",
) -> Triples:
    """Share of an even white sky seen from an angle, the mirror reflection included, (..., 3)."""
    mu = np.asarray(cos_out, float)
    light, weights = gauss(16)
    turns = (np.arange(16) + 0.5) * (180.0 / 16)
    body = reflectance_factor(
        material, light[:, None], mu[..., None, None], turns, layering=layering, gloss=False
    )
    body_albedo = np.einsum("...iac,i->...c", body, 2.0 * weights * light) / turns.size
    return body_albedo + surface_albedo(material, mu, layering=layering)


def diffuse_factor(
    colour: Float[np.ndarray, "3"],
    roughness: float,
    mu_in: Values,
    mu_out: Values,
    azimuth: Values,
) -> Triples:
    """Reflectance factor of the body: EON, Fujii's Oren-Nayar lobe with what it loses given back,
    (..., 3).

    Args:
        colour: (3,), its albedo where all light comes from all sides.
        roughness: 0 is Lambert's body.
        mu_in, mu_out: cosines in air, above 0.
        azimuth: degrees, 0 the mirror side.

    Source: Portsmouth, Kutz, Hill, EON (2024); OpenPBR 1.1, "Glossy-diffuse".
    """
    # Below this roughness the body is Lambert's to rounding, and what is given back would be 0/0.
    if roughness < 1e-6:
        return np.broadcast_to(colour, (*mu_in.shape, 3))
    s = cos_between(np, mu_in, mu_out, azimuth) - mu_in * mu_out
    s_over_t = np.where(s > 0, s / np.maximum(mu_in, mu_out), s)
    single = (1.0 + roughness * s_over_t) / (1.0 + _FUJII * roughness)
    mean = (1.0 + _FUJII_MEAN * roughness) / (1.0 + _FUJII * roughness)
    missing = (
        (1.0 - _fujii_albedo(mu_in, roughness))
        * (1.0 - _fujii_albedo(mu_out, roughness))
        / (1.0 - mean)
    )
    interreflected = colour**2 * mean / (1.0 - colour * (1.0 - mean))
    return single[..., None] * colour + missing[..., None] * interreflected


def _fujii_albedo(mu: Values, roughness: float) -> Values:
    """Directional albedo of the white lobe without what is given back."""
    sine = np.sqrt(np.maximum(0.0, 1.0 - mu**2))
    lobe = sine * (np.arccos(np.clip(mu, -1, 1)) - sine * mu) + 2.0 / 3.0 * (
        sine / mu * (1.0 - sine**3) - sine
    )
    return (1.0 + roughness * lobe / np.pi) / (1.0 + _FUJII * roughness)


def _through_coat(
    material: OpenPBR,
    mu_in: Values,
    mu_out: Values,
    layering: Layering,
) -> Triples:
    """Share that the coat leaves of the base's reflectance factor, (..., 3)."""
    coat = material.coat_weight
    tint = np.asarray(material.coat_color, float)
    through = _let_through(mu_in, mu_out, material.coat_roughness**2, material.coat_ior, layering)[
        ..., None
    ]
    darker = _darkening(material, mu_out, layering)
    if layering == "materialx":
        return (1.0 - coat + coat * through) * (1.0 - coat + coat * tint) * darker
    # The coat's colour is the square of what it lets through straight down.
    path = np.asarray(
        sum(0.5 / cos_refracted(mu, material.coat_ior) for mu in (mu_in, mu_out)), float
    )
    return darker * (1.0 - coat + coat * through * tint ** path[..., None])


def _let_through(
    mu_in: Values,
    mu_out: Values,
    alpha: float,
    index: float,
    layering: Layering,
) -> Values:
    """Factor by which a surface weakens what lies below it."""
    let_out = 1.0 - lobe_albedo(mu_out, alpha, index)
    if layering != "reciprocal":
        return let_out
    return let_out * (1.0 - lobe_albedo(mu_in, alpha, index)) / (1.0 - mean_albedo(alpha, index))


def _base_surface(material: OpenPBR) -> tuple[float, float]:
    """Alpha and relative index of the base's surface, as the coat changes them."""
    index = material.specular_ior
    coat = material.coat_weight
    # A coat of a higher index than the base would reflect totally here: both ways take the ratio
    # that is above 1.
    below = max(index / material.coat_ior, material.coat_ior / index)
    ratio = index + coat * (below - index)
    scaled = np.sqrt(min(material.specular_weight, 1.0)) * (ratio - 1.0) / (ratio + 1.0)
    rough = min(1.0, material.specular_roughness**4 + 2.0 * material.coat_roughness**4) ** 0.25
    roughness = material.specular_roughness + coat * (rough - material.specular_roughness)
    return float(roughness**2), float((1.0 + scaled) / (1.0 - scaled))


def _darkening(material: OpenPBR, mu_out: Values, layering: Layering) -> Triples:
    """Factor by which light thrown back inside the coat darkens the base."""
    index = material.coat_ior
    albedo = np.asarray(material.base_color, float)
    if layering == "materialx":
        normal = ((index - 1.0) / (index + 1.0)) ** 2
        internal = np.broadcast_to(1.0 - (1.0 - normal) / index**2, mu_out.shape)
    else:
        albedo = albedo * material.base_weight
        rough = 1.0 - (1.0 - mean_albedo(0.0, index)) / index**2
        base = dielectric_reflectance(mu_out, material.specular_ior)
        share = 1.0 + material.specular_weight * base * (material.specular_roughness - 1.0)
        smooth = dielectric_reflectance(mu_out, index)
        internal = np.asarray(smooth + share * (rough - smooth), float)
    internal = internal[..., None]
    darker = (1.0 - internal) / (1.0 - albedo * internal)
    return 1.0 + material.coat_weight * material.coat_darkening * (darker - 1.0)


@lru_cache(maxsize=64)
def mean_albedo(alpha: float, index: float) -> float:
    """Reflectance of a dielectric's outer surface for light from all sides, the
    hemispherical mean.
    """
    mu, weights = gauss(64 if alpha < SMOOTH else 16)
    return float(np.sum(2.0 * weights * mu * lobe_albedo(mu, alpha, index)))
