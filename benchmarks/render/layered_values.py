"""What glazejax says of the stacks of `layered_stacks`, by two methods where there are two."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from benchmarks.render.layer_rules import even_light
from benchmarks.render.layered_stacks import INCIDENCES, VIEWS, LayeredStack


class Values(NamedTuple):
    """Body of one stack: what its surface reflects at once is not in it."""

    albedo: np.ndarray  # (incidences, bands)
    factor: np.ndarray  # (incidences, views, bands)


def cosines() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of incidence (incidences,) and view (views,), and azimuth of the views in degrees."""
    angle, azimuth = np.array(VIEWS).T
    return np.cos(np.deg2rad(np.array(INCIDENCES))), np.cos(np.deg2rad(angle)), azimuth


def methods(stack: LayeredStack) -> list[str]:
    """Names of the methods that take this stack, the one for the table first."""
    if stack.roughness:
        return ["rough"]
    if stack.isotropic and stack.uniform:
        return ["ordinates", "manyflux"]
    return ["manyflux"]


def programs(
    stack: LayeredStack, method: str, tolerance: float
) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Functions of nothing that give the albedo (bands, incidences) and the factor (bands,
    incidences, views).
    """
    from glazejax.radiative import manyflux, phase
    from glazejax.radiative.stack import stack_hemispherical_reflectance, stack_reflectance_factor

    lit, seen, azimuth = cosines()
    one, two = (slice(None), None, slice(None)), (slice(None), None, None, slice(None))
    a, t = stack.albedo, stack.thickness
    fluxes, factors = {"cos_incidence": lit}, {"cos_incidence": lit[:, None], "cos_viewing": seen}
    given: dict[str, Any] = {"refractive_index": stack.indices[0], "tolerance": tolerance}
    if method == "rough":
        from glazejax.radiative import rough

        given["roughness"] = stack.roughness
        hemispherical, factor = (
            rough.rough_hemispherical_reflectance,
            rough.rough_reflectance_factor,
        )
    elif method == "ordinates" or (method == "manyflux" and stack.isotropic and stack.uniform):
        given["method"] = method
        hemispherical, factor = stack_hemispherical_reflectance, stack_reflectance_factor
    else:
        if not stack.uniform:
            given["refractive_index"] = stack.indices
        if not stack.isotropic:
            given["phase"] = np.asarray(phase.henyey_greenstein(stack.g, 48))
        cosine, v = np.unique(seen, return_inverse=True)
        turned, z = np.unique(azimuth, return_inverse=True)

        def table() -> np.ndarray:
            axes = {"cos_incidence": lit, "cos_viewing": cosine, "azimuth": turned}
            found = manyflux.brdf_table(
                a, t, stack.ground, **axes, **given
            )  # (bands, views, incidences, azimuths)
            return np.pi * np.asarray(found)[:, v, :, z].transpose(1, 2, 0)

        return lambda: manyflux.manyflux_hemispherical_reflectance(
            a[one], t[one], stack.ground, **fluxes, **given
        ), table
    return (
        lambda: hemispherical(a[one], t[one], stack.ground, **fluxes, **given),
        lambda: factor(a[two], t[two], stack.ground, **factors, **given),
    )


def values(stack: LayeredStack, method: str, tolerance: float) -> Values:
    """Both at once."""
    albedo, factor = (
        np.asarray(program(), float) for program in programs(stack, method, tolerance)
    )
    return Values(albedo.T, np.moveaxis(factor, 0, -1))


def base_reflectance(stack: LayeredStack) -> np.ndarray:
    """What all below the coats reflects of even light, without any surface, (bands,): the base
    colour of a rule.
    """
    from glazejax.radiative import manyflux, phase

    below = slice(stack.coats, None)
    if len(stack.layers) == stack.coats:
        return np.full(stack.albedo.shape[0], stack.ground)
    given: dict[str, Any] = {"refractive_index": 1.0, "tolerance": 1e-5}
    if stack.g[below].any():
        given["phase"] = np.asarray(phase.henyey_greenstein(stack.g[below], 40))
    found = manyflux.manyflux_diffuse_reflectance(
        stack.albedo[:, below], stack.thickness[:, below], stack.ground, **given
    )
    return np.asarray(found, float)


class Surface(NamedTuple):
    """The outer surface itself; rough ones with the lobe that brings back what their
    facets lose.
    """

    lit: np.ndarray  # albedo E at the incidences
    seen: np.ndarray  # and at the views
    even: float  # its mean over even light
    factor: (
        np.ndarray
    )  # (incidences, views), pi f; zero if smooth, whose mirror image is in no view


def surface(stack: LayeredStack) -> Surface:
    """By glazejax."""
    from glazejax.radiative.common.fresnel import dielectric_reflectance

    lit, seen, azimuth = cosines()
    n = stack.indices[0]
    y, w = np.polynomial.legendre.leggauss(48)
    nodes = (0.5 * (1.0 + y)) ** 2  # crowded where light grazes
    weights = 0.5 * w * (1.0 + y)
    if stack.roughness:
        from glazejax.radiative import rough

        given = {"refractive_index": n, "roughness": stack.roughness}
        factor = rough.surface_reflectance_factor(lit[:, None], seen, azimuth, **given)

        def of(cosine: np.ndarray) -> np.ndarray:
            return np.asarray(rough.surface_albedo(cosine, **given), float)
    else:
        factor = np.zeros((len(lit), len(seen)))

        def of(cosine: np.ndarray) -> np.ndarray:
            return np.asarray(dielectric_reflectance(cosine, n), float)

    even = even_light(of(nodes), nodes, weights)
    return Surface(lit=of(lit), seen=of(seen), even=even, factor=np.asarray(factor, float))
