"""Light inside the layers: radiance in any direction at any depth.

surface     r, 1 - r
layers      cut at the depth asked for: a slab above,
------      down = (1 - R_above R_below)^-1 T,  up = R_below down
layers      and what reflects below
ground

Layers of different index have surfaces between them, on either side of the cut
(`joined.opened_stack`).
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.inputs import Numbers, check_values, concrete
from ..common.linalg import einsum
from .bordered import Bordered, Diagonal, diagonal
from .call import Indices, StackInputs, prepare
from .effort import FluxEffort, Solution
from .joined import opened_stack
from .media import Media
from .scattering import azimuth_waves
from .solve import Layers, discrete_stack, layer_operators
from .star_product import Slab, join, join_all, lambert, slab_of_layer, stack_reflection


class Field(NamedTuple):
    """Light at each depth for a beam of irradiance E on the surface."""

    down: Float[Array, "depths directions azimuths"]
    """pi L/E of scattered light that travels downwards."""
    up: Float[Array, "depths directions azimuths"]
    """The same upwards; the beam's mirror images are not in it, nor in ``down``."""
    beam: Float[Array, "depths"]
    """Share of E that goes on as the beam, with its images in surfaces between layers."""
    flux_down: Float[Array, "depths"]
    """Flux of all light downwards, over E."""
    flux_up: Float[Array, "depths"]
    """Flux of all light upwards, over E."""


def manyflux_field(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    depth: Numbers,
    cos_direction: Numbers,
    azimuth: Numbers = (0.0,),
    phase: Numbers | None = None,
    refractive_index: Indices = 1.5,
    cos_incidence: Numbers = 1.0,
    tolerance: float = 1e-6,
    streams: int | None = None,
    solution: Solution = "doubling",
) -> Field:
    """Field of one stack.

    Arguments that are not listed are as in `manyflux_reflectance_factor`, for one stack.

    Args:
        depth: optical depths below the surface, (depths,), from 0 to the whole thickness. Where
            layers have different indices they must be known, and a depth between two layers is in
            the lower one.
        cos_direction: cosines in the layer where the light is, (directions,), in (0, 1], for light
            downwards and upwards.
        azimuth: degrees, (azimuths,), 0 on the beam's side.
        cos_incidence: in air, ().

    Returns:
        `Field`.

    Raises:
        ValueError: as there, for a batch of stacks, a depth outside the layers, or, between layers
            of different index, depths that `jax.jit` traces.

    Notes:
        Where the phase function has more moments than are kept, light scattered by its forward peak
        counts as not scattered (delta-M); it is in ``beam`` and in the fluxes.
    """
    directions = np.atleast_1d(np.asarray(cos_direction, float))
    check_values({"cos_viewing": directions, "azimuth": azimuth})
    stack = StackInputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        phase=phase,
        refractive_index=refractive_index,
        tolerance=tolerance,
        streams=streams,
        solution=solution,
    )
    call = prepare(stack, {"cos_incidence": cos_incidence}, 0.0, cos_inside=directions)
    if call.batch:
        raise ValueError(
            f"the field is that of one stack; here are {call.batch} of them: use jax.vmap"
        )
    layers = jax.tree.map(lambda leaf: leaf[0], call.layers)
    dtype = layers.albedo.dtype
    depths = jnp.atleast_1d(jnp.asarray(depth, dtype))
    known_depths = concrete(depths)
    known_thickness = concrete(layers.optical_thickness)
    if known_depths is not None and known_thickness is not None:
        wrong = known_depths[
            ~((known_depths >= 0) & (known_depths <= known_thickness.sum() * (1 + 1e-9)))
        ]
        if wrong.size:
            raise ValueError(
                f"depth holds {wrong[0]}; it must be between 0 and the whole thickness "
                f"{known_thickness.sum():g}"
            )
    axes = jnp.asarray(directions, dtype), jnp.deg2rad(jnp.atleast_1d(jnp.asarray(azimuth, dtype)))
    lit = call.angles["cos_incidence"]
    media, effort, _ = call.settings
    if not isinstance(media, Media):
        return _field(layers, depths, axes, lit, media, effort)
    if known_depths is None or known_thickness is None:
        raise ValueError(
            "between layers of different index depth and optical_thickness must be known, not "
            "traced"
        )
    # Where a depth lies decides which surfaces are above it: one program a layer.
    tops = np.concatenate([[0.0], np.cumsum(known_thickness)[:-1]])
    cuts = np.searchsorted(tops, np.minimum(known_depths, known_thickness.sum()), side="right") - 1
    # The share of its layer that lies above each depth; of an empty layer none.
    shares = np.clip(
        (known_depths - tops[cuts])
        / np.where(known_thickness[cuts] > 0, known_thickness[cuts], 1.0),
        0.0,
        1.0,
    )
    fields = [
        _opened_field(
            layers=layers,
            shares=jnp.asarray(shares[cuts == cut], dtype),
            axes=axes,
            lit=lit,
            media=media,
            effort=effort,
            cut=cut,
        )
        for cut in np.unique(cuts).tolist()
    ]
    # Back to the order in which the depths came.
    order = np.argsort(cuts, kind="stable")
    back = np.argsort(order)
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[back], *fields)


