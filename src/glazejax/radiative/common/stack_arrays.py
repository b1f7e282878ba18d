"""Input of every solver: a batch of stacks as arrays."""

from typing import Any, NamedTuple, TypeAlias

from jaxtyping import Array

LeafNames: TypeAlias = tuple[str, ...]
"""Names of the arrays of stacks to differentiate by."""
ValueAndGradient: TypeAlias = tuple[Array, dict[str, Array]]
"""A number a stack, (batch,), and by name its derivative by the wanted arrays in their shapes."""


class StackArrays(NamedTuple):
    """Everything a reflectance depends on. Batch axis first; layers top first."""

    albedo: Array  # (batch, layers)
    optical_thickness: Array  # (batch, layers)
    ground: Array  # (batch,)
    refractive_index: Any  # (batch,), or one number
    cos_incidence: Array  # (batch,), in air
    cos_viewing: Array | None  # (batch,), in air; None for the hemispherical flux
