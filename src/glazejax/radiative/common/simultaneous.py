r"""Directions for a known index: one Gauss rule for all light and for the light that the surface
lets out.

With isotropic scattering directions enter the reflectance only through two sums over them (the
kernels of paper A's integral equation, the flux on the ground and the flux out are all of these
kinds),

    F_1(t) = sum_i w_i mu_i e^(-t/mu_i),      F_T(t) = sum_i w_i (1 - R_i) mu_i e^(-t/mu_i).

So R_i need not be Fresnel's reflectance at mu_i: it may be whatever makes both sums right. That
takes the square-root singularity of R at the critical angle, and the split of the directions there,
out of the problem. In a variable y that crowds towards grazing, mu = (e^(c y) - 1)/(e^c - 1), the
terms are smooth and the n nodes are the zeros of the polynomial that is orthogonal to `whole`
powers of y under dy and to `cone` powers under (1 - R) dy, n = whole + cone: the rule is exact in y
to the degree n + whole - 1 for the first sum, n + cone - 1 for the second (C. F. Borges, Numer.
Math. 67 (1994) 271, on simultaneous Gaussian quadrature). Some R_i may lie outside [0, 1] by a
little: only the sums have a meaning.
"""

import numpy as np
from jaxtyping import Float

from .fresnel import dielectric_reflectance
from .quadrature import Directions, gauss

# Points of the fine rule under the inner products, on each side of the critical angle: exact to
# rounding.
_FINE = 100
# The surface may seem to reflect this much more than all in some direction; the system stays
# positive definite.
_MOST_REFLECTED = 1.02

Vector = Float[np.ndarray, "n"]


def fine_half_range(refractive_index: float, crowding: float) -> Directions:
    """Rule with far more nodes, split at the critical angle, exact to rounding for smooth functions
    of y.
    """
    n = refractive_index
    c = crowding
    excess = (n - 1.0) * (n + 1.0)
    critical = np.sqrt(excess) / n
    u, weights = (column[::-1] for column in gauss(_FINE))
    # Below the critical angle Gauss in y; above it in the cosine outside, crowded as R rises
    # steeply for n near one.
    edge = np.log1p(critical * np.expm1(c)) / c
    y = edge * u
    below = np.expm1(c * y) / np.expm1(c)
    by_y = edge * weights * c * np.exp(c * y) / np.expm1(c)
    cos_outside = u**3
    cos_inside = np.sqrt(excess + cos_outside**2) / n
    by_outside = 3.0 * u**2 * weights * cos_outside / (n * n * cos_inside)
    reflected = dielectric_reflectance(cos_outside, n)
    if excess == 0:
        return Directions(cos_inside, by_outside, reflected)
    return Directions(
        np.concatenate([cos_inside, below]),
        np.concatenate([by_outside, by_y]),
        np.concatenate([reflected, np.ones(_FINE)]),
    )


def simultaneous_rule(
    refractive_index: float, all_light: int, cone: int, crowding: float
) -> Directions | None:
    """Directions for all light and for what is let out.

    Args:
        refractive_index: n >= 1, a number.
        all_light: conditions for the first sum, at least one.
        cone: conditions for the second; whole + cone is the number of nodes.
        crowding: c > 0.

    Returns:
        `Directions`, or None where there is none with positive weights, cosines in (0, 1) and sound
        reflectances.
    """
    count = all_light + cone
    c = crowding
    # A fine rule stands for the integrals, in a coordinate that crowds where the cone ends.
    half = fine_half_range(refractive_index, c)
    y = np.log1p(half.cosines * np.expm1(c)) / c
    measure = half.weights * np.expm1(c) * np.exp(-c * y) / c
    # Polynomials that are orthonormal over all light, and those of light that is let out.
    polynomials, diagonal, side = _orthonormal(y, measure, count)
    let_out = (polynomials * (measure * (1.0 - half.reflectance))).T
    # The nodes are eigenvalues of the recurrence's matrix. Its last row is Gauss's for one weight
    # alone; here it is mixed so that the next polynomial is orthogonal under both.
    matrix = np.diag(diagonal) + np.diag(side[:-1], 1) + np.diag(side[:-1], -1)
    if cone:
        moments = let_out.T @ polynomials[:cone].T
        try:
            mixed = np.linalg.solve(moments[all_light:count].T, -moments[count])
        except np.linalg.LinAlgError:
            return None
        matrix[-1, all_light:] -= side[-1] * mixed
    nodes = np.linalg.eigvals(matrix)
    if np.any(np.abs(np.imag(nodes)) > 0) or not np.all(np.isfinite(nodes)):
        return None
    nodes = np.sort(np.real(nodes))[::-1]
    if nodes[0] >= 1 or nodes[-1] <= 0:
        return None
    # Weights: both sums of each polynomial are exact.
    at_nodes = _evaluate(nodes, polynomials[0, 0], diagonal, side)
    sums = np.stack([polynomials[:count] @ measure, np.sum(let_out[:, :count], axis=0)], axis=1)
    try:
        weights, passing = np.linalg.solve(at_nodes, sums).T
    except np.linalg.LinAlgError:
        return None
    if np.any(weights <= 0):
        return None
    # The second weight is the first times what is let out.
    reflectance = 1.0 - passing / weights
    if np.any(reflectance > _MOST_REFLECTED) or np.any(reflectance < -0.5):
        return None
    scale = np.expm1(c)
    return Directions(
        np.expm1(c * nodes) / scale, weights * c * np.exp(c * nodes) / scale, reflectance
    )


def _orthonormal(
    y: Vector, measure: Vector, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orthonormal polynomials 0 ... count at the fine points, and their recurrence (Stieltjes'
    procedure).
    """
    polynomials = [np.full_like(y, 1.0 / np.sqrt(np.sum(measure)))]
    diagonal = np.zeros(count)
    side = np.zeros(count)
    for k in range(count):
        # y times the last polynomial, less its components along all before.
        following = y * polynomials[-1]
        diagonal[k] = np.sum(measure * following * polynomials[-1])
        for _ in range(2):  # once more against rounding
            before = np.array(polynomials)
            following = following - (before @ (measure * following)) @ before
        side[k] = np.sqrt(np.sum(measure * following**2))
        polynomials.append(following / side[k])
    return np.array(polynomials), diagonal, side


def _evaluate(nodes: Vector, constant: float, diagonal: Vector, side: Vector) -> np.ndarray:
    """Orthonormal polynomials below the count at the nodes, (polynomials, nodes)."""
    values = [np.full_like(nodes, constant)]
    before = np.zeros_like(nodes)
    for k in range(len(nodes) - 1):
        following = (
            (nodes - diagonal[k]) * values[-1] - (side[k - 1] * before if k else 0.0)
        ) / side[k]
        before = values[-1]
        values.append(following)
    return np.array(values)
