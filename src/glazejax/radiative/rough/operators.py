r"""A rough surface between air and paint as a matrix and vectors on the nodes of a `Basis`, made
once and kept.

Radiances are basic ones, L/n^2, and fluxes are counted in dm = 2 c dc in air and n^2 2 mu dmu in
the paint. The kernel K of a surface, averaged over azimuths, is symmetric then: L_out(x) = int K(x,
y) L_in(y) dm(y). With polynomials phi_j

    back_jk     = int int phi_j(mu) K(mu, mu') phi_k(mu') 2 mu dmu  n^2 2 mu' dmu'   paint -> paint
    enters_j(c) = n^2 int phi_j(mu) K(mu, c) 2 mu dmu                                air <-> paint.

K is what single facets do, and the compensation k(x) k(y)/C, where k(x) = 1 - int K_single(x, y)
dm(y) is lost by single facets and C = int k dm (C. Kulla, A. Conty, SIGGRAPH course 2017, here for
both sides at once). All energy is kept then: sum_j back_jk + int enters_k(c) 2 c dc/n^2 = int phi_k
2 mu dmu. The losses inside are computed from that.
"""

import functools
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from ...spectra import matmul
from ..common.fresnel import array_module, cos_refracted, dielectric_reflectance
from ..common.quadrature import gauss, gauss_crowded_at_ends
from ..common.simultaneous import fine_half_range
from .basis import Basis, Size, basis, lagrange
from .facets import Events, scatter

# Beams at a time: a few million facets.
_BEAMS = 16
# Below it the losses are the quadrature's own errors, which must not be spread: a roughness of some
# 5e-4.
_LEAST_CONSTANT = 1e-5
# Of the rule for a smooth surface.
_CROWDING = 6.0


class AirTable(NamedTuple):
    """Functions of the cosine c in air, as polynomials in arsinh(c/turn)."""

    turn: float
    values: Float[np.ndarray, "nodes columns"]

    def coordinate(self, cosine: Any) -> Any:
        """From cosines in [0, 1] to [0, 1]."""
        return array_module(cosine).arcsinh(cosine / self.turn) / float(np.arcsinh(1.0 / self.turn))

    def at(self, cosine: Any) -> Any:
        """Values at cosines (...): (..., columns)."""
        weights = lagrange(self.coordinate(cosine), self.values.shape[0])
        xp = array_module(weights)
        return matmul(xp, weights, xp.asarray(self.values, weights.dtype))


class Operators(NamedTuple):
    """A surface on the nodes of a basis."""

    refractive_index: float
    basis: Basis
    back: Float[np.ndarray, "n n"]
    """Paint to paint."""
    leaves: Float[np.ndarray, "n"]
    """n^2 times what leaves the paint of each polynomial: `enters` for light from everywhere."""
    table: AirTable | None
    """`enters` at cosines in air, and the loss of single facets in the last column; None for a
    smooth surface.
    """
    constant: float
    """C = int k dm, over both sides; 0 for a smooth surface."""

    def enters(self, cosine: Any) -> Any:
        """Light that enters the paint of a beam of one at cosines in air (...), on each polynomial:
        (..., n).
        """
        if self.table is not None:
            return self.table.at(cosine)[..., :-1]
        passing = 1.0 - dielectric_reflectance(cosine, self.refractive_index)
        return passing[..., None] * self.basis.values(cos_refracted(cosine, self.refractive_index))

    def loss(self, cosine: Any) -> Any:
        """Share k that single facets of a rough surface lose of a beam at cosines in air (...)."""
        assert self.table is not None
        return self.table.at(cosine)[..., -1]


