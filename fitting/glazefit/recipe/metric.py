"""Colour difference as a length: the quadratic form of CIEDE2000 around a colour."""

import numpy as np
from jaxtyping import Float

from glazejax.colour import delta_e_2000


def colour_metric(lab: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3 3"]:
    """Matrix M such that ``M @ step`` is as long as the CIEDE2000 difference of a small step around
    a colour.

    The squared difference of six small steps, by colour-science, gives the quadratic form; M is its
    Cholesky factor.
    """
    size = 0.02
    unit = size * np.eye(3)
    lab = np.asarray(lab, float)

    def square(move: Float[np.ndarray, "3"]) -> np.ndarray:
        # Symmetric around the colour: the formula takes its weights at the mean of both.
        return (delta_e_2000(lab - move / 2, lab + move / 2) / size) ** 2

    form = np.zeros((*lab.shape[:-1], 3, 3))
    for i in range(3):
        form[..., i, i] = square(unit[i])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        both = (square(unit[i] + unit[j]) - form[..., i, i] - form[..., j, j]) / 2
        form[..., i, j] = form[..., j, i] = both
    return np.swapaxes(np.linalg.cholesky(form + 1e-9 * np.eye(3)), -1, -2)
