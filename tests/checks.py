"""What many tests ask of numbers, and of functions that JAX transforms."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import numpy as np
from jax.test_util import check_grads
from numpy.testing import assert_allclose

check_slopes = partial(check_grads, order=1)
"""Slopes of a function at some arguments are those of differences, forward and in reverse."""


def finite(tree: Any) -> bool:
    """Whether all numbers of a tree are finite."""
    return all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(tree))


def largest_difference(values: Any, others: Any) -> float:
    """Of two arrays; not a number where one of them holds none."""
    return float(np.max(np.abs(np.subtract(values, others))))


def check_mapped(function: Callable, *arguments: Any, **within: Any) -> None:
    """Under jit, and under vmap by the first axes, a function gives what it gives by itself."""
    plain = function(*arguments)
    for run in (jax.jit(function), jax.vmap(function)):
        assert_allclose(run(*arguments), plain, **within)
