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

from ..common.linalg import einsum
from .bordered import Bordered, Diagonal, diagonal
from .effort import FluxEffort
from .ground import GroundTable, ground_operator
from .media import (
    Media,
    SharedSpread,
    in_medium,
    interface_reflectance,
    shared_directions,
)
from .scattering import Layers, ScaledScattering, azimuth_waves, scatter_between
from .single import ScatteredOnce, missing_once
from .solve import layer_operators
from .star_product import Slab, join, join_all, reflection_over, slab_of_layer


class FollowedDirections(NamedTuple):
    """One set of directions followed through all media."""

    cosines: Float[Array, "media d"]
    exists: Array | np.ndarray  # (media, d), boolean


class JoinedStack(NamedTuple):
    """A stack as operators on all modes, and what is needed to read them."""

    operator: Bordered
    """Reflection as seen from the air, or transmission to the medium below."""
    entering: Float[Array, "n"]
    """sqrt(n^2 mu w) of the nodes in the air."""
    leaving: Float[Array, "n"]
    """The same where the light leaves; both are 0 for nodes that do not exist there."""
    faces: Slab
    """The surfaces, air first, as the leading axis."""
    coats: Slab
    """The layers between them."""
    once: ScatteredOnce
    downward: bool


class _Discrete(NamedTuple):
    """A stack in the directions that its media share."""

    flux: np.ndarray  # n^2 mu w of the nodes
    followed: tuple[FollowedDirections, ...]  # of nodes, seen and lit light
    cosines: Diagonal  # their cosines in the layers, (layers, ...)
    scaled: ScaledScattering
    indices: np.ndarray  # from the air down
    effort: FluxEffort

    def operators(self, share: float | Array) -> tuple[Bordered, Bordered]:
        """R and U of shares of the layers."""
        cosines = Diagonal(*(c[:, None] for c in self.cosines))
        depth = (share * self.scaled.thickness)[:, None]
        operators = layer_operators(*self.scaled.rates(cosines), depth, self.effort)
        # Added directions count as of flux n^2 mu w = 1.
        n = self.indices[1 : 1 + len(depth), None, None]
        rows, columns = (jnp.asarray(1.0 / (n * jnp.sqrt(c))) for c in cosines[1:])
        reflection, loss = (x.reweight(rows, columns) for x in operators)
        return reflection, loss

    def roots(self, medium: int) -> Array:
        """sqrt(n^2 mu w) of the nodes, 0 of those that do not exist in a medium."""
        flux = self.flux * self.followed[0].exists[medium]
        return jnp.sqrt(jnp.asarray(flux, self.scaled.albedo.dtype))


