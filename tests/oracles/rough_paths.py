"""Paths through paint under a rough surface, facet by facet: slow, and nothing of `radiative.rough`
is in it.

Facets are drawn as a direction sees them (E. Heitz, JCGT 7(4), 2018). A path that meets the surface
is reflected or refracted by the facet, by chance. Where the new direction is hidden (1 - G1) it is
the surface's loss, and goes on as the compensation says: to air or into the paint by the share of
each in the whole loss, with the cosine's chance k dm. The loss k is what `Loss` finds by the same
drawing. Paths carry no weight but that of albedo and ground.
"""

from typing import NamedTuple

import numpy as np


class Estimate(NamedTuple):
    """Means over paths, and their standard errors."""

    bins: (
        np.ndarray
    )  # (bins,), share of the flux that leaves the paint in each bin of the cosine in air
    bins_error: np.ndarray
    flux: float
    flux_error: float
    surface: float  # share that never entered the paint
    surface_error: float


class Rough(NamedTuple):
    """A surface."""

    roughness: float
    refractive_index: float


def _visible_normals(rng: np.random.Generator, cosine: np.ndarray, roughness: float) -> np.ndarray:
    """Normals (paths, 3) as directions (sin, 0, cos) see them; Heitz 2018, his listing."""
    stretched = np.stack(
        [roughness * np.sqrt(1 - cosine**2), np.zeros_like(cosine), cosine], axis=1
    )
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    across = np.array([0.0, 1.0, 0.0])
    other = np.cross(stretched, across)
    radius, turn = np.sqrt(rng.random(cosine.size)), 2 * np.pi * rng.random(cosine.size)
    t1, t2 = radius * np.cos(turn), radius * np.sin(turn)
    half = 0.5 * (1.0 + stretched[:, 2])
    t2 = (1 - half) * np.sqrt(1 - t1**2) + half * t2
    up = np.sqrt(np.maximum(0.0, 1 - t1**2 - t2**2))
    normal = t1[:, None] * across + t2[:, None] * other + up[:, None] * stretched
    normal = np.stack(
        [roughness * normal[:, 0], roughness * normal[:, 1], np.maximum(normal[:, 2], 0.0)], axis=1
    )
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _meet(
    rng: np.random.Generator, surface: Rough, cosine: np.ndarray, inside: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One facet for each path: the new cosine, whether it is inside, and whether the path was lost
    to other facets.
    """
    normal = _visible_normals(rng, cosine, surface.roughness)
    sine = np.sqrt(1 - cosine**2)
    met = np.clip(sine * normal[:, 0] + cosine * normal[:, 2], 0.0, 1.0)
    here = np.where(inside, surface.refractive_index, 1.0)
    there = np.where(inside, 1.0, surface.refractive_index)
    squared = 1 - (here / there) ** 2 * (1 - met**2)
    beyond = np.sqrt(np.maximum(squared, 0.0))
    s = (here * met - there * beyond) / (here * met + there * beyond)
    p = (there * met - here * beyond) / (there * met + here * beyond)
    back = rng.random(cosine.size) < np.where(squared > 0, 0.5 * (s * s + p * p), 1.0)
    reflected = 2 * met * normal[:, 2] - cosine
    refracted = -(here / there) * (met * normal[:, 2] - cosine) + beyond * normal[:, 2]
    new = np.where(back, reflected, refracted)
    tangent2 = (1 - new**2) / np.maximum(new**2, 1e-300)
    shown = 2.0 / (1.0 + np.sqrt(1.0 + surface.roughness**2 * tangent2))
    lost = (new <= 0) | (rng.random(cosine.size) >= shown)
    return np.clip(np.abs(new), 1e-9, 1.0), np.where(back, inside, ~inside), lost


class Loss:
    """The loss of single facets on each side, as what becomes of light that is lost: a side, and a
    cosine.

    Cosines of both sides are drawn with dm, one facet each; those that are lost are kept, and drawn
    from.
    """

    def __init__(self, surface: Rough, paths: int = 400_000, seed: int = 1):
        rng = np.random.default_rng(seed)
        square = surface.refractive_index**2
        inside = rng.random(paths) < square / (1 + square)
        cosine = np.sqrt(rng.random(paths))
        lost = _meet(rng, surface, cosine, inside)[2]
        self.inside, self.cosine = inside[lost], cosine[lost]
        self.constant = float((1 + square) * lost.mean())
        """Of dm = 2 c dc in air and n^2 2 mu dmu inside."""

    def draw(self, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Cosines, and whether they are inside."""
        chosen = rng.integers(self.inside.size, size=count)
        return self.cosine[chosen], self.inside[chosen]


def _scatter(
    rng: np.random.Generator, surface: Rough, loss: Loss, cosine: np.ndarray, inside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    new, side, lost = _meet(rng, surface, cosine, inside)
    new[lost], side[lost] = loss.draw(rng, int(lost.sum()))
    return new, side


def simulate(
    surface: Rough,
    albedo: np.ndarray,
    optical_thickness: np.ndarray,
    ground: float,
    cos_incidence: float,
    paths: int,
    edges: np.ndarray,
    seed: int = 0,
    loss: Loss | None = None,
) -> Estimate:
    """Flux that leaves the paint, in bins of the cosine in air, of a beam of one."""
    rng = np.random.default_rng(seed)
    loss = loss or Loss(surface)
    faces = np.concatenate([[0.0], np.cumsum(optical_thickness)])
    cosine, inside = _scatter(
        rng, surface, loss, np.full(paths, cos_incidence), np.zeros(paths, bool)
    )
    direct = 1.0 - inside.mean()
    # Cosines of the way down are positive, of the way up negative.
    mu, weight, depth = cosine[inside], np.ones(int(inside.sum())), np.zeros(int(inside.sum()))
    path = np.flatnonzero(inside)
    out, where = np.zeros(paths), np.zeros(paths)
    while mu.size:
        target = depth + mu * rng.exponential(size=mu.size)
        top, down = target <= 0, target >= faces[-1]
        if np.any(top):
            new, still = _scatter(rng, surface, loss, -mu[top], np.ones(int(top.sum()), bool))
            left = np.flatnonzero(top)[~still]
            out[path[left]], where[path[left]] = weight[left], new[~still]
            weight[left] = 0.0
            mu[top] = new
        weight[down] *= ground
        mu[down] = -np.sqrt(rng.random(int(down.sum())))
        hit = ~top & ~down
        weight[hit] *= albedo[
            np.clip(np.searchsorted(faces, target[hit], side="right") - 1, 0, len(albedo) - 1)
        ]
        mu[hit] = 2 * rng.random(int(hit.sum())) - 1
        depth = np.clip(target, 0.0, faces[-1])
        weak = (weight > 0) & (weight < 0.05)
        weight = np.where(weak, np.where(rng.random(mu.size) < 0.2, 5.0, 0.0) * weight, weight)
        keep = weight > 0
        mu, weight, depth, path = mu[keep], weight[keep], depth[keep], path[keep]
    root = np.sqrt(paths)
    each = out[:, None] * ((where[:, None] > edges[:-1]) & (where[:, None] <= edges[1:]))
    return Estimate(
        each.mean(axis=0),
        each.std(axis=0) / root,
        float(out.mean()),
        float(out.std() / root),
        float(direct),
        float(np.sqrt(direct * (1 - direct)) / root),
    )
