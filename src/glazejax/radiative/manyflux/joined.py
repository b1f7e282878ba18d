"""Layers of any refractive indices joined with the smooth surfaces between them, as one slab or on
a ground.

    air              surface, Fresnel's reflectance and refraction
    layer 1, n_1     R, T
                     surface between n_1 and n_2
    layer 2, n_2     R, T
                     ground, or the surface to what lies below

All operators act on sqrt(mu w) I/n, in directions that all media share (`media`): then a surface is
diagonal, the n^2 by which radiance changes is in the weights, and everything is joined by the star
product. Added directions count as of flux n^2 mu w = 1. The outer surface's own reflection is left
out.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..common.phase import delta_m
from .bordered import Bordered, Diagonal, diagonal
from .effort import FluxEffort
from .ground import GroundTable, ground_operator
from .media import (
    Media,
    SharedDirections,
    SharedSpread,
    in_medium,
    interface_reflectance,
    shared_directions,
)
from .scattering import associated_legendre, azimuth_waves, rates, scattering
from .single import ScatteredOnce, missing_once
from .solve import Layers, layer_operators
from .star_product import Slab, join, join_all, slab_of_layer

# An empty layer between faces that reflect totally would keep its light for ever.
_THINNEST = 1e-12


class FollowedDirections(NamedTuple):
    """One set of directions followed through all media."""

    cosines: Float[Array, "media d"]
    exists: Array | np.ndarray  # (media, d), boolean


class JoinedStack(NamedTuple):
    """A stack as operators on all modes, and what is needed to read them."""

    slab: Slab
    """From air to the medium below, or to the ground, which is not yet in it."""
    ground: Bordered | None
    faces: Slab
    """The surfaces, air first, as the leading axis."""
    coats: Slab
    """The layers between them."""
    flux: Float[Array, "n"]
    """n^2 mu w of the nodes."""
    outside: np.ndarray
    """(n,), nodes that exist in the air."""
    beneath: np.ndarray
    """(n,), nodes that exist below."""
    once: ScatteredOnce
    even: Array
    odd: Array

    @property
    def reflection(self) -> Bordered:
        """Reflection as seen from the air."""
        if self.ground is None:
            return self.slab.above
        between = (self.slab.below @ self.ground).scaled(-1.0).plus_identity().inverse()
        return self.slab.above + self.slab.up @ (self.ground @ (between @ self.slab.down))


class OpenedStack(NamedTuple):
    """A stack cut inside one of its layers."""

    above: Slab
    """From the air to the cut."""
    below: Bordered
    """What lies under the cut, ground and all, as it reflects."""
    flux: Float[Array, "n"]
    """n^2 mu w of the nodes that exist at the cut, 0 of the others."""


class _Discrete(NamedTuple):
    """A stack in the directions that its media share, delta-M scaled."""

    common: SharedDirections
    nodes: FollowedDirections
    seen: FollowedDirections
    lit: FollowedDirections
    albedo: Array  # (layers,)
    thickness: Array  # (layers,)
    even: Array
    odd: Array
    a: Bordered
    b: Bordered
    rows: Array  # weights of added directions, see `Bordered.reweight`
    columns: Array

    def operators(self, thickness: Array, effort: FluxEffort) -> tuple[Bordered, Bordered]:
        """R and U of the layers at any thickness."""
        found = layer_operators(self.a, self.b, thickness[:, None], effort)
        reflection, loss = (x.reweight(self.rows, self.columns) for x in found)
        return reflection, loss


def _discrete(
    layers: Layers,
    indices: np.ndarray,
    seen_in: tuple[Array, float],
    cos_incidence: Array,
    effort: FluxEffort,
    modes: int,
) -> _Discrete:
    """Directions and scattering; indices from the air down, viewing as cosines and the index they
    are known in.
    """
    assert isinstance(effort.directions, SharedSpread)
    common = shared_directions(effort.directions)
    dtype = layers.albedo.dtype
    mu, weights, exists = (
        np.stack(x) for x in zip(*(in_medium(common, n) for n in indices), strict=True)
    )
    # All directions followed through all media; added ones are known in the eye's and in air.
    seen = _ways(seen_in[0], indices, seen_in[1])
    lit = _ways(cos_incidence, indices, 1.0)
    nodes = FollowedDirections(jnp.asarray(mu, dtype), exists)
    inner = slice(1, 1 + layers.albedo.size)
    in_layers = Diagonal(*(way.cosines[inner] for way in (nodes, seen, lit)))

    albedo, thickness, moments = delta_m(
        layers.albedo, layers.optical_thickness, layers.moments, effort.kept
    )
    thickness = thickness + _THINNEST
    # Scattering in each layer between its own cosines.
    tables = [associated_legendre(c, modes, moments.shape[-1]) for c in in_layers]
    roots = jnp.sqrt(jnp.asarray(weights[inner], dtype))
    even, odd = scattering(moments, tables[0], tables[1], tables[2], roots)
    each = Diagonal(*(c[:, None] for c in in_layers))
    a, b = rates(albedo[:, None], even, odd, each)
    # Added directions count as of flux n^2 mu w = 1.
    n = indices[inner][:, None, None]
    rows, columns = (jnp.asarray(1.0 / (n * jnp.sqrt(c))) for c in each[1:])
    return _Discrete(
        common=common,
        nodes=nodes,
        seen=seen,
        lit=lit,
        albedo=albedo,
        thickness=thickness,
        even=even,
        odd=odd,
        a=a,
        b=b,
        rows=rows,
        columns=columns,
    )


def _ground(
    found: _Discrete,
    layers: Layers,
    indices: Float[np.ndarray, "media"],
    table: GroundTable | None,
    modes: int,
) -> Bordered:
    """What the ground sends back into the last medium."""
    dtype = layers.albedo.dtype
    last = indices[-1]
    weights = [jnp.sqrt(jnp.asarray(found.common.flux * found.nodes.exists[-1], dtype)) / last]
    weights += [
        jnp.full(way.cosines.shape[1], 1.0 / last, dtype) for way in (found.seen, found.lit)
    ]
    cosines = Diagonal(*(way.cosines[-1] for way in (found.nodes, found.seen, found.lit)))
    return ground_operator(layers.ground, table, cosines, Diagonal(*weights), modes)


def opened_stack(
    layers: Layers,
    media: Media,
    cos_inside: Float[Array, "v"],
    cos_incidence: Float[Array, "i"],
    effort: FluxEffort,
    modes: int,
    cut: int,
    share: Array,
) -> OpenedStack:
    """Stack on a Lambertian ground, cut open in layer ``cut`` below a ``share`` of it.

    Args:
        cos_inside: cosines in that layer.
        The others as for `joined_stack`.
    """
    indices = np.array((1.0, *media.layers))
    found = _discrete(layers, indices, (cos_inside, indices[1 + cut]), cos_incidence, effort, modes)
    number = np.arange(len(media.layers))
    part = jnp.where(number < cut, 1.0, jnp.where(number > cut, 0.0, share))
    surfaces, _ = _surfaces(indices, found.nodes, found.seen, found.lit, modes)
    upper, lower = (
        slab_of_layer(*found.operators(p * found.thickness, effort)) for p in (part, 1.0 - part)
    )

    def pick(slabs: Slab, k: int) -> Slab:
        return jax.tree.map(lambda leaf: leaf[k], slabs)

    above = join(pick(surfaces, 0), pick(upper, 0))
    for k in range(1, cut + 1):
        above = join(join(above, pick(surfaces, k)), pick(upper, k))
    below = _ground(found, layers, indices, None, modes)
    for k in range(len(media.layers) - 1, cut - 1, -1):
        slab = pick(lower, k) if k == cut else join(pick(surfaces, k), pick(lower, k))
        between = (slab.below @ below).scaled(-1.0).plus_identity().inverse()
        below = slab.above + slab.up @ (below @ (between @ slab.down))
    flux = jnp.asarray(found.common.flux * found.nodes.exists[1 + cut], layers.albedo.dtype)
    return OpenedStack(above, below, flux)


def joined_stack(
    layers: Layers,
    media: Media,
    cos_viewing: Float[Array, "v"],
    cos_incidence: Float[Array, "i"],
    effort: FluxEffort,
    modes: int,
    *,
    table: GroundTable | None = None,
    downward: bool = False,
) -> JoinedStack:
    """Stack as operators.

    Args:
        layers: one stack, top first.
        media: static.
        cos_viewing: in air, or, if ``downward``, in the medium below.
        cos_incidence: in air.
        effort: its directions are `SharedSpread`.
        modes: number of azimuth modes.
        table: what the ground reflects in which direction; times the ground's reflectance.
            Lambertian without.
        downward: whether light is seen from below.
    """
    below = () if media.below is None else (media.below,)
    indices = np.array((1.0, *media.layers, *below))
    found = _discrete(
        layers,
        indices,
        (cos_viewing, indices[-1] if downward else 1.0),
        cos_incidence,
        effort,
        modes,
    )
    common = found.common
    nodes = found.nodes
    seen = found.seen
    lit = found.lit
    dtype = layers.albedo.dtype
    exists = np.asarray(nodes.exists)
    inner = slice(1, 1 + len(media.layers))
    in_layers = Diagonal(*(way.cosines[inner] for way in (nodes, seen, lit)))
    reflection, loss = found.operators(found.thickness, effort)

    # Each layer under the surface above it is one slab.
    surfaces, through = _surfaces(indices, nodes, seen, lit, modes)
    count = len(media.layers)
    upper: Slab = jax.tree.map(lambda leaf: leaf[:count], surfaces)
    coats = slab_of_layer(reflection, loss)
    slab = join_all(join(upper, coats))
    # Below is a ground, or the surface to another medium.
    ground = None
    if media.below is None:
        ground = _ground(found, layers, indices, table, modes)
    else:
        slab = join(slab, jax.tree.map(lambda leaf: leaf[-1], surfaces))

    # What the kept moments leave out of light scattered once is added by `factor`.
    size = len(common.flux)
    once = ScatteredOnce(
        albedo=layers.albedo,
        thickness=layers.optical_thickness,
        moments=layers.moments,
        scaled_albedo=found.albedo,
        scaled_thickness=found.thickness,
        cos_seen=in_layers.viewing,
        cos_lit=in_layers.incidence,
        passing=_passing(through, indices[inner], count, downward),
    )
    return JoinedStack(
        slab=slab,
        ground=ground,
        faces=surfaces,
        coats=coats,
        flux=jnp.asarray(common.flux, dtype),
        outside=exists[0],
        beneath=exists[-1],
        once=once,
        even=found.even[..., size:, size:],
        odd=found.odd[..., size:, size:],
    )


def factor(
    joined: JoinedStack, azimuth: Array, modes: int, *, downward: bool = False
) -> Float[Array, "v i k"]:
    """pi L_out/E_in for all pairs of directions and relative azimuths (radians), radiance in the
    medium of the eye.

    What goes straight through, or is mirrored by a surface inside, is not in it.
    """
    operator = joined.slab.down if downward else joined.reflection
    waves = azimuth_waves(azimuth, modes)
    all_light = 0.5 * jnp.einsum("mvi,mk->vik", operator.corner, waves, precision="highest")
    return all_light + missing_once(
        joined.once, joined.even, joined.odd, azimuth, waves, downward=downward
    )


def flux_of_beam(joined: JoinedStack, *, downward: bool = False) -> Float[Array, "i"]:
    """Flux that leaves over flux of each beam; straight and mirrored light is in it."""
    operator, leaving = _side(joined, downward)
    return jnp.einsum("n,ni->i", jnp.sqrt(leaving), operator.columns[0]) + operator.incidence[0]


def flux_of_even_light(joined: JoinedStack, *, downward: bool = False) -> Float[Array, ""]:
    """Flux that leaves over flux of equal radiance from all directions of the air."""
    operator, leaving = _side(joined, downward)
    entering = jnp.sqrt(jnp.where(joined.outside, joined.flux, 0.0))
    return 2.0 * jnp.einsum(
        "i,ij,j->", jnp.sqrt(leaving), operator.core[0], entering, precision="highest"
    )


def _side(joined: JoinedStack, downward: bool) -> tuple[Bordered, Array]:
    if downward:
        return joined.slab.down, jnp.where(joined.beneath, joined.flux, 0.0)
    return joined.reflection, jnp.where(joined.outside, joined.flux, 0.0)


def _ways(cosines: Array, indices: np.ndarray, known_in: float) -> FollowedDirections:
    """Cosines in every medium of directions known in one."""
    n = indices[:, None]
    squared = (n - known_in) * (n + known_in) + (known_in * cosines) ** 2
    exists = squared > 0
    return FollowedDirections(jnp.sqrt(jnp.where(exists, squared, n**2)) / n, exists)


def _surfaces(
    indices: np.ndarray,
    nodes: FollowedDirections,
    seen: FollowedDirections,
    lit: FollowedDirections,
    modes: int,
) -> tuple[Slab, list[Array]]:
    """Surfaces between neighbouring media, (surfaces, modes, ...), and what they let through of
    seen and lit light.
    """
    above = []
    below = []
    through = []
    upper = indices[:-1, None]
    lower = indices[1:, None]
    for way in (nodes, seen, lit):
        both = way.exists[:-1] & way.exists[1:]
        r = jnp.where(
            both, interface_reflectance(upper, lower, way.cosines[:-1], way.cosines[1:]), 1.0
        )
        outer = np.arange(len(upper))[:, None] == 0
        # From the side on which a direction does not exist no light comes.
        above.append(jnp.where(outer | ~way.exists[:-1], 0.0, r))
        below.append(jnp.where(way.exists[1:], r, 0.0))
        through.append(1.0 - r)

    def operator(entries: list[Array]) -> Bordered:
        made = diagonal(Diagonal(*entries))
        return jax.tree.map(
            lambda x: jnp.broadcast_to(x[:, None], (x.shape[0], modes, *x.shape[1:])), made
        )

    passing = operator(through)
    return Slab(operator(above), operator(below), passing, passing), through[1:]


def _passing(
    through: list[Array], indices: np.ndarray, count: int, downward: bool
) -> Float[Array, "layers v i"]:
    """What the surfaces let through to each layer and out again, over n^2."""
    seen, lit = through
    into = jnp.cumprod(lit, axis=0)[:count]
    out = (
        jnp.cumprod(seen[::-1], axis=0)[::-1][1:] if downward else jnp.cumprod(seen, axis=0)[:count]
    )
    return out[:, :, None] * into[:, None, :] / indices[:, None, None] ** 2
