"""Light followed path by path through layers under a smooth surface: slow, but it shares nothing
with the solvers.

Paths start as a collimated beam and carry a weight. In each layer they fly an exponential length;
at a collision the weight loses the absorbed share and the direction turns by Henyey and
Greenstein's law. The surface reflects or lets through by Fresnel's law (by chance), the ground
reflects by Lambert's law (by weight). At every collision and ground reflection the light that goes
straight out to the eye is added to the reflectance factor ("next event"), so that a single
direction of viewing is estimated without bins; paths that leave are counted as flux.
"""

from typing import NamedTuple

import numpy as np

from glazejax.radiative.common.fresnel import cos_refracted, dielectric_reflectance


class Estimate(NamedTuple):
    """Means over paths and their standard errors."""

    reflectance_factor: np.ndarray  # (azimuths,)
    factor_error: np.ndarray
    flux: float  # directional-hemispherical reflectance
    flux_error: float


class Paint(NamedTuple):
    """Layers top first, on a Lambertian ground."""

    albedo: np.ndarray
    optical_thickness: np.ndarray
    g: np.ndarray
    ground: float
    refractive_index: float


def simulate(
    paint: Paint,
    cos_incidence: float,
    cos_viewing: float,
    azimuth: np.ndarray,
    paths: int,
    seed: int = 0,
) -> Estimate:
    """Reflectance factor at each azimuth (degrees, 0 the mirror side) and flux that leaves, by
    ``paths`` paths.
    """
    rng = np.random.default_rng(seed)
    n = paint.refractive_index
    edges = np.concatenate([[0.0], np.cumsum(paint.optical_thickness)])
    bottom = edges[-1]
    seen = float(cos_refracted(cos_viewing, n))
    out = (1.0 - float(dielectric_reflectance(cos_viewing, n))) / n**2
    sine = np.sqrt(1.0 - seen**2)
    eye = np.stack([sine * np.cos(np.deg2rad(azimuth)), sine * np.sin(np.deg2rad(azimuth))], axis=1)

    enter = float(cos_refracted(cos_incidence, n))
    direction = np.tile(
        [np.sqrt(1.0 - enter**2), 0.0, enter], (paths, 1)
    )  # third component positive downwards
    depth = np.zeros(paths)
    weight = np.full(paths, 1.0 - float(dielectric_reflectance(cos_incidence, n)))
    index = np.arange(paths)
    factor, flux = np.zeros((paths, len(azimuth))), np.zeros(paths)

    while index.size:
        target = depth + direction[:, 2] * rng.exponential(size=index.size)
        # At the surface: out, or back by total or Fresnel reflection.
        top = target <= 0.0
        inside = np.abs(direction[:, 2])
        outside = np.sqrt(np.maximum(1.0 - n**2 * (1.0 - inside**2), 0.0))
        back = np.where(outside > 0, dielectric_reflectance(np.maximum(outside, 1e-12), n), 1.0)
        leaving = top & (rng.random(index.size) >= back)
        flux[index[leaving]] += weight[leaving]
        direction[top & ~leaving, 2] *= -1.0
        # On the ground: what it sends straight to the eye, then a diffuse direction.
        down = (target >= bottom) & (direction[:, 2] > 0) & ~top
        weight[down] *= paint.ground
        straight = np.exp(-bottom / seen)
        factor[index[down]] += (weight[down] * straight * out)[:, None]
        direction[down] = -_lambert(rng, int(down.sum()))
        # In a layer: absorption, light straight to the eye, a new direction.
        hit = ~top & ~down
        layer = np.clip(
            np.searchsorted(edges, target[hit], side="right") - 1, 0, len(paint.albedo) - 1
        )
        weight[hit] *= paint.albedo[layer]
        g = paint.g[layer]
        cosine = direction[hit, :2] @ eye.T - (direction[hit, 2] * seen)[:, None]
        phase = (1 - g**2)[:, None] / (1 + g[:, None] ** 2 - 2 * g[:, None] * cosine) ** 1.5
        # pi L/E of light scattered into the eye's direction: phase/(4 mu) per unit of flux.
        factor[index[hit]] += (weight[hit] * np.exp(-target[hit] / seen) * out / (4.0 * seen))[
            :, None
        ] * phase
        direction[hit] = _turned(rng, direction[hit], g)
        depth = np.clip(target, 0.0, bottom)
        # Weak paths end by chance, the others carry on for them.
        weak = weight < 0.05
        survives = ~weak | (rng.random(index.size) < 0.2)
        weight = np.where(weak, weight * 5.0, weight)
        keep = ~leaving & survives & (weight > 0)
        direction, depth, weight, index = direction[keep], depth[keep], weight[keep], index[keep]

    root = np.sqrt(paths)
    return Estimate(
        factor.mean(axis=0), factor.std(axis=0) / root, float(flux.mean()), float(flux.std() / root)
    )


def _lambert(rng: np.random.Generator, count: int) -> np.ndarray:
    """Directions whose third component is positive, as the cosine law has them."""
    cosine, turn = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    sine = np.sqrt(1.0 - cosine**2)
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=1)


def _turned(rng: np.random.Generator, direction: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Directions after scattering by Henyey and Greenstein's law."""
    u, turn = rng.random(len(g)), 2 * np.pi * rng.random(len(g))
    small = np.abs(g) < 1e-6
    safe = np.where(small, 1.0, g)
    ratio = (1 - safe**2) / (1 - safe + 2 * safe * u)
    cosine = np.clip(np.where(small, 2 * u - 1, (1 + safe**2 - ratio**2) / (2 * safe)), -1.0, 1.0)
    sine = np.sqrt(1.0 - cosine**2)
    # Two directions across the old one, built so that no component divides by zero.
    sign = np.where(direction[:, 2] >= 0, 1.0, -1.0)
    a = -1.0 / (sign + direction[:, 2])
    b = direction[:, 0] * direction[:, 1] * a
    first = np.stack(
        [1 + sign * direction[:, 0] ** 2 * a, sign * b, -sign * direction[:, 0]], axis=1
    )
    second = np.stack([b, sign + direction[:, 1] ** 2 * a, -direction[:, 1]], axis=1)
    return (
        (sine * np.cos(turn))[:, None] * first
        + (sine * np.sin(turn))[:, None] * second
        + cosine[:, None] * direction
    )


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

    What the outer surface reflects at once is not in it. Surfaces between layers reflect and
    refract by chance. To
    ``exits`` each step's paths that come back are added: weights and directions in the air.
    """
    rng = np.random.default_rng(seed)
    n = np.concatenate([[1.0], paint.refractive_index, [paint.below]])
    last = len(paint.albedo)
    first, enter = _surface(np.array([cos_incidence]), n[:1], n[1:2])
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
        reflectance, cosine = _surface(np.abs(direction[:, 2]), n[medium], n[beyond])
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
        direction[hit] = _turned(rng, direction[hit], paint.g[medium[hit] - 1])
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


def _surface(
    cosine: np.ndarray, here: np.ndarray, there: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fresnel's reflectance between two media and the cosine beyond; all is reflected where there
    is none.
    """
    squared = 1.0 - (here / there) ** 2 * (1.0 - cosine**2)
    beyond = np.sqrt(np.maximum(squared, 0.0))
    s = (here * cosine - there * beyond) / (here * cosine + there * beyond)
    p = (there * cosine - here * beyond) / (there * cosine + here * beyond)
    return np.where(squared > 0, 0.5 * (s**2 + p**2), 1.0), beyond
