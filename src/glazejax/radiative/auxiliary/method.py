"""Paper A's integral equation on a graded mesh as a method of the two reflectances of a stack."""

import numpy as np
from jaxtyping import Array

from ..common.inputs import concrete
from ..common.rounding import Rounding
from ..common.solver import Request, Solver
from ..common.split import Split
from ..common.stack_arrays import StackArrays
from . import graded
from .panels import PanelMesh

# Bytes of one chunk's matrices, too large for a cache: enough for a few stacks.
_CHUNK_BYTES = 2**24


class Auxiliary(Solver):
    """Shares no approximation with the default method; see `auxiliary.graded`."""

    finest: float = 1e-8
    rounding: Rounding | None = Rounding(per_depth=1e-7, deepest=4e4)

    def resolve(self, request: Request) -> tuple[PanelMesh, int]:
        """Mesh, and how many stacks go through at a time."""
        thickness = concrete(request.optical_thickness)
        thickest = np.inf if thickness is None else float(thickness.max(initial=0.0))
        mesh = graded.resolve(request.tolerance, thickest, request.indices[0])
        panels = request.layers * (2 * mesh.graded + (13 if mesh.interior else 0))
        bytes_each = graded.bytes_each(mesh, panels, request.itemsize)
        return mesh, request.stacks_within(_CHUNK_BYTES, bytes_each)

    def reflectance(self, stack: StackArrays, resolution: PanelMesh) -> Array:
        """Either reflectance of each stack, (batch,)."""
        return graded.reflectance(stack, resolution)

    def split(self, stack: StackArrays, resolution: PanelMesh) -> Split:
        """Reflectance by what the light did last."""
        return graded.split(stack, resolution)
