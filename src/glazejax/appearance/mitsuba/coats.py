"""Coats as a renderer's scene file names them: a line of text, a stack's file, or the
text of one.
"""

from dataclasses import replace

import numpy as np

from ...paint.describe import names_file, parse_coats
from ...paint.media import Glaze
from ...stacks import Stack, parse_stack, read_stack
from ..glaze.solve import on_grid


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
    elif names_file(stripped):
        stack = read_stack(stripped)
    else:
        # As seen from inside the paint.
        stack = Stack(parse_coats(text), ground=0.8)
    if refractive_index is not None:
        stack = replace(stack, refractive_index=refractive_index)
    try:
        glaze = stack.glaze()
    except ValueError as error:
        raise ValueError(f"coats: {error}") from None
    return on_even_grid(glaze)


def on_even_grid(glaze: Glaze) -> Glaze:
    """The glaze on wavelengths at even distances, at least as many: a renderer finds its bands by
    dividing.
    """
    grid = np.asarray(glaze.wavelengths, float)
    # As many bands as the finest step asks for; one band has no step.
    steps = round((grid[-1] - grid[0]) / np.diff(grid).min(initial=np.inf))
    return on_grid(glaze, np.linspace(grid[0], grid[-1], steps + 1))


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
