"""Discrete ordinates as a method of the two reflectances of a stack."""

from jaxtyping import Array

from ..common.directions import Resolution, resolve
from ..common.inputs import smallest_cosine
from ..common.rounding import Rounding
from ..common.solver import Request, Solver
from ..common.split import Split
from ..common.stack_arrays import LeafNames, StackArrays, ValueAndGradient
from . import sensitivity, solver
from .resolution import resolve_known

# Bytes of one chunk's matrices: with all that is made of them they should stay in a core's
# second-level cache. A spectrum goes through in few pieces: the loop over them would cost more than
# the cache saves.
_CHUNK_BYTES = 2**17
_SPECTRUM_CHUNK_BYTES = 2**20
# So many stacks are a spectrum.
_SPECTRUM = 128
_LEAST_CHUNK = 16


class Ordinates(Solver):
    """The default method; see `ordinates.solver`."""

    finest: float = 1e-10
    rounding: Rounding | None = None
    slopes_at_index_one: bool = True

    def resolve(self, request: Request) -> tuple[Resolution, int]:
        """Directions, and how many stacks go through at a time."""
        # Where light grazes, what leaves along it matters too; all of it does in a flux.
        least = smallest_cosine(request.cos_incidence)
        if request.cos_viewing is not None:
            least = max(least, smallest_cosine(request.cos_viewing))
        resolution = (
            resolve(request.tolerance, *request.indices, least)
            if request.fixed_index is None
            else resolve_known(request.tolerance, request.fixed_index, least)
        )
        nodes = resolution.cone + resolution.total
        bytes_each = (request.layers + 3) * nodes**2 * request.itemsize
        memory = _SPECTRUM_CHUNK_BYTES if request.stacks <= _SPECTRUM else _CHUNK_BYTES
        return resolution, max(_LEAST_CHUNK, request.stacks_within(memory, bytes_each))

    def reflectance(self, stack: StackArrays, resolution: Resolution) -> Array:
        """Either reflectance of each stack, (batch,)."""
        return solver.reflectance(stack, resolution)

    def reflectance_and_gradient(
        self, stack: StackArrays, resolution: Resolution, leaf_names: LeafNames
    ) -> ValueAndGradient:
        """Reflectance and its derivatives from the fields of light and view."""
        return sensitivity.reflectance_and_gradient(stack, resolution, leaf_names)

    def split(self, stack: StackArrays, resolution: Resolution) -> Split:
        """Reflectance by what the light did last."""
        return sensitivity.split(stack, resolution)