def _discrete(
    layers: Layers,
    indices: np.ndarray,
    seen_in: tuple[Array, float],
    cos_incidence: Array,
    effort: FluxEffort,
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
    viewing = _ways(indices, *seen_in)
    incidence = _ways(indices, cos_incidence, 1.0)
    followed = FollowedDirections(jnp.asarray(mu, dtype), exists), viewing, incidence
    inner = slice(1, 1 + layers.albedo.size)
    inner_cosines = Diagonal(*(direction.cosines[inner] for direction in followed))
    roots = jnp.sqrt(jnp.asarray(weights[inner], dtype))
    scaled = scatter_between(layers, inner_cosines, roots, effort.terms, effort.modes)
    # An empty layer between faces that reflect totally would keep its light for ever.
    scaled = scaled._replace(thickness=scaled.thickness + 1e-12)
    return _Discrete(
        flux=common.flux,
        followed=followed,
        cosines=inner_cosines,
        scaled=scaled,
        indices=indices,
        effort=effort,
    )


def _pick(slabs: Slab, k: int | slice) -> Slab:
    """One of the slabs along the leading axis, or some."""
    return jax.tree.map(lambda leaf: leaf[k], slabs)


def _ground(discrete: _Discrete, layers: Layers, table: GroundTable | None) -> Bordered:
    """Light that the ground sends back into the last medium."""
    last = discrete.indices[-1]
    weights = [discrete.roots(-1) / last]
    weights += [
        jnp.full(direction.cosines.shape[1], 1.0 / last, layers.albedo.dtype)
        for direction in discrete.followed[1:]
    ]
    cosines = Diagonal(*(direction.cosines[-1] for direction in discrete.followed))
    return ground_operator(layers.ground, table, cosines, Diagonal(*weights), discrete.effort.modes)


def opened_stack(
    layers: Layers,
    media: Media,
    cos_inside: Float[Array, "v"],
    cos_incidence: Float[Array, "i"],
    effort: FluxEffort,
    cut: int,
    share: Array,
) -> tuple[Slab, Bordered, Float[Array, "n"]]:
    """Stack on a Lambertian ground, cut open in layer ``cut`` below a ``share`` of it.

    Args:
        cos_inside: cosines in that layer.
        The others as for `joined_stack`.

    Returns:
        From the air to the cut; what lies under the cut, ground and all, as it reflects; and
        sqrt(n^2 mu w) of the nodes that exist at the cut, 0 of the others.
    """
    indices = np.array((1.0, *media.layers))
    discrete = _discrete(layers, indices, (cos_inside, indices[1 + cut]), cos_incidence, effort)
    # Layers above the cut are wholly in the upper slab, those below it in the lower, the cut one in
    # both by its share.
    number = np.arange(len(media.layers))
    above_share = jnp.where(number < cut, 1.0, jnp.where(number > cut, 0.0, share))
    surfaces, _ = _surfaces(discrete)
    upper, lower = (slab_of_layer(*discrete.operators(p)) for p in (above_share, 1.0 - above_share))

    # From the air down to the cut.
    above = join(_pick(surfaces, 0), _pick(upper, 0))
    for k in range(1, cut + 1):
        above = join(join(above, _pick(surfaces, k)), _pick(upper, k))
    # From the ground up to the cut; the surface of the cut layer lies above it.
    below = _ground(discrete, layers, None)
    for k in range(len(media.layers) - 1, cut - 1, -1):
        slab = _pick(lower, k) if k == cut else join(_pick(surfaces, k), _pick(lower, k))
        below = reflection_over(slab, below)
    return above, below, discrete.roots(1 + cut)


def joined_stack(
    layers: Layers,
    media: Media,
    cos_viewing: Float[Array, "v"],
    cos_incidence: Float[Array, "i"],
    effort: FluxEffort,
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
        table: what the ground reflects in which direction; times the ground's reflectance.
            Lambertian without.
        downward: whether light is seen from below.
    """
    below = () if media.below is None else (media.below,)
    indices = np.array((1.0, *media.layers, *below))
    discrete = _discrete(
        layers,
        indices,
        (cos_viewing, indices[-1] if downward else 1.0),
        cos_incidence,
        effort,
    )
    # Each layer under the surface above it is one slab.
    surfaces, through = _surfaces(discrete)
    count = len(media.layers)
    coats = slab_of_layer(*discrete.operators(1.0))
    slab = join_all(join(_pick(surfaces, slice(count)), coats))
    # Below is a ground, or the surface to another medium.
    if media.below is None:
        operator = reflection_over(slab, _ground(discrete, layers, table))
    else:
        slab = join(slab, _pick(surfaces, -1))
        operator = slab.down if downward else slab.above

    # Into a layer through the surfaces above it; out through the same ones, or those below it.
    viewing, incidence = through
    into = jnp.cumprod(incidence, axis=0)[:count]
    out = (
        jnp.cumprod(viewing[::-1], axis=0)[::-1][1:]
        if downward
        else jnp.cumprod(viewing, axis=0)[:count]
    )
    # What the kept moments leave out of light scattered once is added by `factor`.
    once = ScatteredOnce(
        layers=layers,
        scaled=discrete.scaled,
        cos_seen=discrete.cosines.viewing,
        cos_lit=discrete.cosines.incidence,
        passing=out[:, :, None] * into[:, None, :] / np.array(media.layers)[:, None, None] ** 2,
    )
    return JoinedStack(
        operator=operator,
        entering=discrete.roots(0),
        leaving=discrete.roots(-1 if downward else 0),
        faces=surfaces,
        coats=coats,
        once=once,
        downward=downward,
    )


def factor(joined: JoinedStack, azimuth: Array) -> Float[Array, "v i k"]:
    """pi L_out/E_in for all pairs of directions and relative azimuths (radians), radiance in the
    medium of the eye.

    What goes straight through, or is mirrored by a surface inside, is not in it.
    """
    corner = joined.operator.corner
    waves = azimuth_waves(azimuth, corner.shape[0])
    all_light = 0.5 * einsum("mvi,mk->vik", corner, waves)
    return all_light + missing_once(joined.once, azimuth, waves, downward=joined.downward)


def flux_of_beam(joined: JoinedStack) -> Float[Array, "i"]:
    """Flux that leaves over flux of each beam; straight and mirrored light is in it."""
    operator = joined.operator
    return einsum("n,ni->i", joined.leaving, operator.columns[0]) + operator.incidence[0]


def flux_of_even_light(joined: JoinedStack) -> Float[Array, ""]:
    """Flux that leaves over flux of equal radiance from all directions of the air."""
    return 2.0 * einsum("i,ij,j->", joined.leaving, joined.operator.core[0], joined.entering)


def _ways(indices: np.ndarray, cosines: Array, known_in: float) -> FollowedDirections:
    """Cosines in every medium of directions known in one."""
    n = indices[:, None]
    # (n cos)^2 in each medium by Snell's law; the product keeps its digits between like indices.
    squared = (n - known_in) * (n + known_in) + (known_in * cosines) ** 2
    exists = squared > 0
    # A direction that does not exist is held as the vertical one, so that roots have finite slopes.
    return FollowedDirections(jnp.sqrt(jnp.where(exists, squared, n**2)) / n, exists)


def _surfaces(discrete: _Discrete) -> tuple[Slab, list[Array]]:
    """Surfaces between neighbouring media, (surfaces, modes, ...), and what they let through of
    seen and lit light.
    """
    above = []
    below = []
    through = []
    upper = discrete.indices[:-1, None]
    lower = discrete.indices[1:, None]
    for direction in discrete.followed:
        # Light that cannot go on in the other medium is totally reflected.
        on_both_sides = direction.exists[:-1] & direction.exists[1:]
        r = jnp.where(
            on_both_sides,
            interface_reflectance(upper, lower, direction.cosines[:-1], direction.cosines[1:]),
            1.0,
        )
        # What the outer surface reflects of light from the air is left out (see the module).
        outer = np.arange(len(upper))[:, None] == 0
        # From the side on which a direction does not exist no light comes.
        above.append(jnp.where(outer | ~direction.exists[:-1], 0.0, r))
        below.append(jnp.where(direction.exists[1:], r, 0.0))
        through.append(1.0 - r)

    def operator(entries: list[Array]) -> Bordered:
        # A smooth surface keeps every azimuth: the same in all modes.
        return jax.tree.map(
            lambda x: jnp.repeat(x[:, None], discrete.effort.modes, axis=1),
            diagonal(Diagonal(*entries)),
        )

    passing = operator(through)
    return Slab(operator(above), operator(below), passing, passing), through[1:]
