"""Smooth interfaces, of dielectrics and of metals, for unpolarised light.

The functions take numpy or JAX arrays and answer in kind, so that tables for a fixed index are made
once, in double precision, outside the compiled program. `Any` in what they return stands for that
kind.
"""

from types import ModuleType
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Either: TypeAlias = Array | np.ndarray | np.floating
"""An array of either kind, or the number that NumPy makes of one without axes."""


def array_module(*arrays: object) -> ModuleType:
    """`jax.numpy` if any of the arrays is a JAX array (or traced), else `numpy`."""
    return jnp if any(isinstance(a, jax.Array) for a in arrays) else np


def cos_refracted(
    cos_incidence: float | Float[Either, "*#batch"],
    refractive_index: float | Float[Either, "*#batch"],
) -> Float[Any, "*batch"]:
    """Cosine inside a medium of index n >= 1 of a beam that comes from air; of one that grazes,
    of cosine zero, that of the critical angle.

    Snell's law, ``sin(theta_air) = n sin(theta_medium)`` (paper A, section 2). Written without the
    difference of two numbers near one, so that n = 1 returns the cosine unchanged to rounding.
    """
    xp = array_module(cos_incidence, refractive_index)
    n = refractive_index
    return xp.sqrt((n - 1.0) * (n + 1.0) + cos_incidence**2) / n


def dielectric_reflectance(
    cos_incidence: float | Float[Either, "*#batch"],
    refractive_index: float | Float[Either, "*#batch"],
) -> Float[Any, "*batch"]:
    """Fresnel reflectance of the smooth face of a dielectric, for unpolarised light from air.

    By reversibility this is also the reflectance from inside at the refracted angle.

    Args:
        cos_incidence: cosine of the angle of incidence in air, (...), in (0, 1].
        refractive_index: index n of the medium, (...), >= 1.

    Returns:
        Reflectance in [0, 1], (...).

    Source: Fresnel's equations; paper A, section 2 (its R(mu)).
    """
    xp = array_module(cos_incidence, refractive_index)
    n = refractive_index
    # n times the cosine in the medium; for n = 1 it equals the cosine in air exactly, so both
    # amplitudes vanish.
    n_cos_medium = xp.sqrt((n - 1.0) * (n + 1.0) + cos_incidence**2)
    s = (cos_incidence - n_cos_medium) / (cos_incidence + n_cos_medium)
    p = (n**2 * cos_incidence - n_cos_medium) / (n**2 * cos_incidence + n_cos_medium)
    return 0.5 * (s**2 + p**2)


def conductor_reflectance(
    cos_incidence: float | Float[Either, "*#batch"],
    refractive_index: float | Float[Either, "*#batch"],
    extinction: float | Float[Either, "*#batch"],
) -> Float[Any, "*batch"]:
    """Fresnel reflectance of a smooth metal of complex index n + ik, for unpolarised light from
    air.

    Args:
        cos_incidence: cosine of the angle of incidence in air, (...), in [0, 1].
        refractive_index: n, (...), > 0.
        extinction: k, (...), >= 0. With k = 0 this is a dielectric of any n, total reflection
            included.

    Returns:
        Reflectance in [0, 1], (...).

    Source: paper B, eqs (11)-(15), with a and b as they follow from (a + ib)^2 = (n + ik)^2 -
    sin^2(theta); the printed (14) and (15) have the root of the sum in pieces. See also M. Born, E.
    Wolf, Principles of Optics, 14.2.
    """
    xp = array_module(cos_incidence, refractive_index, extinction)
    n = refractive_index
    k = extinction
    c = cos_incidence
    sin2 = (1.0 - c) * (1.0 + c)
    # (a + ib)^2 = t + 2i n k; the larger of a and b by its root, the other by their product, so
    # that no digit is lost.
    t = (n - k) * (n + k) - sin2
    square = t**2 + (2.0 * n * k) ** 2
    nothing = square <= 0.0  # at the critical angle of no metal, where roots would have no slope
    larger = xp.sqrt(0.5 * (xp.sqrt(xp.where(nothing, 1.0, square)) + abs(t)))
    smaller = n * k / larger
    a = xp.where(nothing, 0.0, xp.where(t >= 0.0, larger, smaller))
    b = xp.where(nothing, 0.0, xp.where(t >= 0.0, smaller, larger))
    s = ((a - c) ** 2 + b**2) / ((a + c) ** 2 + b**2)
    # (13), times cos^2 above and below: sin tan has no bound where light grazes.
    ratio = ((a * c - sin2) ** 2 + (b * c) ** 2) / ((a * c + sin2) ** 2 + (b * c) ** 2)
    return 0.5 * s * (1.0 + ratio)


