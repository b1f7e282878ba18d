"""Questions that the table of a body asks the surface above it; `smooth` and `rough` are the two
there are.
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ...spectra import Numbers
from .ground_split import GroundTerms
from .lookup import Arithmetic


@runtime_checkable
class GlazeSurface(Protocol):
    """Transmission of the surface, coordinate in which angles are smooth, and solver of the body
    below.
    """

    refractive_index: float

    def coordinate(self, ops: Arithmetic, cosine: Any) -> Any:
        """From cosines in air to [0, 1]."""
        ...

    def cosine(self, coordinate: Any) -> Any:
        """From [0, 1] to cosines in air, for NumPy."""
        ...

    def let_in(self, ops: Arithmetic, cosine: Any) -> Any:
        """Closed-form factor of T."""
        ...

    def analytic_factor(self, ops: Arithmetic, cos_in: Any, cos_out: Any) -> Any:
        """Closed-form factor of R0."""
        ...

    def factor(
        self, stack: dict[str, Any], cos_in: Numbers, cos_out: Numbers, tolerance: float
    ) -> np.ndarray:
        """The solver's reflectance factor of stacks (albedo, optical_thickness,
        substrate_reflectance).
        """
        ...

    def angles(self, error: Callable[[np.ndarray], float], tolerance: float) -> np.ndarray:
        """Cosines in air of as many nodes (`evenly`) as it takes; `error` tries some."""
        ...

    def terms(self, stack: dict[str, Any], cosines: np.ndarray, tolerance: float) -> np.ndarray:
        """Numbers (*stacks, rows) that hold `GroundTerms`; stacks are albedo and optical_thickness,
        (*stacks, layers).
        """
        ...

    def expand(self, values: np.ndarray, cosines: np.ndarray, tolerance: float) -> GroundTerms:
        """`GroundTerms` at the nodes from sums of those numbers."""
        ...

    def on(self, upload: Callable[[np.ndarray], Any]) -> "GlazeSurface":
        """The same with its tables as `Arithmetic.packet` takes them."""
        ...


def in_blocks(
    solve: Callable[..., Any],
    stack: dict[str, Any],
    cos_in: Numbers,
    cos_out: Numbers,
    tolerance: float,
    refractive_index: float,
    block: int = 4096,
) -> np.ndarray:
    """Reflectance factors of stacks that broadcast, in blocks of one size, so that one program is
    compiled.
    """
    names = ("substrate_reflectance", "cos_incidence", "cos_viewing")
    albedo, depth = np.broadcast_arrays(
        *(np.asarray(stack[k]) for k in ("albedo", "optical_thickness"))
    )
    ends = [np.asarray(x, float) for x in (stack["substrate_reflectance"], cos_in, cos_out)]
    shape = np.broadcast_shapes(albedo.shape[:-1], *(x.shape for x in ends))
    # One row for each stack, ground and pair of directions.
    layers = [
        np.broadcast_to(x, (*shape, x.shape[-1])).reshape(-1, x.shape[-1]) for x in (albedo, depth)
    ]
    rows = [*layers, *(np.broadcast_to(x, shape).reshape(-1) for x in ends)]
    options = {"refractive_index": refractive_index, "tolerance": tolerance}

    def solve_rows(albedo: np.ndarray, depth: np.ndarray, *ground_and_cosines: np.ndarray) -> Any:
        return solve(albedo, depth, **dict(zip(names, ground_and_cosines, strict=True)), **options)

    return by_blocks(solve_rows, rows, block).reshape(shape)


def by_blocks(
    solve: Callable[..., Any], rows: Sequence[Float[np.ndarray, "rows ..."]], block: int
) -> Float[np.ndarray, "rows ..."]:
    """Solutions of rows, in blocks of one size; the first rows fill up the last block."""
    results = []
    for start in range(0, len(rows[0]), block):
        batch = (np.resize(x[start : start + block], (block, *x.shape[1:])) for x in rows)
        results.append(np.asarray(solve(*batch)))
    return np.concatenate(results)[: len(rows[0])]


def inside(ops: Arithmetic, cosine: Any, refractive_index: float) -> Any:
    """Cosine inside the paint, in any arithmetic; see `cos_refracted`."""
    n = refractive_index
    return ops.sqrt((n - 1.0) * (n + 1.0) + cosine * cosine) / n
