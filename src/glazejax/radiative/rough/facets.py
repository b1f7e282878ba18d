r"""Reflection and refraction of a beam by single facets of a rough surface, by quadrature over the
facets that it sees.

GGX facets of roughness a, with Smith's separable masking (B. Walter, S. Marschner, H. Li, K.
Torrance, EGSR 2007). Seen from a direction i, facets are distributed as the normals of an ellipsoid
that is stretched to a hemisphere (E. Heitz, JCGT 7(4), 2018). On that hemisphere, with the pole
across the plane of incidence,

    m = (-a cos psi cos omega, a sin psi, cos psi sin omega) / its length,

psi in [-pi/2, pi/2], omega in [theta, pi], where tan theta = a tan theta_i: each m of this lune is
seen, with the weight cos^2 psi sin(omega - theta) dpsi domega. A facet reflects F(i.m) and lets 1 -
F through; of that G1 of the new direction is not caught by other facets.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ..common.fresnel import cos_refracted, dielectric_reflectance
from ..common.quadrature import gauss_crowded_at_ends

Cosines = Float[np.ndarray, "beams"]
Events = Float[np.ndarray, "beams facets"]


class Scattered(NamedTuple):
    """Beams scattered at single facets: cosines and shares of its flux, (beams, facets).

    A direction on the wrong side of the surface has a share of zero, and a cosine below it.
    """

    reflected: Events
    reflected_share: Events
    refracted: Events
    refracted_share: Events

    def loss(self) -> Cosines:
        """Share of each beam that single facets neither reflect nor let through, (beams,)."""
        return 1.0 - self.reflected_share.sum(axis=1) - self.refracted_share.sum(axis=1)


def masking(cosine: np.ndarray, roughness: float) -> np.ndarray:
    """Smith's G1 of GGX facets: the share of a direction that facets do not hide; 0 below the
    surface.

    Source: Walter et al. 2007, eq (34).
    """
    c = np.maximum(cosine, 0.0)
    return 2.0 * c / np.maximum(c + np.sqrt(c * c + roughness**2 * (1.0 - c) * (1.0 + c)), 1e-300)


def scatter(
    cosine: Cosines, roughness: float, index: float, nodes: tuple[int, int], *, from_paint: bool
) -> Scattered:
    """Beams at the facets they see.

    Args:
        cosine: of the beams' angles, in air or in the paint, (beams,), in (0, 1].
        roughness: alpha of GGX, > 0.
        index: n of the paint.
        nodes: of the quadrature in psi and in omega, on each piece between bends.
        from_paint: whether the beams come from inside the paint.
    """
    critical = float(cos_refracted(0.0, index)) if from_paint else None
    m_along, m_up, share = visible_facets(cosine, roughness, nodes, critical)
    c = cosine[:, None]
    # i.m, the cosine at which the beam meets a facet.
    met = np.clip(np.sqrt((1.0 - c) * (1.0 + c)) * m_along + c * m_up, 0.0, 1.0)
    # Snell's law at the facet; 0 where it reflects all.
    relative = 1.0 / index if from_paint else index
    beyond = np.sqrt(np.maximum(1.0 - (1.0 - met) * (1.0 + met) / relative**2, 0.0))
    # Fresnel's reflectance is that from air at the cosine in air; total where there is none.
    reflectance = dielectric_reflectance(beyond if from_paint else met, index)
    # Cosines to the mean surface of 2 (i.m) m - i and of the refracted direction.
    reflected = 2.0 * met * m_up - c
    refracted = (c - met * m_up) / relative + beyond * m_up
    return Scattered(
        reflected,
        share * reflectance * masking(reflected, roughness),
        refracted,
        share * (1.0 - reflectance) * masking(refracted, roughness),
    )


def visible_facets(
    cosine: Cosines, roughness: float, nodes: tuple[int, int], critical: float | None
) -> tuple[Events, Events, Events]:
    """Normals' components along the plane of incidence and upwards, and their shares of the beam.

    The integrands bend where what is reflected meets the horizon, and from inside where reflection
    becomes total, at i.m = ``critical``. Both are lines P cos(2 omega) + Q sin(2 omega) = T +
    U/cos^2 psi, at which the rule is divided.
    """
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    a2 = roughness**2
    rise = 1.0 - roughness**2
    # The beam as it meets the hemisphere that facets become when stretched.
    slope = np.arctan2(roughness * sine, cosine)
    # The horizon, 2 (i.m) m_z = c; then the critical angle, (i.m)^2 = critical^2.
    lines = [
        (0.5 * cosine * rise - cosine, -roughness * sine, 0.5 * cosine * rise - cosine, cosine * a2)
    ]
    if critical is not None:
        k2 = critical**2
        least = a2 * sine**2 + cosine**2
        straight = k2 * rise - (cosine**2 - a2 * sine**2)
        lines.append(
            (
                straight,
                -2.0 * roughness * cosine * sine,
                k2 * rise - least,
                2.0 * k2 * a2 + 0.0 * cosine,
            )
        )
    # Rules in both angles, divided where a line crosses.
    psi, psi_weights = _divided_rule(
        [_last_psi(*line) for line in lines], 0.0 * cosine, 0.5 * np.pi, nodes[0]
    )
    breaks = [
        edge
        for line in lines
        for edge in _crossings(psi, slope[:, None], *(x[:, None] for x in line))
    ]
    omega, omega_weights = _divided_rule(breaks, slope[:, None] + 0.0 * psi, np.pi, nodes[1])
    # The share of the beam that meets each facet.
    share = (
        omega_weights * np.sin(omega - slope[:, None, None]) / (1.0 + np.cos(slope))[:, None, None]
    )
    share *= (psi_weights * np.cos(psi) ** 2 * 4.0 / np.pi)[..., None]
    # Normals, shrunk back and of unit length.
    along = -roughness * np.cos(psi)[..., None] * np.cos(omega)
    up = np.cos(psi)[..., None] * np.sin(omega)
    length = np.sqrt(along**2 + (roughness * np.sin(psi)[..., None]) ** 2 + up**2)
    flat = len(cosine), -1
    return (along / length).reshape(flat), (up / length).reshape(flat), share.reshape(flat)


def _last_psi(p: np.ndarray, q: np.ndarray, t: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Point where a line turns back: beyond this psi there is none."""
    square = u / np.maximum(np.hypot(p, q) - t, 1e-300)
    return np.arccos(np.sqrt(np.clip(square, 0.0, 1.0)))


