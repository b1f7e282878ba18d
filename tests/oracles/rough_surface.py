"""A rough dielectric surface, facet by facet: for `position_free` to follow light through, and its
own reflection.

Facets have the GGX distribution of width alpha and the separable Smith shadowing of Walter et al.
(2007), reflecting by Fresnel's law for unpolarised light. A facet's light that shadowing takes away
comes back in a lobe without azimuth, so that nothing is lost (after Kulla and Conty 2017, for both
sides at once): with c(x) the share that direction x loses, and the measure dm = n^2 cos dω of each
side, the kernel gains c(x) c(y)/C, C = integral of c dm over both sides.

No table is needed to follow light: facets are drawn from those a direction sees (Heitz 2018), the
event is drawn with its exact chance, and a lost one draws a direction of the lobe by rejection
(`Lobe`). The integrals here are for checks and for the surface's own reflection factor.

Directions point away from the surface; the third component is positive on the side they are on.
"""

import functools
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

Vectors = np.ndarray
"""Directions by their components, (3, count)."""


class Facets(NamedTuple):
    """What facets drawn for some directions do."""

    reflected: Vectors
    refracted: Vectors  # on the other side: its third component counts from there
    reflects: np.ndarray  # chance
    refracts: np.ndarray  # chance; the rest is lost to the lobe


def fresnel(cosine: np.ndarray, ratio: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance and the cosine beyond (0 where all is reflected); ratio: index beyond over index
    here.
    """
    squared = 1.0 - (1.0 - cosine**2) / ratio**2
    beyond = np.sqrt(np.maximum(squared, 0.0))
    s = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    p = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    return np.where(squared > 0.0, 0.5 * (s**2 + p**2), 1.0), beyond


def shadowing(cosine: np.ndarray, alpha: float) -> np.ndarray:
    """Smith's G1 of GGX; 0 below the horizon."""
    c = np.maximum(cosine, 1e-12)
    return np.where(cosine > 0.0, 2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * (1.0 - c**2) / c**2)), 0.0)


def directions(cosine: np.ndarray, azimuth: float | np.ndarray) -> Vectors:
    """Directions by the cosine of their angle and their azimuth, radians."""
    sine = np.sqrt(1.0 - cosine**2)
    return np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine])


def _unit(vectors: Vectors) -> Vectors:
    return vectors / np.linalg.norm(vectors, axis=0)


def facets(chances: np.ndarray, seen: Vectors, alpha: float, ratio: float) -> Facets:
    """What the facets that ``seen`` sees do to it, for two numbers in [0, 1) of each, (2, count).

    Args:
        ratio: index beyond the surface over index on this side.

    Source: Heitz, JCGT 7(4), 2018; Walter et al., EGSR 2007, equations (16), (33), (38)-(40).
    """
    # The hemisphere of a stretched world, seen from the stretched direction.
    stretch = np.array([[alpha], [alpha], [1.0]])
    view = _unit(stretch * seen)
    flat = np.maximum(np.hypot(view[0], view[1]), 1e-150)
    level = np.array([-view[1], view[0], 0.0 * flat]) / flat
    first = np.where(flat < 1e-9, [[1.0], [0.0], [0.0]], level)
    second = np.cross(view, first, axis=0)
    radius, turn = np.sqrt(chances[0]), 2.0 * np.pi * chances[1]
    p, q = radius * np.cos(turn), radius * np.sin(turn)
    part = 0.5 * (1.0 + view[2])
    q = (1.0 - part) * np.sqrt(np.maximum(1.0 - p**2, 0.0)) + part * q
    r = np.sqrt(np.maximum(1.0 - p**2 - q**2, 0.0))
    facet = stretch * (p * first + q * second + r * view)
    facet[2] = np.maximum(facet[2], 1e-12)
    facet = _unit(facet)

    cosine = np.clip(np.sum(seen * facet, axis=0), 1e-12, 1.0)
    share, beyond = fresnel(cosine, ratio)
    reflected = 2.0 * cosine * facet - seen
    refracted = (cosine / ratio - beyond) * facet - seen / ratio
    refracted[2] *= -1.0
    return Facets(
        reflected,
        refracted,
        share * shadowing(reflected[2], alpha),
        (1.0 - share) * shadowing(refracted[2], alpha),
    )


def lambert(rng: Generator, count: int) -> Vectors:
    """Directions as the cosine law has them."""
    squared, turn = rng.random(count), 2.0 * np.pi * rng.random(count)
    return directions(np.sqrt(squared), turn)