@functools.partial(jax.jit, static_argnums=(4, 5))
def _field(
    layers: Layers,
    depths: Array,
    axes: tuple[Array, Array],
    lit: Array,
    index: float,
    effort: FluxEffort,
) -> Field:
    viewing, azimuth = axes
    modes = effort.modes
    stack = discrete_stack(layers, index, viewing, lit, effort, viewed_inside=True)
    a, b = stack.scaled.rates(stack.cosines)
    thickness = layers.optical_thickness
    top = jnp.cumsum(thickness) - thickness
    # The surface as a slab, without what it reflects of the light that falls in.
    surface = jax.tree.map(lambda x: jnp.broadcast_to(x, (modes, *x.shape)), stack.surface)
    passing = diagonal(Diagonal(*(1.0 - r for r in surface)))
    face = Slab(diagonal(surface).scaled(0.0), diagonal(surface), passing, passing)
    waves = azimuth_waves(azimuth, modes)
    # A perfect white has 2 sqrt(mu) sqrt(mu_0) in its corner (`lambert`), and pi L/E of 1.
    unit = 2.0 * stack.roots.viewing[:, None] * stack.roots.incidence

    def at(depth: Array) -> Field:
        # How much of each layer lies above, as a share that delta-M leaves as it is.
        above = jnp.clip(depth - top, 0.0, thickness)
        share = above / jnp.where(thickness > 0, thickness, 1.0)
        # What lies above the depth is one slab, what lies below it reflects; the light between them
        # goes to and fro.
        upper = layer_operators(a, b, (share * stack.scaled.thickness)[:, None], effort)
        lower = layer_operators(a, b, ((1.0 - share) * stack.scaled.thickness)[:, None], effort)
        slab = join(face, join_all(slab_of_layer(*upper)))
        below = stack_reflection(*lower, lambert(layers.ground, stack.roots, modes))
        return _between(slab, below, unit, stack.roots.nodes / stack.roots.incidence[0], waves)

    return jax.lax.map(at, depths)


@functools.partial(jax.jit, static_argnames=("media", "effort", "cut"))
def _opened_field(
    layers: Layers,
    shares: Array,
    axes: tuple[Array, Array],
    lit: Array,
    media: Media,
    effort: FluxEffort,
    cut: int,
) -> Field:
    """Field below shares of one layer of a stack of several indices."""
    viewing, azimuth = axes
    waves = azimuth_waves(azimuth, effort.modes)
    index = media.layers[cut]

    def at(share: Array) -> Field:
        # As in `_field`, where the operators count in directions that all media share.
        above, below, roots = opened_stack(
            layers=layers,
            media=media,
            cos_inside=viewing,
            cos_incidence=lit,
            effort=effort,
            cut=cut,
            share=share,
        )
        return _between(above, below, 2.0 / index**2, roots, waves)

    return jax.lax.map(at, shares)


def _between(
    above: Slab, below: Bordered, unit: float | Array, roots: Array, waves: Array
) -> Field:
    """Field between what lies above a depth and what reflects below it.

    Args:
        above, below: as operators.
        unit: of a radiance, (), or (directions, 1).
        roots: what a node's light counts in the flux, (nodes,).
        waves: of the azimuths.
    """
    # Light at the depth goes to and fro: what came through from above, times (1 - R_above
    # R_below)^-1.
    down = (above.below @ below).one_minus().inverse() @ above.down
    up = below @ down
    radiance = [
        einsum("mvi,mk->vik", operator.corner / unit, waves)[:, 0] for operator in (down, up)
    ]
    # The beam goes on by its diagonal and is in no radiance: fluxes add it.
    beams = [operator.incidence[0, 0] for operator in (down, up)]
    # Flux is in azimuth mode 0 alone; the others cancel over a turn.
    fluxes = [roots @ operator.columns[0, :, 0] for operator in (down, up)]
    return Field(
        down=radiance[0],
        up=radiance[1],
        beam=beams[0],
        flux_down=fluxes[0] + beams[0],
        flux_up=fluxes[1] + beams[1],
    )