@functools.lru_cache(maxsize=64)
def operators(index: float, roughness: float, size: Size) -> Operators:
    """The surface of one index and roughness."""
    nodes = basis(index, size)
    # A smooth surface reflects each direction into itself.
    if roughness == 0.0:
        fine = fine_half_range(index, _CROWDING)
        phi = nodes.values(fine.cosines)
        fluxes = 2.0 * fine.cosines * fine.weights
        back = phi.T @ (phi * (fluxes * fine.reflectance)[:, None])
        return Operators(
            refractive_index=index,
            basis=nodes,
            back=back,
            leaves=index**2 * (phi.T @ fluxes - back.sum(axis=0)),
            table=None,
            constant=0.0,
        )
    # Facets that reflect or let through once, from inside and from air.
    single = _single_back(index, roughness, nodes)
    turn = turning_point(roughness)
    outside, fluxes = air_rule(turn, size.incidence)
    entering, losses = _single_entering(index, roughness, nodes, outside)
    # Single facets lose light between them; what is missing on each side ...
    integrals = _integrals(nodes)
    missing = integrals - single.sum(axis=0) - fluxes @ entering / index**2
    constant = max(float(fluxes @ losses + index**2 * missing.sum()), _LEAST_CONSTANT)
    # ... comes back by a lobe that is its own product, so that reciprocity and energy hold.
    share = index**2 / constant
    back = single + share * np.outer(missing, missing)
    enters = entering + share * losses[:, None] * missing
    leaves = index**2 * (integrals - back.sum(axis=0))
    return Operators(
        refractive_index=index,
        basis=nodes,
        back=back,
        leaves=leaves,
        table=AirTable(turn, np.column_stack([enters, losses])),
        constant=constant,
    )


def turning_point(roughness: float) -> float:
    """Cosine in air about which facets begin to hide each other."""
    return min(max(roughness, 1e-3), 0.5)


def air_rule(turn: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Cosines in air, and the fluxes 2 c dc about them."""
    y, weights = gauss(count)
    span = np.arcsinh(1.0 / turn)
    # Evenly spread in arsinh(c/turn), in which `AirTable` interpolates.
    cosines = turn * np.sinh(span * y)
    return cosines, weights * 2.0 * cosines * turn * span * np.cosh(span * y)


def _integrals(nodes: Basis) -> np.ndarray:
    """int phi_j 2 mu dmu."""
    return 2.0 * nodes.weights * nodes.cosines


def _single_entering(
    index: float, roughness: float, nodes: Basis, outside: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`enters` of single facets, (beams, n), and what they lose, (beams,)."""
    entering = []
    losses = []
    for piece in _in_pieces(outside):
        scattered = scatter(piece, roughness, index, nodes.size.facets, from_paint=False)
        entering.append(_on_polynomials(nodes, scattered.refracted, scattered.refracted_share))
        losses.append(scattered.loss())
    return np.concatenate(entering), np.concatenate(losses)


def _single_back(index: float, roughness: float, nodes: Basis) -> np.ndarray:
    """`back` of single facets, symmetric."""
    beams, fluxes = _beams_inside(nodes)
    back = np.zeros((nodes.cosines.size,) * 2)
    for piece, flux in zip(_in_pieces(beams), _in_pieces(fluxes), strict=True):
        scattered = scatter(piece, roughness, index, nodes.size.facets, from_paint=True)
        to = _on_polynomials(nodes, scattered.reflected, scattered.reflected_share)
        # Out on one polynomial, in on another with the beam's flux.
        back += to.T @ (nodes.values(piece) * flux[:, None])
    # Reciprocal but for the quadrature's error.
    return 0.5 * (back + back.T)


def _on_polynomials(nodes: Basis, cosines: Events, shares: Events) -> Float[np.ndarray, "beams n"]:
    """Light of single facets on each polynomial; what points to the wrong side has a share of
    zero.
    """
    return np.einsum("bf,bfn->bn", shares, nodes.values(cosines))


def _beams_inside(nodes: Basis) -> tuple[np.ndarray, np.ndarray]:
    """Cosines in the paint, and the fluxes 2 mu dmu about them: a rule on each side of
    the split.
    """
    # Crowded at both ends: at grazing, and on both sides of the critical angle.
    x, x_weights = gauss_crowded_at_ends(nodes.size.beams)
    split = nodes.split
    cosines = np.concatenate([split * x, split + (1.0 - split) * x])
    return cosines, 2.0 * cosines * np.concatenate([split * x_weights, (1.0 - split) * x_weights])


def _in_pieces(array: np.ndarray) -> list[np.ndarray]:
    return np.array_split(array, -(-len(array) // _BEAMS))
