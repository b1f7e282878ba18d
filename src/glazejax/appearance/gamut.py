"""Ways to bring a colour that a display can't show within what it can."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def bring_inside(light: Float[Array, "*batch 3"], shares: Float[Array, "3"], how: str) -> Float[Array, "*batch 3"]:
    """Light of each primary, (..., 3), made to lie in [0, 1].

    Args:
        light: (..., 3), linear.
        shares: (3,), share of each primary in the luminance of white, sum 1.
        how: "clip" (or "error", where nothing is outside), "dim" or "desaturate".
    """
    if how == "dim":
        light = light / jnp.maximum(jnp.max(light, axis=-1, keepdims=True), 1.0)
    elif how == "desaturate":
        light = _desaturate(light, shares)
    # What dimming can't bring in, and rounding elsewhere.
    return jnp.clip(light, 0.0, 1.0)


def _desaturate(light: Float[Array, "*batch 3"], shares: Float[Array, "3"]) -> Float[Array, "*batch 3"]:
    """Each colour moved towards the grey of its luminance just until it fits."""
    # What is brighter than white becomes white.
    grey = jnp.clip(jnp.sum(light * shares, axis=-1, keepdims=True), 0.0, 1.0)
    away = light - grey
    room = jnp.where(away > 0.0, 1.0 - grey, grey)
    size = jnp.abs(away)
    fits = size <= room
    keep = jnp.where(fits, 1.0, room / jnp.where(fits, 1.0, size))
    return grey + jnp.min(keep, axis=-1, keepdims=True) * away
