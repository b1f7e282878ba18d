"""Light that surfaces send each other: gathered at few points of the picture, interpolated between
them.

At a chosen point rays go out into the half space above it, more of them along the normal, as a
diffuse surface weighs light. What they meet is shaded as the picture is: lamps, mirror reflections,
and for the next bounce one more ray of that kind from every diffuse surface. Their mean is the
light that falls there, on the scale of the background: a perfect white sends on the same. It
changes slowly over a surface, and most so near others: a point lends its light to neighbours within
a share of the (harmonic mean) distance of what it sees, on the same shape and with about the same
normal.

What is followed: lamp or surroundings, then any number of diffuse and mirror reflections as the
scene says. What is
not: a lamp's own light by way of a mirror to a diffuse surface (caustics), and the glossy lobes of
Phong paint and rough metal, which show lamps only.

Source: G. J. Ward, F. M. Rubinstein, R. D. Clear, Computer Graphics 22 (1988) 85; weights that end
smoothly as in J. Křivánek and P. Gautron, Practical Global Illumination with Irradiance Caching
(2009).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..materials import Material
from .intersect import Geometry
from .rays import TILE, Lamps, Level, Reflects, trace
from .shade import radiance

# A point serves neighbours within this share of its distance to other things.
_REACH = 0.5
# That distance is taken to be at least and at most so many pixels.
_NEAREST = 8.0
_FARTHEST = 20.0
# Pixels between chosen points where none is near, round after round.
_ROUNDS = (12.0, 6.0, 3.0)
# A point with less weight than this of all its neighbours wants one of its own.
_COVERED = 0.05
_NEIGHBOURS = 12
# The light there is interpolated over a reach so much wider, which holds several of them.
_WIDER = 1.7
# Spread of neighbours, as a share of their distance squared, below which they tell no slope.
_LEVEL = 1e-3
# Mirror reflections of gathered light that could carry less are left out.
_LEAST = 0.01


@dataclass(frozen=True)
class Surroundings:
    """What gathering rays meet: the scene, with materials ready at all angles."""

    geometry: Geometry
    places: Lamps
    materials: Sequence[Material | None]
    lights: Float[Array, "lights bands"]
    background: Float[Array, "bands"]
    reflects: Reflects
    mirrors: int
    """Mirror reflections one after another."""

    def along(
        self,
        origin: Float[np.ndarray, "rays 3"],
        direction: Float[np.ndarray, "rays 3"],
        bounces: int,
        rng: np.random.Generator,
    ) -> tuple[Float[np.ndarray, "rays bands"], Float[np.ndarray, "rays"]]:
        """Spectra that come along rays after so many diffuse bounces, and how far the rays go."""
        light = []
        far = []
        for start in range(0, len(origin), TILE):
            piece = slice(start, start + TILE)
            levels = trace(
                self.geometry,
                self.places,
                origin[piece],
                direction[piece],
                reflects=self.reflects,
                bounces=self.mirrors,
                least=_LEAST,
            )
            indirect = [self._next(level, bounces, rng) for level in levels]
            light.append(
                np.asarray(radiance(levels, self.materials, self.lights, self.background, indirect))
            )
            first = levels[0]
            away = np.linalg.norm(first.place - origin[piece], axis=1)
            far.append(np.where(first.material >= 0, away, np.inf))
        return np.concatenate(light), np.concatenate(far)

    def _next(self, level: Level, bounces: int, rng: np.random.Generator) -> Array | None:
        """Light that falls on the diffuse points of a level, by one ray from each; None after the
        last bounce.
        """
        points = diffuse_points(level, self.materials)
        if bounces == 0 or points.size == 0:
            return None
        direction = above(level.normal[points], rng.random((points.size, 2)))
        light, _ = self.along(level.place[points], direction, bounces - 1, rng)
        return jnp.zeros((len(level.material), light.shape[1]), light.dtype).at[points].set(light)


def diffuse_points(level: Level, materials: Sequence[Material | None]) -> Int[np.ndarray, "points"]:
    """Numbers of the points whose material spreads light that falls from everywhere."""
    spreads = np.array([material is not None and material.is_diffuse for material in materials])
    return np.flatnonzero((level.material >= 0) & spreads[level.material])


def above(
    normal: Float[np.ndarray, "points 3"], sample: Float[np.ndarray, "points 2"]
) -> Float[np.ndarray, "points 3"]:
    """Unit directions above surfaces, as often as a diffuse surface weighs them, from numbers in
    [0, 1).
    """
    around = 2.0 * np.pi * sample[:, 0]
    sine = np.sqrt(sample[:, 1])
    first, second = _across(normal)
    across = np.cos(around)[:, None] * first + np.sin(around)[:, None] * second
    return sine[:, None] * across + np.sqrt(1.0 - sample[:, 1])[:, None] * normal


def _across(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Any two unit vectors across a normal: T. Duff et al., Journal of Computer Graphics Techniques
    6 (2017) 1.
    """
    x, y, z = normal.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1), np.stack(
        [b, sign + y * y * a, -y], axis=1
    )


