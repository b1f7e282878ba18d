"""Interface of a solver of stacks, whatever its method: the same verbs in all of them."""

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .chunks import chunk_bytes
from .inputs import Numbers
from .rounding import Rounding
from .split import Split
from .stack_arrays import LeafNames, StackArrays, ValueAndGradient


class Request(NamedTuple):
    """Request by which a solver chooses its resolution."""

    tolerance: float
    """Absolute error wanted."""
    indices: tuple[float, float]
    """Smallest and largest refractive index."""
    fixed_index: float | None
    """The index, where it is one number."""
    optical_thickness: Numbers
    """(..., layers), as given, perhaps traced."""
    cos_incidence: Numbers
    cos_viewing: Numbers | None
    """None for the hemispherical flux."""
    stacks: int
    layers: int
    itemsize: int
    """Bytes of a number."""
    inputs: tuple[Any, ...]
    """All arguments as given: they say which device the program runs on."""

    def stacks_within(self, memory: int, bytes_each: int) -> int:
        """Number of stacks that go through the processor at a time, at least one.

        Args:
            memory: bytes that suit a processor's cache.
            bytes_each: bytes of one stack's matrices.
        """
        return max(1, chunk_bytes(memory, *self.inputs) // bytes_each)


class Solver(ABC):
    """One method for both reflectances: hemispherical where a stack has no viewing direction.

    `resolve` comes first and is given what is known before a program is compiled. The others are
    compiled, and take a batch of stacks at the resolution that it gave.
    """

    finest: float
    """Smallest tolerance that is met in double precision."""
    rounding: Rounding | None
    """Growth of single precision's errors with depth; None where they do not."""
    slopes_at_index_one: bool = False
    """True if slopes by the index hold at an index of one."""
    splits: bool = True
    """True if `split` can be asked for."""

    @abstractmethod
    def resolve(self, request: Request) -> tuple[Any, int]:
        """The method's own resolution, static, and how many stacks go through at a time."""

    @abstractmethod
    def reflectance(self, stack: StackArrays, resolution: Any) -> Array:
        """Reflectance factor or hemispherical reflectance, (batch,)."""

    def reflectance_and_gradient(
        self, stack: StackArrays, resolution: Any, leaf_names: LeafNames
    ) -> ValueAndGradient:
        """Reflectance and, by name, its derivative by the wanted leaves in their shapes; by reverse
        differentiation where a method has nothing better.
        """

        def value(leaves: dict[str, Array]) -> Array:
            return self.reflectance(stack._replace(**leaves), resolution)

        leaves = {name: getattr(stack, name) for name in leaf_names}
        factor, back = jax.vjp(value, leaves)
        return factor, back(jnp.ones_like(factor))[0]

    def split(self, stack: StackArrays, resolution: Any) -> Split:
        """Reflectance by what the light did last, each (batch,)."""
        raise NotImplementedError("this method does not keep the parts of the reflectance apart")