def cook_torrance_reflectance(
    cos_incidence: float | Float[Either, "*#batch"],
    normal_reflectance: float | Float[Either, "*#batch"],
) -> Float[Any, "*batch"]:
    """Cook and Torrance's estimate: the dielectric that reflects as much at normal incidence.

    Args:
        cos_incidence: cosine of the angle of incidence, (...), in (0, 1].
        normal_reflectance: measured at normal incidence, (...), in [0, 1). Poor for metals, see
            paper B.

    Returns:
        Reflectance in [0, 1], (...).

    Source: paper B, eqs (16)-(18); its (16) is `dielectric_reflectance` at the index of (18).
    """
    xp = array_module(cos_incidence, normal_reflectance)
    root = xp.sqrt(normal_reflectance)
    return dielectric_reflectance(cos_incidence, (1.0 + root) / (1.0 - root))


def hall_extinction(
    mean_normal_reflectance: float | Float[Either, "*#batch"],
) -> Float[Any, "*batch"]:
    """Extinction k of the metal of index n = 1 that reflects so much at normal incidence.

    Args:
        mean_normal_reflectance: mean over the wavelengths, (...), in [0, 1).

    Source: paper B, eq (23).
    """
    xp = array_module(mean_normal_reflectance)
    return xp.asarray(2.0 * xp.sqrt(mean_normal_reflectance / (1.0 - mean_normal_reflectance)))


def hall_reflectance(
    cos_incidence: float | Float[Either, "*#batch"],
    normal_reflectance: float | Float[Either, "*#batch"],
    mean_extinction: float | Float[Either, "*#batch"],
    mean_index: float | Float[Either, "*#batch"] = 1.0,
) -> Float[Any, "*batch"]:
    """Hall's estimate: from normal incidence to 1 along the curve of one average metal for all
    wavelengths.

    Args:
        cos_incidence: cosine of the angle of incidence, (...), in [0, 1].
        normal_reflectance: measured at normal incidence, (...), in [0, 1].
        mean_extinction: mean k over the wavelengths, (...), > 0; `hall_extinction` where it is not
            known.
        mean_index: mean n, (...), > 0; 1 where it is not known.

    Returns:
        Reflectance in [0, 1], (...).

    Source: paper B, eqs (19)-(22).
    """
    xp = array_module(cos_incidence, normal_reflectance, mean_extinction, mean_index)
    n = mean_index
    c = cos_incidence
    # |n + ik|^2, by which both polarisations are written (19)-(21).
    square = mean_index**2 + mean_extinction**2
    s = (square - 2.0 * n * c + c**2) / (square + 2.0 * n * c + c**2)
    p = (square * c**2 - 2.0 * n * c + 1.0) / (square * c**2 + 2.0 * n * c + 1.0)
    # The average metal's rise from normal incidence to 1 is every band's (22).
    start = (square - 2.0 * n + 1.0) / (square + 2.0 * n + 1.0)
    rise = (0.5 * (s + p) - start) / (1.0 - start)
    return xp.asarray(normal_reflectance + (1.0 - normal_reflectance) * rise)
