"""Position-free Monte Carlo of layers under a smooth or rough surface, after Guo, Hašan and Zhao
(2018): an oracle.

Layers have no sides, so a path is a list of depths and directions. It enters through the surface,
flies between scatterings, passes or is mirrored by smooth surfaces between layers of different
index, is thrown back by a Lambertian ground, and leaves. Each estimate is unbiased. Absorption is a
weight for each band, exp(-k t) along the path; paths are drawn by scattering alone, so that all
bands of a stack share them.

    albedo    paths that leave are counted (analog)
    BRDF      at each scattering and ground reflection the light that goes straight to one of the
              views, drawn anew each time, is added: through a smooth surface along the view's own
              beams, with all their mirror images between layers; through a rough one along a facet
              or lobe direction drawn from the view ("next event through the surface")

The surface's own reflection is not in it (`rough_surface.surface_factor` has it). Nothing is shared
with glazejax. Azimuth is that of glazejax: degrees between the horizontal directions of travel, 0
the mirror side.

Source: Guo, Hašan, Zhao, ACM Trans. Graph. 37(6), 2018, sections 4 and 5 (without their multiple
importance sampling: nothing here but the surface is peaked).
"""

from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from .rough_surface import Lobe, Vectors, directions, facets, fresnel, lambert


class Stack(NamedTuple):
    """Layers top first, on a Lambertian ground."""

    scattering: np.ndarray  # (layers,), s times thickness
    absorption: np.ndarray  # (layers, bands), k times thickness
    g: np.ndarray  # (layers,), Henyey and Greenstein's mean cosine
    refractive_index: np.ndarray  # (layers,)
    ground: float
    roughness: float  # alpha of GGX, of the outer surface


class Views(NamedTuple):
    """Directions of the eye in air, (views,)."""

    cosine: np.ndarray
    azimuth: np.ndarray  # degrees


class Tally(NamedTuple):
    """Sums over paths, to be added up over runs."""

    paths: int
    total: np.ndarray
    squares: np.ndarray

    def plus(self, other: "Tally") -> "Tally":
        """Both together."""
        return Tally(
            self.paths + other.paths, self.total + other.total, self.squares + other.squares
        )

    @property
    def mean(self) -> np.ndarray:
        """The estimate."""
        return self.total / self.paths

    @property
    def error(self) -> np.ndarray:
        """Its standard error."""
        return np.sqrt(np.maximum(self.squares / self.paths - self.mean**2, 0.0) / (self.paths - 1))


def albedo(stack: Stack, cos_incidence: float, paths: int, rng: Generator) -> Tally:
    """Flux that leaves over flux of a beam, (bands,), by counting paths."""
    return _walk(stack, cos_incidence, None, paths, rng)


def reflectance_factor(
    stack: Stack, cos_incidence: float, views: Views, paths: int, rng: Generator
) -> Tally:
    """pi L/E, (views, bands), by next events."""
    return _walk(stack, cos_incidence, views, paths, rng)


def _walk(
    stack: Stack, cos_incidence: float, views: Views | None, paths: int, rng: Generator
) -> Tally:
    s, k, n = stack.scattering, stack.absorption, stack.refractive_index
    layers, bands = k.shape
    if stack.roughness and np.ptp(n):
        raise ValueError("a rough surface over layers of different index is not followed here")
    surface = _Surface(rng, stack.roughness, float(n[0]))
    eye = (
        None
        if views is None
        else (_RoughEye if stack.roughness else _SmoothEye)(stack, views, surface)
    )
    score = np.zeros((paths, bands) if views is None else (paths, len(views.cosine), bands))

    direction, weight = surface.enter(cos_incidence, paths)
    index = np.flatnonzero(weight > 0)
    direction = direction[:, index]
    weight = np.repeat(weight[index, None], bands, axis=1)
    layer, depth = (
        np.zeros(len(index), int),
        np.zeros(len(index)),
    )  # depth: share of the layer above
    while index.size:
        z = direction[2]  # positive downwards
        with np.errstate(divide="ignore"):
            free = rng.exponential(size=index.size) / s[layer]
        room = np.where(z > 0, 1.0 - depth, depth) / np.maximum(np.abs(z), 1e-300)
        scatters = free < room
        way = np.where(scatters, free, room)
        weight = weight * np.exp(-k[layer] * way[:, None])
        depth = np.where(scatters, np.clip(depth + z * way, 0.0, 1.0), np.where(z > 0, 1.0, 0.0))
        alive = np.ones(index.size, bool)

        hit = np.flatnonzero(scatters)
        if hit.size:
            old = direction[:, hit]
            if eye is not None:
                view = rng.integers(len(eye.cosine), size=hit.size)
                score[index[hit], view] += eye.scattered(
                    view, layer[hit], depth[hit], old, weight[hit]
                )
            direction[:, hit] = new_directions(rng, old, stack.g[layer[hit]])

        down = ~scatters & (z > 0)
        at_bottom, at_top = down & (layer == layers - 1), ~scatters & ~down & (layer == 0)
        bottom, top = np.flatnonzero(at_bottom), np.flatnonzero(at_top)
        inner = np.flatnonzero(~(scatters | at_bottom | at_top))
        if bottom.size:
            weight[bottom] *= stack.ground
            if eye is not None:
                view = rng.integers(len(eye.cosine), size=bottom.size)
                score[index[bottom], view] += eye.thrown_back(view, weight[bottom])
            direction[:, bottom] = lambert(rng, bottom.size)
            z[bottom] *= -1.0

        if top.size:
            z[top] *= -1.0
            left, direction[:, top] = surface.under(direction[:, top])
            alive[top] = ~left
            if views is None:
                score[index[top[left]]] += weight[top[left]]

        if inner.size:
            step = np.where(down[inner], 1, -1)
            ratio = n[layer[inner] + step] / n[layer[inner]]
            share, beyond = fresnel(np.abs(z[inner]), ratio)
            crosses = rng.random(inner.size) >= np.where(ratio == 1.0, 0.0, share)
            z[inner] = np.where(crosses, step * beyond, -z[inner])
            through = inner[crosses]
            direction[:2, through] /= ratio[crosses]
            layer[through] += step[crosses]
            depth[through] = 1.0 - down[through]

        # Weak paths end by chance, the others carry on for them.
        largest = weight.max(axis=1)
        weak = largest < 0.1
        survives = rng.random(index.size) < 0.3
        weight[weak] /= 0.3
        alive &= (~weak | survives) & (largest > 0)
        direction = direction[:, alive]
        weight, layer, depth, index = (a[alive] for a in (weight, layer, depth, index))
    return Tally(paths, score.sum(axis=0), (score**2).sum(axis=0))


