r"""Rigorous bounds on what a part of a stack can add to its reflectance, from closed forms alone
(numpy).

All rest on one fact about J(tau), the mean radiance at optical depth tau. It solves J = g +
Lambda(q J), in which g comes from the beam directly and Lambda has non-negative kernels (H + U)/2
and the ground's (paper A, eqs (9), (17), (21)). So whatever function Psi obeys Psi - Lambda(q Psi)
>= (1 - eta) Psi >= (1 - eta) g/g(0) is a ceiling, J <= g(0) Psi/(1 - eta). Two such functions do:

    constant                  Lambda 1 <= 1, whatever the ground and the interface: eta = max q
    exp(-integral of kappa)   in layers over a black floor, for rates that do not fall with depth
                              and obey kappa_l <= kappa(q_l/eta), where kappa(q) is the decay
                              constant of the endless medium, q artanh(kappa)/kappa = 1. (The
                              exponential through any depth lies above Psi everywhere, also above
                              its mirror image in the interface, and the endless medium is solved
                              by exponentials.)
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

PerStack: TypeAlias = Float[np.ndarray, "stacks"]
"""A number a stack."""
PerLayer: TypeAlias = Float[np.ndarray, "stacks layers"]
"""A number for each layer of each stack, top first."""

# Rates from 0 to almost 1, by which kappa(q) is rounded down. A rate of one would make radiances
# unbounded.
_RATES = np.concatenate([np.linspace(0.0, 0.98, 1500), 1.0 - np.geomspace(0.02, 1e-4, 200)[1:]])
# The albedo each belongs to, falling from 1.
_RATE_ALBEDO = np.concatenate([[1.0], _RATES[1:] / np.arctanh(_RATES[1:])])

# Shares of the largest possible 1 - eta that are tried; the smallest bound counts.
_TRIALS = (1.0, 0.6, 0.3, 0.1, 0.03)


class End(NamedTuple):
    """One end of a light path: the beam that comes in, or, by reciprocity, the view."""

    cosine: PerStack
    """Cosine inside the medium; 1, the deepest reaching, for all directions together."""
    flux: PerStack
    """Share of the flux that passes the interface."""
    source: PerStack
    """Mean radiance just below the interface for unit irradiance, g(0) = flux/(4 pi cosine)."""


def decay_rate(albedo: Float[np.ndarray, "*batch"]) -> Float[np.ndarray, "*batch"]:
    """The smallest decay constant kappa(q) of an endless medium, rounded down, (...), in [0, 1).

    Args:
        albedo: q, (...), in [0, 1].

    Source: q artanh(kappa) = kappa; S. Chandrasekhar, Radiative Transfer, section 90.
    """
    # Descending albedo: the last entry whose albedo is not below q has the largest rate allowed.
    index = np.searchsorted(-_RATE_ALBEDO, -np.asarray(albedo), side="right") - 1
    return _RATES[np.clip(index, 0, _RATES.size - 1)]


def count_filled(optical_thickness: PerLayer) -> Int[np.ndarray, "stacks"]:
    """Number of layers down to the last that is not empty."""
    order = np.arange(1, optical_thickness.shape[1] + 1)
    return np.max(order * (optical_thickness > 0), axis=1, initial=0)


def hidden_below(
    albedo: PerLayer,
    optical_thickness: PerLayer,
    ground: PerStack,
    refractive_index: PerStack,
    incidence: End,
    viewing: End,
    tolerance: float,
) -> tuple[Int[np.ndarray, "stacks"], Bool[np.ndarray, "stacks"]]:
    """Number of layers of each stack that can be seen.

    Args:
        albedo, optical_thickness: layers top first, (stacks, layers); albedo 0 in empty ones.
        ground: reflectance of the Lambertian ground, (stacks,).
        refractive_index: n, (stacks,).
        incidence, viewing: the two ends of the path, arrays (stacks,).
        tolerance: what the hidden part may change.

    Returns:
        Number of layers to follow, (stacks,), and whether the ground, or whatever lies below them,
        is hidden.
    """
    filled = count_filled(optical_thickness)
    visible = filled.copy()
    hidden = ground == 0
    depth = np.cumsum(optical_thickness, axis=1)
    rows = np.arange(albedo.shape[0])

    def ends(rows: np.ndarray) -> list[End]:
        return [End(*(leaf[rows] for leaf in end)) for end in (incidence, viewing)]

    for m in range(1, albedo.shape[1] + 1):
        rows = rows[filled[rows] >= m]
        # The straight part is exact and the rest adds to it: where it alone is too much, nothing is
        # hidden.
        below = np.where(filled[rows] == m, ground[rows], 1.0)
        straight = below * _straight(depth[rows, m - 1], *ends(rows)) / refractive_index[rows] ** 2
        # Only where it may be enough is the whole bound computed.
        try_rows = rows[straight <= tolerance]
        below = below[straight <= tolerance]
        if try_rows.size == 0:
            continue
        bound = hidden_change(
            albedo[try_rows, :m],
            optical_thickness[try_rows, :m],
            refractive_index[try_rows],
            *ends(try_rows),
        )
        # Stacks that are opaque after m layers are followed no further.
        done = try_rows[(below == 0) | (bound <= tolerance / np.where(below > 0, below, 1.0))]
        visible[done] = m
        hidden[done] = True
        rows = np.setdiff1d(rows, done, assume_unique=True)
    return visible, hidden


def _straight(depth: np.ndarray, incidence: End, viewing: End) -> np.ndarray:
    """pi p_I p_F c for beams that reach a depth unscattered."""
    arriving = (
        incidence.flux * viewing.flux * np.exp(-depth / incidence.cosine - depth / viewing.cosine)
    )
    # Of all viewing directions together the cosine is not known, but that of the beam is.
    cosine = np.where(
        viewing.cosine == 1.0, incidence.cosine, np.maximum(incidence.cosine, viewing.cosine)
    )
    return 2.0 * arriving / cosine


def hidden_change(
    albedo: PerLayer,
    thickness: PerLayer,
    index: PerStack,
    incidence: End,
    viewing: End,
) -> PerStack:
    """Upper bound on what anything below the given layers adds to what they reflect over black;
    (stacks,).

    It adds the light that passes the layers twice: at most

        pi/n^2 [(phi_F + p_F) lambda_I + p_I lambda_F + p_I p_F c]/(1 - r),

    where p is the flux of the beam that arrives straight, phi that of scattered light and lambda
    its largest radiance, all for layers over black, r the largest reflectance of those layers from
    below, and c = 2/(pi mu) the largest radiance that any medium sends back for unit flux in
    direction mu. (The medium that absorbs nothing and has no interface sends back most. For it (C -
    beta exp(-kappa tau)) g(0) with C = 7, beta = 3, kappa = 0.8 is a ceiling of J, so c = C/(4 pi
    mu) would do.)
    """
    depth = thickness.sum(axis=1)
    brightest = albedo.max(axis=1)
    from_below = _absorption(albedo, thickness)  # 1 - r
    straight = _straight(depth, incidence, viewing)
    best = np.full(depth.shape, np.inf)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # The bound holds for every eta from the brightest albedo to one: the best of some.
        for share in _TRIALS:
            loss = share * (1.0 - brightest)  # 1 - eta
            rates = decay_rate(np.minimum(albedo / (1.0 - loss)[:, None], 1.0))
            rates = np.minimum.accumulate(rates[:, ::-1], axis=1)[:, ::-1]  # not falling with depth
            arriving = brightest / loss * np.exp(-(rates * thickness).sum(axis=1))
            last = rates[:, -1]
            # int mu/(1 - kappa mu) dmu: the flux of light that dies out as exp(-kappa tau).
            spread = np.where(
                last > 1e-3, (-np.log1p(-last) - last) / np.maximum(last, 1e-3) ** 2, 0.501
            )
            # lambda, phi and p of the formula above.
            radiance = [end.source * arriving / (1.0 - last) for end in (incidence, viewing)]
            flux = viewing.source * arriving * 2.0 * np.pi * spread
            straight_flux = [end.flux * np.exp(-depth / end.cosine) for end in (incidence, viewing)]
            scattered = (flux + straight_flux[1]) * radiance[0] + straight_flux[0] * radiance[1]
            bound = (np.pi * scattered + straight) / (index**2 * from_below)
            best = np.fmin(
                best, np.where(brightest == 0, straight / (index**2 * from_below), bound)
            )
    return best


def _absorption(albedo: np.ndarray, thickness: np.ndarray) -> np.ndarray:
    """Least that the layers keep of unit radiance from below in all directions.

    A source q J <= q along each ray: what is lost is at least (1 - q) times the share of the ray
    within a layer.
    """
    # On the way up: the brightest layer met so far, and the optical depth covered.
    brightest = np.maximum.accumulate(albedo[:, ::-1], axis=1)
    within = np.cumsum(thickness[:, ::-1], axis=1)
    within[:, -1] *= 2.0  # after the interface through all of them again
    return np.max((1.0 - brightest) * -np.expm1(-within), axis=1)


def scattered_beyond_first(
    albedo: PerLayer,
    optical_thickness: PerLayer,
    ground_radiosity: tuple[PerStack, PerStack],
    refractive_index: PerStack,
    incidence: End,
    viewing: End,
) -> PerStack:
    """Ceiling of all light but that scattered once by a layer, or only by the ground; (stacks,).

    With J0 the field without scattering in the layers, the rest is 4 pi^2/n^2 times the integral
    over depth of q (J_I J0_F - g_I g_F), where J <= J0 + max J0 q_max/(1 - q_max) and J0 = g +
    ground's share b M/2.

    Args:
        albedo, optical_thickness: (stacks, layers).
        ground_radiosity: radiance b that leaves the ground without scattering in the layers, for
            unit irradiance by either end, (stacks,) each.
        refractive_index: n, (stacks,).
        incidence, viewing: the two ends, arrays (stacks,).
    """
    brightest = np.where(optical_thickness > 0, albedo, 0.0).max(axis=1, initial=0.0)
    # Integral of q M/2 <= q_max/4; of q g(s)/g(0) <= the scattering depth, or q_max mu.
    scattering = (albedo * optical_thickness).sum(axis=1)
    by_ground = np.minimum(scattering, 0.25 * brightest)
    by_beam = [np.minimum(scattering, brightest * end.cosine) for end in (incidence, viewing)]
    b_one, b_two = ground_radiosity
    g_one = incidence.source
    g_two = viewing.source
    # Scattering in the layers adds to J0 at most q/(1 - q) of its largest value.
    with np.errstate(divide="ignore", invalid="ignore"):
        again = brightest / (1.0 - brightest) * (g_one + b_one)
        repeated = np.where(brightest > 0, again * (g_two * by_beam[1] + b_two * by_ground), 0.0)
    # The beam of one end with the light that the ground sends to the other.
    crossed = g_one * b_two * np.minimum(by_beam[0], by_ground) + g_two * b_one * np.minimum(
        by_beam[1], by_ground
    )
    return 4.0 * np.pi**2 / refractive_index**2 * (repeated + crossed + b_one * b_two * by_ground)
