"""Many fluxes the plain way, as paper C prints them: one matrix over all directions, in two or
three dimensions.

`glazejax.radiative.manyflux` uses the symmetry about the normal and solves a small problem for each
azimuth mode; here every direction is a row, so that what that saves can be measured, and the flat
case of the paper's figures computed.
"""

from typing import NamedTuple

import numpy as np

from glazejax.radiative.common.fresnel import cos_refracted, dielectric_reflectance


class Slab(NamedTuple):
    """Reflection and transmission of a layer between directions, downwards first; the same from
    both sides.
    """

    reflection: np.ndarray
    transmission: np.ndarray


def solve(cosines: np.ndarray, phase: np.ndarray, albedo: float, thickness: float) -> Slab:
    """A layer by eigenvalues, paper C, equations (18)-(20).

    Args:
        cosines: (n,) of the directions of a hemisphere with the normal, > 0.
        phase: (2n, 2n), weights included: the share of what comes in one direction that is sent
            into another; the first n directions point downwards.
        albedo, thickness: of the layer; the thickness is optical.
    """
    n = cosines.size
    rates = (albedo * phase - np.eye(2 * n)) / np.concatenate([cosines, -cosines])[:, None]
    values, shapes = (np.real(part) for part in np.linalg.eig(rates))
    fading = np.exp(-np.abs(values) * thickness)
    # Each mode is 1 at the side from which it fades, so that nothing grows.
    top, bottom = (shapes * np.where(sign * values > 0, fading, 1.0) for sign in (1, -1))
    inverse = np.linalg.inv(np.concatenate([top[:n], bottom[n:]]))[:, :n]
    return Slab(top[n:] @ inverse, bottom[:n] @ inverse)


def hemisphere(bands: int, sectors: int) -> tuple[np.ndarray, np.ndarray]:
    """Cells of equal solid angle: cosines, (cells,), and unit vectors, (cells, 3), z into the
    layer.
    """
    cosine = np.repeat((np.arange(bands) + 0.5)[::-1] / bands, sectors)
    azimuth = np.tile((np.arange(sectors) + 0.5) * 2 * np.pi / sectors, bands)
    sine = np.sqrt(1 - cosine**2)
    return cosine, np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1)


def phase_matrix(vectors: np.ndarray, g: float) -> np.ndarray:
    """Henyey and Greenstein's law between all directions, (2n, 2n), scaled so that no light is
    lost.
    """
    both = np.concatenate([vectors, vectors * [1, 1, -1]])
    law = (1 - g**2) / (1 + g**2 - 2 * g * both @ both.T) ** 1.5
    return law / law.sum(axis=0)


def inner_reflectance(cosines: np.ndarray, index: float) -> np.ndarray:
    """Fresnel reflectance of the surface from inside."""
    squared = 1 - index**2 * (1 - cosines**2)
    outside = np.sqrt(np.maximum(squared, 0.0))
    return np.where(squared > 0, dielectric_reflectance(np.maximum(outside, 1e-12), index), 1.0)


def flat_series(
    directions: int, index: float, albedo: float, thickness: float, degrees: float, orders: int = 2
) -> list[float]:
    """Figure 10 in two dimensions: root mean square errors of the first orders over all directions.

    Args:
        directions: even angles on the half circle; light of intensity 1 comes in the nearest to the
            refracted ray.
        index, albedo, thickness, degrees: of the medium, which scatters evenly, and of the light in
            air.
        orders: how many.
    """
    angles = ((np.arange(directions) + 0.5) / directions - 0.5) * np.pi
    slab = solve(
        np.cos(angles), np.full((2 * directions,) * 2, 0.5 / directions), albedo, thickness
    )
    surface = inner_reflectance(np.cos(angles), index)
    lit = np.arccos(float(cos_refracted(np.cos(np.deg2rad(degrees)), index)))
    beam = np.zeros(directions)
    beam[np.argmin(np.abs(angles - lit))] = 1.0
    once = surface[:, None] * slab.reflection

    def seen(between: np.ndarray) -> np.ndarray:
        """Light that leaves upwards through the surface, and downwards."""
        inside = between @ beam
        return np.concatenate(
            [(1 - surface) * (slab.reflection @ inside), slab.transmission @ inside]
        )

    exact = seen(np.linalg.inv(np.eye(directions) - once))
    between, errors = np.eye(directions), []
    for _ in range(orders):
        errors.append(float(np.sqrt(np.mean((seen(between) - exact) ** 2))))
        between = np.eye(directions) + once @ between
    return errors
