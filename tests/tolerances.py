"""Tolerances that several tests of the solver hold to, each named once, in the precision that the
tests run in.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from glazejax.radiative.common.rounding import FINEST_SINGLE

DTYPE = np.dtype(jnp.result_type(float))
"""Double, or single with GLAZEJAX_TEST_X64=0."""


def tolerance(dtype: Any) -> float:
    """What rounding leaves of a number of about one, as docs/errors.md says."""
    return {"float64": 1e-12, "float32": 1e-5}[np.dtype(dtype).name]


ROUNDING = tolerance(DTYPE)
"""Of the same number by another way: parts and whole, there and back, in one program or in two."""
LAST_DIGITS = 1e-14 if DTYPE.name == "float64" else 1e-6
"""Of the same where hardly anything is computed."""
CONSERVED = max(1e-10, ROUNDING)
"""Of all light, where nothing is absorbed."""
BETWEEN_METHODS = 2e-4
"""Of two methods that are each asked for 1e-4."""


def within_reach(asked: float) -> float:
    """A tolerance for the solver and for its result: in single precision no finer one than there
    is.
    """
    return asked if DTYPE.name == "float64" else max(asked, FINEST_SINGLE)
