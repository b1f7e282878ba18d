r"""What single facets of a rough surface do to a beam, by quadrature over the facets that it sees.

GGX facets of roughness a, with Smith's separable masking (B. Walter, S. Marschner, H. Li, K. Torrance, EGSR 2007). Seen
from a direction i, facets are distributed as the normals of an ellipsoid that is stretched to a hemisphere (E. Heitz,
JCGT 7(4), 2018). On that hemisphere, with the pole across the plane of incidence,

    m = (-a cos psi cos omega, a sin psi, cos psi sin omega) / its length,

psi in [-pi/2, pi/2], omega in [theta, pi], where tan theta = a tan theta_i: each m of this lune is seen, with the
weight cos^2 psi sin(omega - theta) dpsi domega. A facet reflects F(i.m) and lets 1 - F through; of that G1 of the new
direction is not caught by other facets.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..common.fresnel import dielectric_reflectance
from ..common.quadrature import gauss

Cosines = Float[np.ndarray, "beams"]
Events = Float[np.ndarray, "beams facets"]


class Scattered(NamedTuple):
    """What a beam becomes at single facets: cosines and shares of its flux, (beams, facets).

    A direction on the wrong side of the surface has a share of zero, and a cosine below it.
    """

    reflected: Events
    reflected_share: Events
    refracted: Events
    refracted_share: Events


def masking(cosine: np.ndarray, roughness: float) -> np.ndarray:
    """Smith's G1 of GGX facets: the share of a direction that facets do not hide; 0 below the surface.

    Source: Walter et al. 2007, eq (34).
    """
    c = np.maximum(cosine, 0.0)
    return 2.0 * c / np.maximum(c + np.sqrt(c * c + roughness**2 * (1.0 - c) * (1.0 + c)), 1e-300)


def scatter(cosine: Cosines, roughness: float, index: float, nodes: tuple[int, int], *, inside: bool) -> Scattered:
    """Beams at the facets they see.

    Args:
        cosine: of the beams' angles, in air or in the paint, (beams,), in (0, 1].
        roughness: alpha of GGX, > 0.
        index: n of the paint.
        nodes: of the quadrature in psi and in omega.
        inside: whether the beams come from inside the paint.
    """
    m_along, m_up, share = _facets(cosine, roughness, nodes)
    c = cosine[:, None]
    met = np.clip(np.sqrt((1.0 - c) * (1.0 + c)) * m_along + c * m_up, 0.0, 1.0)
    relative = 1.0 / index if inside else index
    beyond = np.sqrt(np.maximum(1.0 - (1.0 - met) * (1.0 + met) / relative**2, 0.0))
    # Fresnel's reflectance is that from air at the cosine in air; total where there is none.
    reflectance = np.asarray(dielectric_reflectance(beyond if inside else met, index))
    reflected = 2.0 * met * m_up - c
    refracted = (c - met * m_up) / relative + beyond * m_up
    return Scattered(
        reflected,
        share * reflectance * masking(reflected, roughness),
        refracted,
        share * (1.0 - reflectance) * masking(refracted, roughness),
    )


def _facets(cosine: Cosines, roughness: float, nodes: tuple[int, int]) -> tuple[Events, Events, Events]:
    """Normals' components along the plane of incidence and upwards, and their shares of the beam."""
    u, u_weights = gauss(nodes[0])
    v, v_weights = gauss(nodes[1])
    psi = 0.5 * np.pi * u
    slope = np.arctan2(roughness * np.sqrt((1.0 - cosine) * (1.0 + cosine)), cosine)
    span = (np.pi - slope)[:, None]
    omega = slope[:, None] + span * v
    along_omega = v_weights * span * np.sin(span * v) / (1.0 + np.cos(slope))[:, None]
    share = along_omega[:, :, None] * (2.0 * u_weights * np.cos(psi) ** 2)
    along = -roughness * np.cos(psi) * np.cos(omega)[:, :, None]
    up = np.cos(psi) * np.sin(omega)[:, :, None]
    length = np.sqrt(along**2 + (roughness * np.sin(psi)) ** 2 + up**2)
    return tuple(a.reshape(len(cosine), -1) for a in (along / length, up / length, share))
