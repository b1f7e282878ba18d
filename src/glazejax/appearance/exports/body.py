"""The rough diffuse body that OpenPBR has below its surface, EON.

Azimuths are degrees, 0 the mirror side, as in `glazejax.geometry`; cosines are in air and above 0.
"""

import numpy as np
from jaxtyping import Float

from ...radiative.rough.lobes import cos_between
from .rgb import Triples, Values

_FUJII = 0.5 - 2.0 / (3.0 * np.pi)
_FUJII_MEAN = 2.0 / 3.0 - 28.0 / (15.0 * np.pi)


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
        mu_in, mu_out, azimuth: see the module.

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