class Lobe:
    """Directions of the lobe of lost light, of both sides, in the order in which they were found.

    A direction of the cosine law on either side, the paint's n^2 times as often, is taken if its
    own facet loses it.
    """

    def __init__(self, rng: Generator, alpha: float, index: float):
        self._rng, self._alpha, self._index = rng, alpha, index
        self._inside, self._cosines = np.empty(0, bool), np.empty(0)

    def take(self, count: int) -> tuple[np.ndarray, Vectors]:
        """Whether each is inside the paint, and the directions."""
        rng, n = self._rng, self._index
        while len(self._cosines) < count:
            tries = 40_000
            inside = rng.random(tries) < n**2 / (1.0 + n**2)
            cosines = np.empty(tries)
            lost = np.empty(tries, bool)
            for side, ratio in ((inside, 1.0 / n), (~inside, n)):
                some = lambert(rng, int(side.sum()))
                found = facets(rng.random((2, some.shape[1])), some, self._alpha, ratio)
                cosines[side] = some[2]
                lost[side] = rng.random(some.shape[1]) >= found.reflects + found.refracts
            self._inside = np.concatenate([self._inside, inside[lost]])
            self._cosines = np.concatenate([self._cosines, cosines[lost]])
        inside, z = self._inside[:count], self._cosines[:count]
        self._inside, self._cosines = self._inside[count:], self._cosines[count:]
        return inside, directions(z, 2.0 * np.pi * rng.random(count))


def _grid(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers u, v for `facets`, (2, count), and weights: sin^2 crowds u at both ends, v is even
    over half a turn (by symmetry).
    """
    u, v = (np.arange(points) + 0.5) / points, (np.arange(points // 3) + 0.5) / (points // 3)
    chances = np.meshgrid(np.sin(0.5 * np.pi * u) ** 2, 0.25 + 0.5 * v, indexing="ij")
    weight = np.repeat(0.5 * np.pi * np.sin(np.pi * u) / points, len(v)) / len(v)
    return np.reshape(chances, (2, -1)), weight


def shares(
    cosine: np.ndarray, alpha: float, ratio: float, points: int = 150
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of a direction's light that one facet reflects and refracts, by quadrature."""
    chances, weight = _grid(points)
    result = np.empty((2, *np.shape(cosine)))
    for i, c in np.ndenumerate(cosine):
        found = facets(chances, directions(np.array([c]), 0.0), alpha, ratio)
        result[(slice(None), *i)] = np.sum(weight * found.reflects), np.sum(weight * found.refracts)
    return result[0], result[1]


def loss(cosine: np.ndarray, alpha: float, ratio: float, points: int = 150) -> np.ndarray:
    """Share c of a direction's light that neither comes back nor goes through at one facet."""
    back, through = shares(cosine, alpha, ratio, points)
    return 1.0 - back - through


class Lost(NamedTuple):
    """The lobe in numbers."""

    air_total: float  # integral of c cos dω over the air's side
    total: float  # C


@functools.cache
def lost_light(alpha: float, index: float) -> Lost:
    """Integrals of c."""
    y, w = np.polynomial.legendre.leggauss(32)
    t = 0.5 * (1.0 + y)
    cosines, w = t**2, w * t  # crowded at grazing angles
    # Total reflection has an edge inside: more points.
    air, paint = loss(cosines, alpha, index, 300), loss(cosines, alpha, 1.0 / index, 500)
    air_total = float(2.0 * np.pi * np.sum(w * cosines * air))
    return Lost(air_total, air_total + float(2.0 * np.pi * index**2 * np.sum(w * cosines * paint)))


def surface_albedo(cosine: np.ndarray, alpha: float, index: float) -> np.ndarray:
    """What the surface itself reflects of a beam in air, lobe included."""
    cosine = np.asarray(cosine, float)
    if alpha == 0.0:
        return fresnel(cosine, index)[0]
    lost = lost_light(alpha, index)
    back, through = shares(cosine, alpha, index)
    return back + (1.0 - back - through) * lost.air_total / lost.total


def surface_factor(
    cos_in: np.ndarray, cos_out: np.ndarray, azimuth: np.ndarray, alpha: float, index: float
) -> np.ndarray:
    """pi times the BRDF of the surface itself, lobe included; azimuth in degrees, 0 the mirror
    side; alpha > 0.
    """
    cos_in, cos_out, azimuth = np.broadcast_arrays(
        *(np.asarray(a, float) for a in (cos_in, cos_out, azimuth))
    )
    # The source is opposite to where its light travels.
    lit = directions(cos_in, np.pi)
    half = _unit(lit + directions(cos_out, np.deg2rad(azimuth)))
    distribution = alpha**2 / (np.pi * (half[2] ** 2 * (alpha**2 - 1.0) + 1.0) ** 2)
    facet = fresnel(np.sum(lit * half, axis=0), index)[0]
    single = (
        facet
        * distribution
        * shadowing(cos_in, alpha)
        * shadowing(cos_out, alpha)
        / (4.0 * cos_in * cos_out)
    )
    lost = lost_light(alpha, index)
    c_in, c_out = (
        loss(np.unique(c), alpha, index)[np.unique(c, return_inverse=True)[1]]
        for c in (cos_in, cos_out)
    )
    lobe = c_in.reshape(cos_in.shape) * c_out.reshape(cos_in.shape) / lost.total
    return np.pi * (single + lobe)
