"""Points at which densities are summed."""

import numpy as np


def every_pair(values: np.ndarray) -> np.ndarray:
    """Each value with each, the second changing first, (pairs, 2)."""
    return np.stack(np.meshgrid(values, values, indexing="ij"), axis=-1).reshape(-1, 2)
