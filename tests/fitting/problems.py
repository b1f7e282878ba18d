"""Problems of several films at once."""

from collections.abc import Iterable
from dataclasses import replace

import jax
import jax.numpy as jnp

from glazefit.film.problem import FilmProblem


def side_by_side(problems: Iterable[FilmProblem]) -> FilmProblem:
    """Problems of one structure and one prior as one, their blocks one after another: what all
    share is the first one's.
    """
    first, *others = problems
    data = jax.tree.map(
        lambda *arrays: jnp.concatenate(arrays), first.data, *(other.data for other in others)
    )
    blocks = tuple(block for problem in (first, *others) for block in problem.blocks)
    return replace(first, blocks=blocks, data=data)
