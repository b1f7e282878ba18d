"""Light followed path by path through free-standing layers of different index under smooth surfaces:
the fluxes on both sides, where `position_free` has a ground. Slow, and nothing of glazejax is in it.

Paths start as a collimated beam and carry a weight. In each layer they fly an exponential length;
at a collision the weight loses the absorbed share and the direction turns by Henyey and
Greenstein's law. Surfaces reflect or let through by Fresnel's law, by chance.
"""

from typing import NamedTuple

import numpy as np

from .position_free import new_directions
from .rough_surface import fresnel


class Indexed(NamedTuple):
    """Free-standing layers top first, each of its own refractive index, air above and another
    medium below.
    """

    albedo: np.ndarray
    optical_thickness: np.ndarray
    g: np.ndarray
    refractive_index: np.ndarray
    below: float


def simulate_fluxes(
    paint: Indexed, cos_incidence: float, paths: int, seed: int = 0, exits: list | None = None
) -> np.ndarray:
    """Shares of a beam's flux that come back and that go through, with standard errors, (2, 2).

    What the outer surface reflects at once is not in it. To ``exits`` each step's paths that come
    back are added: weights and directions in the air.
    """
    rng = np.random.default_rng(seed)
    n = np.concatenate([[1.0], paint.refractive_index, [paint.below]])
    last = len(paint.albedo)
    first, enter = fresnel(np.array([cos_incidence]), n[1] / n[0])
    direction = np.tile([np.sqrt(1.0 - enter[0] ** 2), 0.0, enter[0]], (paths, 1))
    medium, depth = (
        np.ones(paths, int),
        np.zeros(paths),
    )  # optical depth below the layer's upper face
    weight, index = np.full(paths, 1.0 - first[0]), np.arange(paths)
    flux = np.zeros((2, paths))
    while index.size:
        thickness = paint.optical_thickness[medium - 1]
        target = depth + direction[:, 2] * rng.exponential(size=index.size)
        up, down = target <= 0, target >= thickness
        beyond = medium + np.where(down, 1, -1)
        reflectance, cosine = fresnel(np.abs(direction[:, 2]), n[beyond] / n[medium])
        at_face = up | down
        crosses = at_face & (rng.random(index.size) >= reflectance)
        turns = at_face & ~crosses
        direction[turns, 2] *= -1.0
        ratio = np.sqrt((1 - cosine**2) / np.maximum(1 - direction[:, 2] ** 2, 1e-300))
        sign = np.where(direction[:, 2] > 0, 1.0, -1.0)
        refracted = np.stack(
            [direction[:, 0] * ratio, direction[:, 1] * ratio, sign * cosine], axis=1
        )
        direction = np.where(crosses[:, None], refracted, direction)
        hit = ~at_face
        weight[hit] *= paint.albedo[medium[hit] - 1]
        old = direction[hit, 0], direction[hit, 1], direction[hit, 2]
        direction[hit] = np.stack(new_directions(rng, old, paint.g[medium[hit] - 1]), axis=1)
        depth = np.where(hit, target, np.where(down, thickness, 0.0))
        medium = np.where(crosses, beyond, medium)
        # In the next layer from its near face.
        entered = np.clip(medium, 1, last)
        depth = np.where(crosses, np.where(down, 0.0, paint.optical_thickness[entered - 1]), depth)
        for side, left in enumerate((medium == 0, medium == last + 1)):
            flux[side, index[left]] += weight[left]
            if exits is not None and side == 0:
                exits.append((weight[left], direction[left]))
        weak = weight < 0.05
        survives = ~weak | (rng.random(index.size) < 0.2)
        weight = np.where(weak, weight * 5.0, weight)
        keep = (medium > 0) & (medium <= last) & survives & (weight > 0)
        direction, depth, medium, weight, index = (
            x[keep] for x in (direction, depth, medium, weight, index)
        )
    return np.stack([flux.mean(axis=1), flux.std(axis=1) / np.sqrt(paths)], axis=1)
