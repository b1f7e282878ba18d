"""Stacks for the solver's tests: the reference values, padded to one shape, and edge values."""

import re
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from glazejax import stack_hemispherical_reflectance, stack_reflectance_factor
from glazejax.radiative.common.fresnel import dielectric_reflectance
from tests.reference import isotropic_stacks

LAYERS = 5
EDGE_ALBEDO = (0.0, 1e-300, 0.3, 1 - 1e-15, 1.0)
EDGE_THICKNESS = (0.0, 1e-12, 1e-6, 0.1, 3.0, 1e3, 1e6)
EDGE_GROUND = (0.0, 0.5, 1.0)
EDGE_COSINE = (1e-4, 1e-2, 0.5, 1.0)
TWO_LAYERS: dict[str, Any] = {
    "albedo": [0.5, 0.5],
    "optical_thickness": [1.0, 1.0],
    "substrate_reflectance": 0.5,
}
"""Arguments of a stack, of which tests make one wrong."""
NO_STACKS = np.zeros((0, 2)), np.zeros((0, 2)), 0.5


class Cases(NamedTuple):
    """Stacks of one refractive index, empty layers below filling up to five (which changes nothing:
    tested).
    """

    albedo: np.ndarray
    optical_thickness: np.ndarray
    substrate_reflectance: np.ndarray
    cos_incidence: np.ndarray
    cos_viewing: np.ndarray
    reflectance_factor: np.ndarray
    hemispherical_reflectance: np.ndarray
    uncertainty: np.ndarray


def reference_cases() -> dict[float, Cases]:
    """The reference values by refractive index."""
    stacks = isotropic_stacks()

    def column(key: str) -> np.ndarray:
        values = [stack[key] for stack in stacks]
        if isinstance(values[0], list):
            values = [layers + [0.0] * (LAYERS - len(layers)) for layers in values]
        return np.array(values)

    columns, indices = [column(key) for key in Cases._fields], column("refractive_index")
    return {
        index: Cases(*(values[indices == index] for values in columns))
        for index in np.unique(indices).tolist()
    }


def random_cases(count: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    """albedo, optical thickness (count, 5), ground, two cosines (count,): nothing extreme."""
    rng = np.random.default_rng(seed)
    shape = (count, LAYERS)
    return (
        rng.uniform(0, 1, shape),
        10 ** rng.uniform(-2, 1, shape),
        rng.uniform(0, 1, count),
        rng.uniform(0.05, 1, count),
        rng.uniform(0.05, 1, count),
    )


def factor(albedo, thickness, ground, light, view, **options: Any) -> jax.Array:
    """Reflectance factor of stacks as `random_cases` gives them."""
    return stack_reflectance_factor(
        albedo, thickness, ground, cos_incidence=light, cos_viewing=view, **options
    )


def flux(albedo, thickness, ground, light, **options: Any) -> jax.Array:
    """Hemispherical reflectance of the same."""
    return stack_hemispherical_reflectance(
        albedo, thickness, ground, cos_incidence=light, **options
    )


# Central and one-sided eight-point differences, exact to eighth order; nodes and weights of f'(0).
CENTRAL = (
    np.array([-4, -3, -2, -1, 1, 2, 3, 4.0]),
    np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280]),
)
_forward = np.arange(9.0)
FORWARD = (_forward, np.linalg.solve(np.vander(_forward, increasing=True).T, np.eye(9)[1]))


def stacks_of_all_kinds(
    count: int, least_cosine: float, *, layers: int = 4, thickest: float = 1e4
) -> tuple[np.ndarray, ...]:
    """Layers from next to nothing to opaque, some of which absorb nothing or do nothing else, over
    any ground; every other cosine evenly in the logarithm, down to the least. As `random_cases`.
    """
    rng = np.random.default_rng(0)
    shape = (count, layers)
    edges = rng.choice([0.0, 1.0, 1 - 1e-12, 1 - 1e-6, 0.5, 1e-9], shape)
    albedo = np.where(rng.uniform(size=shape) < 0.3, edges, rng.uniform(size=shape))
    depth = 10 ** rng.uniform(-6, np.log10(thickest), shape)
    depth[rng.uniform(size=shape) < 0.1] = 0.0
    ground = np.where(rng.uniform(size=count) < 0.3, rng.choice([0.0, 1.0], count), 0.45)
    aslant = 10 ** rng.uniform(np.log10(least_cosine), 0, (2, count))
    cosines = np.where(np.arange(count) % 2, aslant, rng.uniform(0.05, 1, (2, count)))
    return albedo, depth, ground, *cosines


def closed_form(g, cosine):
    """Henyey and Greenstein's phase function."""
    return (1 - g**2) / (1 - 2 * g * cosine + g**2) ** 1.5


def from_inside(mu, index) -> float:
    """What the surface reflects of light below it, all beyond the critical angle."""
    outside = 1.0 - index**2 * (1.0 - mu**2)
    return float(dielectric_reflectance(np.sqrt(outside), index)) if outside > 0 else 1.0


def between(light, view, turn: float):
    """Cosine of the angle of scattering, by the cosines of both directions and the azimuth."""
    return np.sqrt((1 - light**2) * (1 - view**2)) * np.cos(np.deg2rad(turn)) - light * view


def lapack_calls(program: Callable, *arguments) -> list[str]:
    """Calls of LAPACK in a program as it is compiled: bulk use of them can hang."""
    text = jax.jit(program).lower(*arguments).compile().as_text()
    assert text
    return re.findall(r'custom_call_target="[^"]*lapack', text, re.IGNORECASE)