def _linear(
    weight: Float[np.ndarray, "p k"], shift: Float[np.ndarray, "p k 2"]
) -> Float[np.ndarray, "p k"]:
    """Weights that take the value here from a plane through the neighbours', by least squares; they
    add up to one.

    Where neighbours lie in a row, or are too few, the plane is level across; without weight the
    nearest counts alone.
    """
    total = weight.sum(axis=1, keepdims=True)
    alone = total[:, 0] <= 0
    weight = np.where(
        alone[:, None], np.eye(1, weight.shape[1]), weight / np.where(total > 0, total, 1.0)
    )
    middle = np.einsum("pk,pks->ps", weight, shift)
    centred = shift - middle[:, None]
    spread = np.einsum("pk,pks,pkt->pst", weight, centred, centred) + _LEVEL * np.eye(2)
    slope = np.linalg.solve(spread, -middle[..., None])
    return weight * (1.0 + (centred @ slope)[..., 0])


@dataclass
class Gathered:
    """Points at which light was gathered, and what falls on any other point.

    Args:
        around: the scene.
        bounces: diffuse bounces, at least one.
        rays: from each point.
        eye: position of the camera.
        pixel: angle of a pixel, radians.
    """

    around: Surroundings
    bounces: int
    rays: int
    eye: Float[np.ndarray, "3"]
    pixel: float
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def __post_init__(self) -> None:
        bands = self.around.lights.shape[1]
        self._place = np.zeros((0, 3))
        self._normal = np.zeros((0, 3))
        self._shape = np.zeros(0, int)
        self._radius = np.zeros(0)
        self._light = np.zeros((0, bands))
        self._trees: dict[int, tuple] = {}
        # Points of a set that fills the square evenly; turned for each point of the picture.
        index = np.arange(self.rays)
        self._even = np.stack([(index + 0.5) / self.rays, _radical_inverse(index)], axis=1)

    @property
    def count(self) -> int:
        """Points so far."""
        return len(self._light)

    def add(self, levels: Sequence[Level]) -> None:
        """Gather where these points of the picture need it."""
        for cell in _ROUNDS:
            for level in levels:
                points = diffuse_points(level, self.around.materials)
                weight = self._weigh(level, points, _REACH)[0].sum(axis=1)
                missing = points[weight < _COVERED]
                if missing.size:
                    self._gather(level, self._one_a_cell(level, missing, cell))

    def falling(self, level: Level) -> Array | None:
        """Light that falls on the points of a level, (points, bands); None where nothing is
        diffuse.
        """
        points = diffuse_points(level, self.around.materials)
        if points.size == 0 or self.count == 0:
            return None
        weight, which, shift = self._weigh(level, points, _WIDER * _REACH)
        weight = _linear(weight, shift)
        near = self._light[which]
        light = np.einsum("pk,pkb->pb", weight, near)
        # A plane through the points around may reach beyond them at the edge of a surface.
        light = np.clip(light, near.min(axis=1), near.max(axis=1))
        return (
            jnp.zeros((len(level.material), light.shape[1]), self.around.lights.dtype)
            .at[points]
            .set(light)
        )

    def _footprint(self, place: np.ndarray) -> np.ndarray:
        """Width of a pixel there."""
        return np.maximum(np.linalg.norm(place - self.eye, axis=1) * self.pixel, 1e-300)

    def _one_a_cell(self, level: Level, points: np.ndarray, cell: float) -> np.ndarray:
        """One point of each cell of so many pixels, of each shape and side."""
        place = level.place[points]
        scale = np.round(np.log2(cell * self._footprint(place)))
        where = np.floor(place / 2.0 ** scale[:, None])
        side = np.round(level.normal[points])
        keys = np.column_stack([level.shape[points], scale, where, side])
        return points[np.unique(keys, axis=0, return_index=True)[1]]

    def _gather(self, level: Level, points: np.ndarray) -> None:
        """Send rays from these points, and keep what they bring."""
        for start in range(0, points.size, max(1, TILE // self.rays)):
            batch = points[start : start + max(1, TILE // self.rays)]
            place = level.place[batch]
            normal = level.normal[batch]
            turned = (self._even + self.rng.random((batch.size, 1, 2))) % 1.0
            direction = above(np.repeat(normal, self.rays, axis=0), turned.reshape(-1, 2))
            origin = np.repeat(place, self.rays, axis=0)
            light, far = self.around.along(origin, direction, self.bounces - 1, self.rng)
            nearness = np.mean(1.0 / np.maximum(far.reshape(batch.size, -1), 1e-12), axis=1)
            pixel = self._footprint(place)
            radius = np.clip(
                1.0 / np.maximum(nearness, 1e-300), _NEAREST * pixel, _FARTHEST * pixel
            )
            self._place, self._normal = (
                np.concatenate([self._place, place]),
                np.concatenate([self._normal, normal]),
            )
            self._shape = np.concatenate([self._shape, level.shape[batch]])
            self._radius = np.concatenate([self._radius, radius])
            self._light = np.concatenate(
                [self._light, light.reshape(batch.size, self.rays, -1).mean(axis=1)]
            )
        self._trees.clear()

    def _weigh(
        self, level: Level, points: np.ndarray, reach: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The chosen points near each point: weights, numbers, (points, neighbours), and how far
        they lie on each side.

        The distances (points, neighbours, 2) are along the surface, in units of that of the
        farthest neighbour.
        """
        weight = np.zeros((points.size, _NEIGHBOURS))
        which = np.zeros((points.size, _NEIGHBOURS), int)
        shift = np.zeros((points.size, _NEIGHBOURS, 2))
        for shape in np.unique(level.shape[points]):
            mine = np.flatnonzero(level.shape[points] == shape)
            place = level.place[points[mine]]
            normal = level.normal[points[mine]]
            tree, numbers = self._tree(int(shape))
            if numbers.size == 0:
                continue
            count = min(_NEIGHBOURS, numbers.size)
            distance, near = (np.reshape(a, (mine.size, count)) for a in tree.query(place, k=count))
            near = numbers[near]
            turn = np.sum(self._normal[near] * normal[:, None], axis=-1)
            error = distance / self._radius[near] + np.sqrt(np.maximum(1.0 - turn, 0.0))
            weight[mine, :count] = np.maximum(1.0 - error / reach, 0.0) ** 2
            which[mine] = near[:, :1]
            which[mine, :count] = near
            sides = np.stack(_across(normal), axis=1)
            offset = np.einsum("pkx,psx->pks", self._place[near] - place[:, None], sides)
            shift[mine, :count] = offset / np.maximum(distance[:, -1:, None], 1e-300)
        return weight, which, shift

    def _tree(self, shape: int) -> tuple:
        """Places of the chosen points of a shape, to be searched, and their numbers."""
        if shape not in self._trees:
            from scipy.spatial import KDTree

            numbers = np.flatnonzero(self._shape == shape)
            self._trees[shape] = (KDTree(self._place[numbers]) if numbers.size else None, numbers)
        return self._trees[shape]


def _radical_inverse(index: Int[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Numbers with their binary digits mirrored at the point (van der Corput)."""
    out = np.zeros(len(index))
    scale = 0.5
    rest = index.copy()
    while np.any(rest):
        out += scale * (rest & 1)
        rest = rest >> 1
        scale = scale / 2
    return out
