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

Vectors = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Components of directions, each (count,)."""


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


def facets(u: np.ndarray, v: np.ndarray, seen: Vectors, alpha: float, ratio: float) -> Facets:
    """What the facets that ``seen`` sees do to it, for numbers u, v in [0, 1).

    Args:
        ratio: index beyond the surface over index on this side.

    Source: Heitz, JCGT 7(4), 2018; Walter et al., EGSR 2007, equations (16), (33), (38)-(40).
    """
    x, y, z = seen
    # The hemisphere of a stretched world, seen from the stretched direction.
    sx, sy, sz = alpha * x, alpha * y, z
    norm = 1.0 / np.sqrt(sx**2 + sy**2 + sz**2)
    sx, sy, sz = sx * norm, sy * norm, sz * norm
    flat = np.sqrt(np.maximum(sx**2 + sy**2, 1e-300))
    straight = flat < 1e-9
    ax, ay = np.where(straight, 1.0, -sy / flat), np.where(straight, 0.0, sx / flat)
    bx, by, bz = -sz * ay, sz * ax, sx * ay - sy * ax
    radius, turn = np.sqrt(u), 2.0 * np.pi * v
    p, q = radius * np.cos(turn), radius * np.sin(turn)
    part = 0.5 * (1.0 + sz)
    q = (1.0 - part) * np.sqrt(np.maximum(1.0 - p**2, 0.0)) + part * q
    r = np.sqrt(np.maximum(1.0 - p**2 - q**2, 0.0))
    mx, my, mz = (
        alpha * (p * ax + q * bx + r * sx),
        alpha * (p * ay + q * by + r * sy),
        np.maximum(q * bz + r * sz, 1e-12),
    )
    norm = 1.0 / np.sqrt(mx**2 + my**2 + mz**2)
    mx, my, mz = mx * norm, my * norm, mz * norm

    cosine = np.minimum(np.maximum(x * mx + y * my + z * mz, 1e-12), 1.0)
    share, beyond = fresnel(cosine, ratio)
    reflected = 2.0 * cosine * mx - x, 2.0 * cosine * my - y, 2.0 * cosine * mz - z
    along = cosine / ratio - beyond
    refracted = along * mx - x / ratio, along * my - y / ratio, z / ratio - along * mz
    return Facets(
        reflected,
        refracted,
        share * shadowing(reflected[2], alpha),
        (1.0 - share) * shadowing(refracted[2], alpha),
    )


def lambert(rng: Generator, count: int) -> Vectors:
    """Directions as the cosine law has them."""
    squared, turn = rng.random(count), 2.0 * np.pi * rng.random(count)
    sine = np.sqrt(1.0 - squared)
    return sine * np.cos(turn), sine * np.sin(turn), np.sqrt(squared)


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
                found = facets(
                    rng.random(len(some[2])), rng.random(len(some[2])), some, self._alpha, ratio
                )
                cosines[side] = some[2]
                lost[side] = rng.random(len(some[2])) >= found.reflects + found.refracts
            self._inside = np.concatenate([self._inside, inside[lost]])
            self._cosines = np.concatenate([self._cosines, cosines[lost]])
        inside, z = self._inside[:count], self._cosines[:count]
        self._inside, self._cosines = self._inside[count:], self._cosines[count:]
        turn, sine = 2.0 * np.pi * rng.random(count), np.sqrt(1.0 - z**2)
        return inside, (sine * np.cos(turn), sine * np.sin(turn), z)


def _grid(points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers u, v for `facets` and weights: sin^2 crowds u at both ends, v is even over half a
    turn (by symmetry).
    """
    u, v = (np.arange(points) + 0.5) / points, (np.arange(points // 3) + 0.5) / (points // 3)
    first, second = np.meshgrid(np.sin(0.5 * np.pi * u) ** 2, 0.25 + 0.5 * v, indexing="ij")
    weight = np.repeat(0.5 * np.pi * np.sin(np.pi * u) / points, len(v)) / len(v)
    return first.ravel(), second.ravel(), weight


def shares(
    cosine: np.ndarray, alpha: float, ratio: float, points: int = 150
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of a direction's light that one facet reflects and refracts, by quadrature."""
    u, v, weight = _grid(points)
    ones = np.ones(u.size)
    result = np.empty((2, *np.shape(cosine)))
    for i, c in np.ndenumerate(cosine):
        found = facets(u, v, (np.sqrt(1 - c**2) * ones, 0 * ones, c * ones), alpha, ratio)
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
    turn = np.deg2rad(azimuth)
    # The source is opposite to where its light travels.
    ix, iz = -np.sqrt(1 - cos_in**2), cos_in
    sine = np.sqrt(1 - cos_out**2)
    hx, hy, hz = ix + sine * np.cos(turn), sine * np.sin(turn), iz + cos_out
    norm = np.sqrt(hx**2 + hy**2 + hz**2)
    hx, hz = hx / norm, hz / norm
    distribution = alpha**2 / (np.pi * (hz**2 * (alpha**2 - 1.0) + 1.0) ** 2)
    facet = fresnel(ix * hx + iz * hz, index)[0]
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
