"""Light followed path by path through free-standing layers of different index under smooth surfaces:
the fluxes on both sides, where `position_free` has a ground. Slow, and nothing of glazejax is in it.

Paths start as a collimated beam and carry a weight. In each layer they fly an exponential length;
at a collision the weight loses the absorbed share and the direction turns by Henyey and
Greenstein's law. Surfaces reflect or let through by Fresnel's law, by chance.
"""

from typing import NamedTuple

import numpy as np

from .position_free import new_directions
from .rough_surface import directions, fresnel


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
    direction = directions(np.full(paths, enter[0]), 0.0)
    medium, depth = (
        np.ones(paths, int),
        np.zeros(paths),
    )  # optical depth below the layer's upper face
    weight, index = np.full(paths, 1.0 - first[0]), np.arange(paths)
    flux = np.zeros((2, paths))
    while index.size:
        thickness = paint.optical_thickness[medium - 1]
        z = direction[2]
        target = depth + z * rng.exponential(size=index.size)
        up, down = target <= 0, target >= thickness
        beyond = medium + np.where(down, 1, -1)
        ratio = n[beyond] / n[medium]
        reflectance, cosine = fresnel(np.abs(z), ratio)
        at_face = up | down
        crosses = at_face & (rng.random(index.size) >= reflectance)
        z[at_face & ~crosses] *= -1.0
        direction[:2, crosses] /= ratio[crosses]
        z[crosses] = np.copysign(cosine, z)[crosses]
        hit = ~at_face
        weight[hit] *= paint.albedo[medium[hit] - 1]
        direction[:, hit] = new_directions(rng, direction[:, hit], paint.g[medium[hit] - 1])
        depth = np.where(hit, target, np.where(down, thickness, 0.0))
        medium = np.where(crosses, beyond, medium)
        # In the next layer from its near face.
        entered = np.clip(medium, 1, last)
        depth = np.where(crosses, np.where(down, 0.0, paint.optical_thickness[entered - 1]), depth)
        for side, left in enumerate((medium == 0, medium == last + 1)):
            flux[side, index[left]] += weight[left]
            if exits is not None and side == 0:
                exits.append((weight[left], direction[:, left]))
        weak = weight < 0.05
        survives = ~weak | (rng.random(index.size) < 0.2)
        weight = np.where(weak, weight * 5.0, weight)
        keep = (medium > 0) & (medium <= last) & survives & (weight > 0)
        direction = direction[:, keep]
        depth, medium, weight, index = (x[keep] for x in (depth, medium, weight, index))
    return np.stack([flux.mean(axis=1), flux.std(axis=1) / np.sqrt(paths)], axis=1)
