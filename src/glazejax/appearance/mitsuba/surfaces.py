"""Parts that both surfaces of a glaze share: solutions in blocks, and cosines inside the paint."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from ...radiative.common.chunks import by_blocks
from ...radiative.common.inputs import flat_batch
from ...spectra import Numbers
from .lookup import Arithmetic

Layers: TypeAlias = Sequence[Float[np.ndarray, "*stacks layers"]]
"""Albedo and optical thickness of the layers of some stacks."""


ErrorOfNodes: TypeAlias = Callable[[np.ndarray], float]
"""Error that nodes of the angle leave, given as cosines in air."""


class SolvedSurface:
    """A surface of a glaze, and the solver that computes light through it.

    Args:
        solve: reflectance factors of stacks.
        block: stacks that are solved at a time.
        finest: least tolerance that `solve` takes.
        refractive_index: of the paint.
        options: further arguments of `solve`.
    """

    def __init__(
        self,
        solve: Callable[..., Any],
        block: int,
        finest: float,
        refractive_index: float,
        **options: float,
    ):
        self.refractive_index = refractive_index
        self._solve = partial(solve, refractive_index=refractive_index, **options)
        self._block = block
        self._finest = finest

    def factor(
        self,
        layers: Layers,
        ground: Numbers,
        cos_in: Numbers,
        cos_out: Numbers,
        tolerance: float,
    ) -> np.ndarray:
        """Reflectance factors of stacks that broadcast, in blocks of one size, so that one program
        is compiled.
        """
        ends = [np.asarray(x, float) for x in (ground, cos_in, cos_out)]
        shape = np.broadcast_shapes(layers[0].shape[:-1], *(x.shape for x in ends))
        # One row for each stack, ground and pair of directions.
        rows = [flat_batch(x, shape, x.shape[-1]) for x in layers]
        rows += [flat_batch(x, shape) for x in ends]

        def run(numbers: np.ndarray) -> Any:
            albedo, depth, below, light, eye = (x[numbers] for x in rows)
            return self._solve(
                albedo,
                depth,
                substrate_reflectance=below,
                cos_incidence=light,
                cos_viewing=eye,
                tolerance=max(tolerance, self._finest),
            )

        return by_blocks(len(rows[0]), self._block, run).reshape(shape)


def inside(ops: Arithmetic, cosine: Any, refractive_index: float) -> Any:
    """Cosine inside the paint, in any arithmetic; see `cos_refracted`."""
    n = refractive_index
    return ops.sqrt((n - 1.0) * (n + 1.0) + cosine * cosine) / n
