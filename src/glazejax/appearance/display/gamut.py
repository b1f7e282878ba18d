"""Ways to bring a colour that a display can't show within what it can."""

import numpy as np
from jaxtyping import Array, Float

from ...radiative.common.fresnel import array_module


def bring_inside(
    light: Float[Array | np.ndarray, "*batch 3"], shares: Float[np.ndarray, "3"], how: str
) -> Float[Array | np.ndarray, "*batch 3"]:
    """Light of each primary, (..., 3), made to lie in [0, 1].

    Args:
        light: (..., 3), linear.
        shares: (3,), share of each primary in the luminance of white, sum 1.
        how: "clip" (or "error", where nothing is outside), "dim" or "desaturate".
    """
    xp = array_module(light)
    if how == "dim":
        light = light / xp.maximum(xp.max(light, axis=-1, keepdims=True), 1.0)
    elif how == "desaturate":
        light = _desaturate(light, shares)
    # What dimming can't bring in, and rounding elsewhere.
    return xp.clip(light, 0.0, 1.0)


def _desaturate(
    light: Float[Array | np.ndarray, "*batch 3"], shares: Float[np.ndarray, "3"]
) -> Float[Array | np.ndarray, "*batch 3"]:
    """Each colour moved towards the grey of its luminance just until it fits."""
    xp = array_module(light)
    # What is brighter than white becomes white.
    grey = xp.clip(
        xp.sum(light * xp.asarray(shares, light.dtype), axis=-1, keepdims=True), 0.0, 1.0
    )
    away = light - grey
    room = xp.where(away > 0.0, 1.0 - grey, grey)
    size = xp.abs(away)
    fits = size <= room
    keep = xp.where(fits, 1.0, room / xp.where(fits, 1.0, size))
    return grey + xp.min(keep, axis=-1, keepdims=True) * away
