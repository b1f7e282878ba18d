r"""The layer rules of renderers: what a coat over a base looks like without following light through
the layers.

Each rule gets what a careful artist could give it: the base's true reflectance b under even light
without a surface, the coat's transmittance t at normal incidence (absorption only: none of these
coats scatters), its index n, and the surface's own exact reflection and albedo E(mu), compensated
for what a rough surface's facets lose. Left to the rule is the body: what comes from below the
surface. With C = t^2, the coat's colour, and mu' the cosine refracted into it, pi f of the body for
light from i, seen from o:

    scaling     (1 - E(o)) C b                                            not reciprocal; Autodesk Standard Surface
    reciprocal  (1 - E(i)) (1 - E(o)) / (1 - <E>) C b                     Kelemen and Szirmay-Kalos 2001
    OpenPBR     (1 - E(o)) t^(1/mu'_i + 1/mu'_o) b (1 - K)/(1 - b K)      OpenPBR 1.1, 'Darkening' (K of a
                                                                          rough base) and
                                                                          'View-dependent absorption'
    Belcour     (1 - E(o)) t^(1/mu'_o) b t' (1 - K)/(1 - b K t'^2)        adding of Belcour 2018, t' = t^(3/2)

<E> is the mean of E over even light, K = 1 - (1 - <E>)/n^2 the surface's reflectance for even light
from below. (In the darkening's denominator the reference viewer of OpenPBR has b K C, the
specification b K.) The last rule is our reading: Belcour's operators carry energy, mean direction
and variance of lobes that stay narrow. A diffuse base has no such lobe, so only his adding of
energies is left: the coat's reflectance seen from below and its transmittance, averaged over the
base's even light, whose mean cosine 2/3 is its direction in the coat. What leaves is taken as a
Lambertian lobe. Scattering inside a coat is forward in his medium and turns no light back: it does
not change energies.

The albedo is that seen from o under even light (a white furnace); by reciprocity the truth's is
that of a beam.
"""

from typing import Literal, NamedTuple

import numpy as np

Rule = Literal["scaling", "reciprocal", "openpbr", "belcour"]
RULES: tuple[Rule, ...] = ("scaling", "reciprocal", "openpbr", "belcour")
TITLES = {
    "scaling": "albedo scaling",
    "reciprocal": "reciprocal scaling",
    "openpbr": "OpenPBR coat",
    "belcour": "Belcour's adding",
}


class Coat(NamedTuple):
    """What a rule knows."""

    base: np.ndarray  # b, (bands,)
    transmittance: np.ndarray  # t, (bands,)
    refractive_index: float
    even: float  # <E>


def even_light(albedo: np.ndarray, cosines: np.ndarray, weights: np.ndarray) -> float:
    """<E> of E at the cosines of a quadrature over [0, 1]."""
    return float(2.0 * np.sum(weights * cosines * albedo))


def internal(coat: Coat) -> float:
    """K: what the surface sends back of even light from below; exact by reciprocity."""
    return 1.0 - (1.0 - coat.even) / coat.refractive_index**2


def factor(
    rule: Rule, coat: Coat, lit: tuple[np.ndarray, np.ndarray], seen: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    """pi f of the body, (incidences, views, bands).

    Args:
        lit, seen: cosines in air and E at them.
    """
    (cos_in, albedo_in), (cos_out, albedo_out) = lit, seen
    out = (1.0 - albedo_out)[None, :, None]
    into = (1.0 - albedo_in)[:, None, None]
    if rule == "scaling":
        found = out * coat.transmittance**2 * coat.base
    elif rule == "reciprocal":
        found = into * out / (1.0 - coat.even) * coat.transmittance**2 * coat.base
    elif rule == "openpbr":
        way = (1.0 / _refracted(cos_in, coat))[:, None] + (1.0 / _refracted(cos_out, coat))
        k = internal(coat)
        found = (
            out
            * coat.transmittance ** way[:, :, None]
            * coat.base
            * (1.0 - k)
            / (1.0 - coat.base * k)
        )
    else:
        found = _belcour(coat, seen)[None]
    return np.broadcast_to(found, (len(cos_in), len(cos_out), len(coat.base)))


def albedo(rule: Rule, coat: Coat, seen: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Body under even light, (views, bands)."""
    cosines, albedos = seen
    out = (1.0 - albedos)[:, None]
    if rule in ("scaling", "reciprocal"):
        return out * coat.transmittance**2 * coat.base
    if rule == "belcour":
        return _belcour(coat, seen)
    y, w = np.polynomial.legendre.leggauss(64)
    mu = 0.5 * (1.0 + y)
    entering = np.sum(
        (w * mu)[:, None] * coat.transmittance ** (1.0 / _refracted(mu, coat))[:, None], axis=0
    )
    k = internal(coat)
    leaving = coat.transmittance ** (1.0 / _refracted(cosines, coat))[:, None]
    return out * leaving * entering * coat.base * (1.0 - k) / (1.0 - coat.base * k)


def _belcour(coat: Coat, seen: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    cosines, albedos = seen
    k, even = internal(coat), coat.transmittance**1.5
    way = coat.transmittance ** (1.0 / _refracted(cosines, coat))[:, None]
    return (
        (1.0 - albedos)[:, None]
        * way
        * coat.base
        * even
        * (1.0 - k)
        / (1.0 - coat.base * k * even**2)
    )


def _refracted(cosine: np.ndarray, coat: Coat) -> np.ndarray:
    return np.sqrt(1.0 - (1.0 - cosine**2) / coat.refractive_index**2)