class _Surface(Lobe):
    """The outer surface, through which light enters and leaves."""

    def enter(self, cos_incidence: float, paths: int) -> tuple[Vectors, np.ndarray]:
        """Directions of travel below the surface, downwards, and weights."""
        # Light travels towards +x, so it comes from -x.
        back = directions(np.full(paths, cos_incidence), np.pi)
        if self._alpha:
            return self.through_rough(back)
        share, cosine = fresnel(back[2], self._index)
        return np.array([*-back[:2] / self._index, cosine]), 1.0 - share

    def through_rough(self, seen: Vectors) -> tuple[Vectors, np.ndarray]:
        """Directions below the surface, third component downwards, that light from ``seen`` in air
        takes, and weights.

        A facet's refraction and the lobe, drawn in proportion; lobe directions that stay in the air
        get no weight.
        """
        count = seen.shape[1]
        found = facets(self._rng.random((2, count)), seen, self._alpha, self._index)
        lost = 1.0 - found.reflects - found.refracts
        weight = lost + found.refracts
        drawn = self._rng.random(count) * weight < lost
        inside, found.refracted[:, drawn] = self.take(int(drawn.sum()))
        weight[drawn] *= inside
        return found.refracted, weight

    def under(self, seen: Vectors) -> tuple[np.ndarray, Vectors]:
        """Which of the paths that meet the surface from below leave; directions of the others,
        downwards.

        Args:
            seen: directions of travel, third component upwards.
        """
        count = seen.shape[1]
        chance = self._rng.random(count)
        if not self._alpha:
            share, _ = fresnel(seen[2], 1.0 / self._index)
            return chance >= share, seen
        # From the surface one looks back along the path: both horizontal components and the height
        # change sign, and the side below is the one the direction is on.
        back = seen * [[-1.0], [-1.0], [1.0]]
        found = facets(self._rng.random((2, count)), back, self._alpha, 1.0 / self._index)
        left, drawn = chance >= found.reflects, chance >= found.reflects + found.refracts
        inside, found.reflected[:, drawn] = self.take(int(drawn.sum()))
        left[drawn] = ~inside
        return left, found.reflected


