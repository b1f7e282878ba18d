"""Coats as a renderer's scene file names them: a line of text, a stack's file, or the
text of one.
"""

from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...paint.describe import parse_coats
from ...paint.media import MAX_THICKNESS, Glaze, Mixture
from ...stacks import Ground, Stack, parse_stack, read_stack
from ..glaze.solve import on_grid


class Axes(NamedTuple):
    """Ranges of what varies over a surface: ends of each range, or None for what does not vary."""

    thickness: tuple[float, float] | None = None
    """Of the coat, m."""
    fraction: tuple[float, float] | None = None
    """Share of the coat's second paint."""

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """(low, high) by name, of those that vary."""
        return {name: span for name, span in self._asdict().items() if span is not None}


def read_coats(text: str, refractive_index: float | None = None) -> Glaze:
    """The glaze that a scene file means, on wavelengths at even distances.

    Args:
        text: ``UltramarineBlue:3um, ZincWhite:20um`` (see `glazejax.paint.describe.parse_coats`),
            the path of a stack's JSON, or that JSON itself (`glazejax.stacks`).
        refractive_index: in place of the stack's, 1.5 for coats given as text.

    Raises:
        FileNotFoundError: text that ends in .json and is no file.
        ValueError: what none of the three can read; an unknown paint.
    """
    stripped = text.strip()
    if stripped.startswith("{"):
        stack = parse_stack(stripped)
    elif stripped.lower().endswith(".json") or (stripped and Path(stripped).is_file()):
        stack = read_stack(stripped)
    else:
        # As seen from inside the paint.
        ground: Ground = 0.8
        stack = Stack(parse_coats(text), ground=ground)
    try:
        glaze = stack.glaze()
    except ValueError as error:
        raise ValueError(f"coats: {error}") from None
    index = stack.refractive_index if refractive_index is None else refractive_index
    return on_even_grid(Glaze(glaze.coats, glaze.ground, index))


def on_even_grid(glaze: Glaze) -> Glaze:
    """The glaze on wavelengths at even distances, at least as many: a renderer finds its bands by
    dividing.
    """
    grid = np.asarray(glaze.wavelengths, float)
    # As many bands as the finest step asks for.
    count = grid.size if grid.size < 3 else round((grid[-1] - grid[0]) / np.diff(grid).min()) + 1
    return on_grid(glaze, np.linspace(grid[0], grid[-1], max(count, 2)) if grid.size > 1 else grid)


def check_layer(glaze: Glaze, layer: int, axes: Axes) -> None:
    """Refuse a coat that there is not, or whose fraction or thickness cannot vary as asked.

    Raises:
        ValueError: the message names the coat and the value.
    """
    if not 0 <= layer < len(glaze.coats):
        raise ValueError(
            f"layer is {layer}, but there are {len(glaze.coats)} coats, the top one is number 0"
        )
    medium = glaze.coats[layer].medium
    if axes.fraction is not None and not (
        isinstance(medium, Mixture) and len(medium.pigments) == 2
    ):
        raise ValueError(
            f"fraction is the share of the second paint of coat {layer}, but that is "
            f"{medium.name}: write it as a "
            "mixture of two paints, such as 0.5*ZincWhite+0.5*Eosin:12um"
        )
    if axes.thickness is not None:
        low, high = axes.thickness
        if not 0 <= low < high <= MAX_THICKNESS:
            raise ValueError(
                f"coat {layer} is {low:g} to {high:g} m thick; thickness_max must be above 0 and "
                f"at most {MAX_THICKNESS:g} m (20 micrometres are 20e-6)"
            )


def index_of(glaze: Glaze) -> float:
    """The one refractive index of a glaze.

    Raises:
        ValueError: it varies over the bands.
    """
    values = np.unique(np.asarray(glaze.refractive_index, float))
    if values.size != 1:
        raise ValueError(
            "a renderer's glaze has one refractive index for all wavelengths; give the glaze a "
            "number"
        )
    return float(values[0])


def ground_of(glaze: Glaze) -> Float[Array, "bands"]:
    """Reflectance of the glaze's own ground in each band."""
    return jnp.broadcast_to(glaze.ground, glaze.wavelengths.shape)
