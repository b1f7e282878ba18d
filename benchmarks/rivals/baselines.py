"""What several benchmarks compute: k and s of paints, unmixing by non-negative least squares, Kubelka-Munk's film under a
surface, and least squares for many small problems side by side.

Features of spectra, such as slopes of -log R and angles between spectra, are those of
`benchmarks.paintbench.spectra`.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls

from glazejax import Pigment

_TINY = 1e-12


def spectra_of(paints: Sequence[Pigment]) -> Float[np.ndarray, "paints 2 bands"]:
    """k and s of paints, 1/m."""
    return np.array([[np.asarray(p.absorption), np.asarray(p.scattering)] for p in paints])


def unmix(
    ends: Float[np.ndarray, "bands parts"], spectra: Float[np.ndarray, "n bands"]
) -> tuple[Float[np.ndarray, "n parts"], Float[np.ndarray, "n"]]:
    """Amounts of parts whose sum is nearest to each spectrum, none below zero, and the root mean
    square of what is left.
    """
    solutions = [nnls(ends, spectrum) for spectrum in spectra]
    amounts = np.array([solution[0] for solution in solutions])
    return amounts, np.array([solution[1] for solution in solutions]) / np.sqrt(len(ends))


def shares_of(amounts: Float[np.ndarray, "n parts"]) -> Float[np.ndarray, "n parts"]:
    """Amounts as parts of their sum; zero where there is nothing."""
    total = amounts.sum(axis=-1, keepdims=True)
    return amounts / np.where(total > 0, total, 1.0)


class Surface(NamedTuple):
    """Saunderson's correction: Fresnel reflectance from outside, and of diffuse light from
    inside.
    """

    outer: float
    inner: float

    @property
    def passed(self) -> float:
        """Share of light that passes the surface on its way in and out."""
        return (1.0 - self.outer) * (1.0 - self.inner)

    def reading(self, inside: np.ndarray) -> np.ndarray:
        """Reflectance in air of paint that reflects so much inside."""
        return self.outer + self.passed * inside / (1.0 - self.inner * inside)

    def inside(self, reading: np.ndarray) -> np.ndarray:
        """Reflectance inside the paint, the correction undone."""
        body = np.maximum(reading - self.outer, 1e-4)
        return np.clip(body / (self.passed + self.inner * body), 1e-4, 0.999)


def film_reflectance(
    absorption: np.ndarray, scattering: np.ndarray, ground: np.ndarray | float
) -> np.ndarray:
    """Kubelka-Munk's reflectance of films of K d and S d on a ground, without a surface."""
    x = np.sqrt(np.maximum(absorption * (absorption + 2.0 * scattering), _TINY**2))
    # sinh(x)/x and cosh(x) over exp(x), so that nothing overflows.
    sinh = np.where(x < 1e-4, 1.0 - x, -np.expm1(-2.0 * x) / (2.0 * np.maximum(x, _TINY)))
    below = 0.5 * (1.0 + np.exp(-2.0 * x)) + (absorption + scattering) * sinh
    back = scattering * sinh / below
    through = np.exp(-x) / below
    return back + through**2 * ground / (1.0 - back * ground)


def least_squares(
    computed: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    readings: Float[np.ndarray, "n rows"],
    start: Float[np.ndarray, "n unknowns"],
    *,
    least: float = -np.inf,
    largest_step: float = np.inf,
    rounds: int = 60,
) -> tuple[Float[np.ndarray, "n unknowns"], Float[np.ndarray, "n"]]:
    """Points of least squares of many problems side by side, and their sums of squares.

    Args:
        computed: values (n, rows) and their derivatives (n, rows, unknowns) at points.
        readings: that the values are to meet.
        start: first points.
        least: bound of every unknown.
        largest_step: of an unknown in one round.
        rounds: of Levenberg's and Marquardt's steps at most.
    """
    point = start
    value, slopes = computed(point)
    cost = ((readings - value) ** 2).sum(axis=1)
    damping = np.full(len(point), 1e-3)
    diagonal = np.arange(point.shape[1])
    for _ in range(rounds):
        gradient = np.einsum("nbp,nb->np", slopes, readings - value)
        curvature = slopes.transpose(0, 2, 1) @ slopes
        # What lies at its bound and would go below stays there for this step.
        fixed = (point <= least) & (gradient < 0)
        curvature[fixed[:, :, None] | fixed[:, None, :]] = 0.0
        scale = curvature[:, diagonal, diagonal] * (1.0 + damping[:, None]) + _TINY
        curvature[:, diagonal, diagonal] = np.where(fixed, 1.0, scale)
        step = np.linalg.solve(curvature, np.where(fixed, 0.0, gradient)[..., None])[..., 0]
        trial = np.maximum(point + np.clip(step, -largest_step, largest_step), least)
        trial_value, trial_slopes = computed(trial)
        trial_cost = ((readings - trial_value) ** 2).sum(axis=1)
        better = trial_cost < cost
        gain = np.where(better, cost - trial_cost, 0.0)
        point = np.where(better[:, None], trial, point)
        value[better] = trial_value[better]
        slopes[better] = trial_slopes[better]
        cost = np.where(better, trial_cost, cost)
        damping = np.clip(np.where(better, 0.3 * damping, 4.0 * damping), 1e-9, 1e9)
        if np.all((gain < 1e-6 * cost) & (better | (damping > 1e4))):
            break
    return point, cost
