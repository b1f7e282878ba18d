"""Rounding errors of single precision in a thick layer that absorbs next to nothing."""

import sys
import warnings
from typing import NamedTuple

import numpy as np

from .inputs import Numbers, concrete

FINEST_SINGLE = 1e-5
"""Smallest tolerance that any method meets in single precision, but for thick layers that absorb
little: docs/errors.md. `Solver.finest` is that in double precision.
"""
# Their frames lie between a user's line and what warns.
_PACKAGES = {"glazejax", "jax", "equinox", "jaxtyping"}
# An estimate of rounding is good to about a factor of this.
_KNOWN_TO = 2.0


class Rounding(NamedTuple):
    """Growth of the largest of a method's rounding errors with the depth that light reaches, as
    measured against double precision.
    """

    per_depth: float
    """Error for an optical thickness of one."""
    deepest: float
    """Beyond this optical thickness they grow no more."""
    power: float = 1.0
    """Of the optical thickness, with which they grow."""


def warn_of_rounding(
    rounding: Rounding,
    albedo: Numbers,
    optical_thickness: Numbers,
    tolerance: float,
    *,
    advice: str = "",
) -> None:
    """Say so where single precision leaves more of a stack than is asked for.

    Nothing is said of what JAX traces, for it isn't known yet.

    Args:
        rounding: of the method.
        albedo, optical_thickness: (..., layers), checked.
        tolerance: as asked for; what single precision has at best counts as that.
        advice: what else helps, besides double precision.
    """
    q, thickness = concrete(albedo), concrete(optical_thickness)
    if q is None or thickness is None or not q.size or not thickness.size:
        return
    # Light gets this deep before it is absorbed: by diffusion, or by few scatterings.
    absorbed = np.maximum(1.0 - q, np.finfo(np.float32).tiny)
    reached = np.minimum(0.5 / np.sqrt(absorbed), 0.02 / absorbed)
    depth = float(np.max(np.sum(np.minimum(reached, thickness), axis=-1)))
    error = rounding.per_depth * min(depth, rounding.deepest) ** rounding.power
    if error > _KNOWN_TO * max(tolerance, FINEST_SINGLE):
        warn_user(
            f"in single precision rounding leaves up to about {error:.0e} here, where light is "
            f"scattered down to an optical thickness of {depth:.2g} and hardly absorbed: {advice}"
            'write jax.config.update("jax_enable_x64", True) at the start of the program'
        )


def warn_user(text: str) -> None:
    """Warn at the line of a user's code that called this package, however deep inside."""
    level = 1
    frame = sys._getframe()
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in _PACKAGES:
        frame = frame.f_back
        level += 1
    warnings.warn(text, stacklevel=level)
