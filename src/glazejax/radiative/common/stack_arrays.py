"""Input of every solver: a batch of stacks as arrays."""

from typing import Any, NamedTuple

from jaxtyping import Array


class StackArrays(NamedTuple):
    """Everything a reflectance depends on. Batch axis first; layers top first."""

    albedo: Array  # (batch, layers)
    optical_thickness: Array  # (batch, layers)
    ground: Array  # (batch,)
    refractive_index: Any  # (batch,), or one number
    cos_incidence: Array  # (batch,), in air
    cos_viewing: Array | None  # (batch,), in air; None for the hemispherical flux
