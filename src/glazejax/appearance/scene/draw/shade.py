"""Spectra of the points that rays meet, for all bands at once, only where a light falls or a mirror
shows something.

Work is done in lists of pairs of a point and a light that reaches it, material by material, so that
nothing is computed for shadows, for the far side of things or for what is not in the picture. Plain
JAX: a picture can be differentiated by spectra of materials and lights.
"""

from collections.abc import Iterator, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.scipy.ndimage import map_coordinates
from jaxtyping import Array, Float

from ..materials import Angles, Material, PairSpectra, PointSpectra, ThicknessMap
from .rays import Bounce, filled_size

# Pairs that go through the processor together; memory is this times the bands, a few times.
_CHUNK = 2**13
_SMALL = 2**9


@eqx.filter_jit
def _lit(
    material: Material,
    lights: Array,
    which: Array,
    strength: Array,
    view: Array,
    light: Array,
    between: Array,
    uv: Array,
) -> PairSpectra:
    """Light of each pair that reaches the eye."""
    depths = material.thickness_map
    thickness = jnp.zeros_like(view) if depths is None else sample_map(depths, uv)
    factor = material.direct(Angles(light, view, between, thickness))
    return strength[:, None] * factor * lights[which]


@eqx.filter_jit
def _mirror_light(material: Material, view: Array, beyond: Array) -> PointSpectra:
    return material.mirror(view) * beyond


def sample_map(values: ThicknessMap, uv: Float[Array, "points 2"]) -> Float[Array, "points"]:
    """A map at texture coordinates, bilinear between the middles of its pixels.

    The map repeats beyond 0 to 1; v runs upwards and the first row is on top.
    """
    rows, columns = values.shape
    wrapped = uv - jnp.floor(uv)
    # A coordinate of exactly 1 is the far edge, not the near one.
    u, v = jnp.where((wrapped == 0) & (uv > 0), 1.0, wrapped).T
    # A pixel's value is that of its middle; rows run down while v runs up.
    middles = [(1.0 - v) * rows - 0.5, u * columns - 0.5]
    return map_coordinates(jnp.asarray(values, uv.dtype), middles, order=1, mode="nearest")


def radiance(
    bounces: Sequence[Bounce],
    materials: Sequence[Material | None],
    lights: Float[Array, "lights bands"],
    background: Float[Array, "bands"],
) -> Float[Array, "rays bands"]:
    """Spectrum that comes along each ray of the first bounce.

    Args:
        bounces: of `rays.trace`.
        materials: prepared, in the order of the numbers in the bounces; None for those that are not
            seen.
        lights, background: spectra.

    Returns:
        (rays, bands), on the scale of the lights.
    """
    beyond: Array | None = None
    child: Bounce | None = None
    # From the last bounce back: what a mirror shows must be there before the mirror.
    for bounce in reversed(bounces):
        # Filled up to few sizes, so that few programs are compiled.
        empty = np.pad(
            bounce.material < 0, (0, filled_size(len(bounce.material)) - len(bounce.material))
        )
        spectra = jnp.where(jnp.asarray(empty)[:, None], background, jnp.zeros_like(lights[:1]))
        for number, material in enumerate(materials):
            if material is None:
                continue
            mine = np.flatnonzero(bounce.material == number)
            spectra = _add_lights(spectra, bounce, mine, material, lights)
            if child is not None and beyond is not None and material.is_mirror:
                spectra = _add_mirror(spectra, bounce, child, number, material, beyond)
        beyond = spectra
        child = bounce
    assert beyond is not None
    return beyond[: len(bounces[0].material)]


def _add_lights(
    spectra: Array, bounce: Bounce, mine: np.ndarray, material: Material, lights: Array
) -> Array:
    # Pairs of a point and a light that reaches it.
    pairs, which = np.nonzero(bounce.strength[mine] > 0)
    rows = mine[pairs]
    for piece, present in _pieces(rows.size):
        r = rows[piece]
        k = which[piece]
        # What is filled up has no strength.
        strength = np.where(present, bounce.strength[r, k], 0.0)
        numbers = (
            k,
            strength,
            bounce.cos_view[r],
            bounce.cos_light[r, k],
            bounce.between[r, k],
            bounce.uv[r],
        )
        spectra = spectra.at[r].add(_lit(material, lights, *map(jnp.asarray, numbers)))
    return spectra


def _add_mirror(
    spectra: Array, bounce: Bounce, child: Bounce, number: int, material: Material, beyond: Array
) -> Array:
    # Points of this material whose mirror reflection was followed.
    children = np.flatnonzero(bounce.material[child.parent] == number)
    for piece, present in _pieces(children.size):
        chosen = children[piece]
        rows = child.parent[chosen]
        mirrored = _mirror_light(material, jnp.asarray(bounce.cos_view[rows]), beyond[chosen])
        spectra = spectra.at[rows].add(jnp.where(present[:, None], mirrored, 0.0))
    return spectra


def _pieces(count: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Numbers below `count`, some at a time, filled up to few sizes with the first of them; and
    which are no filling.
    """
    for start in range(0, count, _CHUNK):
        size = _SMALL if count - start <= _SMALL else _CHUNK
        numbers = np.arange(start, start + size)
        present = numbers < count
        yield np.where(present, numbers, start), present