class _SmoothEye:
    """Beams from the eye, refracted and mirrored by all smooth surfaces, as an importance of each
    depth.
    """

    def __init__(self, stack: Stack, views: Views, surface: _Surface):
        n, extinction = stack.refractive_index, stack.scattering[:, None] + stack.absorption
        layers, bands = extinction.shape
        self.cosine = views.cosine
        # (views, layers)
        self._cosine = np.sqrt(1.0 - (1.0 - views.cosine[:, None] ** 2) / n**2)
        # n sin is kept through all layers.
        self._across = directions(views.cosine, np.deg2rad(views.azimuth))[:2]
        self._stack, self._extinction = stack, extinction
        count = len(views.cosine)
        # Unknown: flux of each beam where it starts in its layer, down at the top, up at the
        #     bottom.
        down, up = np.zeros((count, layers, bands)), np.zeros((count, layers, bands))
        for v in range(count):
            first = 1.0 - fresnel(views.cosine[v], n[0])[0]
            ratio = n[1:] / n[:-1]
            r = np.where(ratio == 1.0, 0.0, fresnel(self._cosine[v, :-1], ratio)[0])
            for b in range(bands):
                a = np.exp(-extinction[:, b] / self._cosine[v])
                matrix, source = np.eye(2 * layers), np.zeros(2 * layers)
                source[0] = first
                matrix[0, layers] -= (1.0 - first) * a[0]  # inside, Fresnel's share is the same
                for i in range(layers - 1):
                    matrix[i + 1, i] -= (1.0 - r[i]) * a[i]
                    matrix[i + 1, layers + i + 1] -= r[i] * a[i + 1]
                    matrix[layers + i, i] -= r[i] * a[i]
                    matrix[layers + i, layers + i + 1] -= (1.0 - r[i]) * a[i + 1]
                solved = np.linalg.solve(matrix, source)
                down[v, :, b], up[v, :, b] = solved[:layers], solved[layers:]
        self._down, self._up = down, up
        self._ground = down[:, -1] * np.exp(-extinction[-1] / self._cosine[:, -1:]) / n[-1] ** 2

    def scattered(
        self,
        view: np.ndarray,
        layer: np.ndarray,
        depth: np.ndarray,
        direction: Vectors,
        weight: np.ndarray,
    ) -> np.ndarray:
        """Light that goes straight to each path's view from where it scatters, (paths, bands),
        times all views.
        """
        n, g = self._stack.refractive_index[layer], self._stack.g[layer]
        cosine, extinction = self._cosine[view, layer], self._extinction[layer]
        flat = np.sum(direction[:2] * self._across[:, view], axis=0) / n
        result = np.zeros_like(weight)
        for importance, away, sign in ((self._down, depth, -1.0), (self._up, 1.0 - depth, 1.0)):
            if importance.any():
                toward = _phase(flat + sign * direction[2] * cosine, g)
                reach = importance[view, layer] * np.exp(-extinction * (away / cosine)[:, None])
                result += toward[:, None] * reach
        return result * weight * (len(self.cosine) / (4.0 * cosine * n**2))[:, None]

    def thrown_back(self, view: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """The same from the ground, for weights after it."""
        return weight * self._ground[view] * len(self.cosine)


class _RoughEye:
    """Directions drawn from the eye through the surface anew at each event."""

    def __init__(self, stack: Stack, views: Views, surface: _Surface):
        self.cosine = views.cosine
        self._views = directions(views.cosine, np.deg2rad(views.azimuth))
        self._stack, self._surface = stack, surface
        self._extinction = stack.scattering[:, None] + stack.absorption
        self._above = np.concatenate(
            [np.zeros((1, self._extinction.shape[1])), np.cumsum(self._extinction, axis=0)]
        )

    def _drawn(self, view: np.ndarray) -> tuple[Vectors, np.ndarray]:
        """Directions below the surface as if light came from the view, third component downwards,
        and weights, times all views.
        """
        back, weight = self._surface.through_rough(self._views[:, view])
        back[2] = np.maximum(back[2], 1e-12)
        return back, weight * len(self.cosine) / self._stack.refractive_index[0] ** 2

    def scattered(
        self,
        view: np.ndarray,
        layer: np.ndarray,
        depth: np.ndarray,
        direction: Vectors,
        weight: np.ndarray,
    ) -> np.ndarray:
        """As `_SmoothEye.scattered`."""
        back, reach = self._drawn(view)
        # What goes down from the eye comes up to it.
        turned = _phase(-np.sum(direction * back, axis=0), self._stack.g[layer])
        reach = reach * turned / (4.0 * back[2])
        above = self._above[layer] + self._extinction[layer] * depth[:, None]
        return weight * reach[:, None] * np.exp(-above / back[2][:, None])

    def thrown_back(self, view: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """As `_SmoothEye.thrown_back`."""
        back, reach = self._drawn(view)
        return weight * reach[:, None] * np.exp(-self._above[-1] / back[2][:, None])


def _phase(cosine: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Henyey and Greenstein's function, mean 1."""
    if not g.any():
        return np.ones(cosine.shape)
    return (1.0 - g**2) / (1.0 + g**2 - 2.0 * g * cosine) ** 1.5


def new_directions(rng: Generator, old: Vectors, g: np.ndarray) -> Vectors:
    """Directions after scattering by Henyey and Greenstein's law."""
    u, turn = rng.random(len(g)), 2.0 * np.pi * rng.random(len(g))
    even = np.abs(g) < 1e-6
    if even.all():
        return directions(2.0 * u - 1.0, turn)
    safe = np.where(even, 1.0, g)
    ratio = (1.0 - safe**2) / (1.0 - safe + 2.0 * safe * u)
    cosine = np.clip(
        np.where(even, 2.0 * u - 1.0, (1.0 + safe**2 - ratio**2) / (2.0 * safe)), -1.0, 1.0
    )
    c, d, _ = directions(cosine, turn)
    x, y, z = old
    # Two directions across the old one (Duff et al. 2017), built so that nothing divides by zero.
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.array([1.0 + sign * x**2 * a, sign * b, -sign * x])
    second = np.array([b, sign + y**2 * a, -y])
    return c * first + d * second + cosine * old