def _crossings(
    psi: np.ndarray, least: np.ndarray, p: Any, q: Any, t: Any, u: Any
) -> list[np.ndarray]:
    """Both omega of a line at each psi; the least one where there is none."""
    # P cos(2 omega) + Q sin(2 omega) is size times cos(2 omega - middle).
    size = np.maximum(np.hypot(p, q), 1e-300)
    height = (t + u / np.maximum(np.cos(psi) ** 2, 1e-300)) / size
    turn = np.arccos(np.clip(height, -1.0, 1.0))
    middle = np.arctan2(q, p)
    crossings = [np.mod(0.5 * (middle + sign * turn), np.pi) for sign in (-1.0, 1.0)]
    return [np.where(np.abs(height) < 1.0, np.maximum(omega, least), least) for omega in crossings]


def _divided_rule(
    breaks: list[np.ndarray], low: np.ndarray, high: float, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on a last axis from low to high, divided at breaks; crowded at each end,
    where roots begin.
    """
    edges = np.sort(np.stack([low, *breaks, np.full_like(low, high)], axis=-1), axis=-1)
    x, weights = gauss_crowded_at_ends(count)
    width = np.diff(edges, axis=-1)[..., None]
    shape = (*low.shape, -1)
    return (edges[..., :-1, None] + width * x).reshape(shape), (width * weights).reshape(shape)
