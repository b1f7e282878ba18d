"""A stack as its ground meets it: three functions that say the reflectance over any Lambertian
ground exactly.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..common.inputs import BatchOfStacks, Numbers
from .body import Lit, Surface, reflectance
from .reflectance import by_index, lit_stacks
from .resolution import check_surface


class Ports(NamedTuple):
    """R = dark + g incidence viewing/(1 - g back) over a ground of reflectance g; a pytree of
    arrays (...).
    """

    dark: Float[Array, "*batch"]
    """Over a black ground, R0."""
    incidence: Float[Array, "*batch"]
    """T(i): the share of the beam's flux that reaches a black ground, over the refractive
    index n.
    """
    viewing: Float[Array, "*batch"]
    """T(o), the same function of the viewing direction: n times the radiance that is seen of a
    ground of radiance one. For the hemispherical reflectance n times the share of a Lambertian
    ground's flux that leaves."""
    back: Float[Array, "*batch"]
    """S: the share of the ground's flux that comes back to it."""

    def reflectance(self, ground: Numbers) -> Float[Array, "*all"]:
        """Reflectance over grounds (...) that broadcast against the batch."""
        ground = jnp.asarray(ground, self.dark.dtype)
        return self.dark + ground * self.incidence * self.viewing / (1.0 - ground * self.back)


def rough_ports(
    albedo: Numbers,
    optical_thickness: Numbers,
    *,
    roughness: float = 0.0,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers | None = 1.0,
    tolerance: float = 1e-4,
) -> Ports:
    """The body of a stack of layers, under a rough or a smooth surface, for any ground.

    ``rough_ports(...).reflectance(g)`` is `rough_reflectance_factor` over the ground g.

    Args, raises as for `rough_reflectance_factor`, but the ground. With ``cos_viewing=None`` it is
    the hemispherical reflectance. ``incidence`` depends on no viewing direction, ``viewing`` on no
    incidence, ``back`` on neither, and
    ``incidence`` and ``viewing`` are one function of the cosine where both are directions.

    Returns:
        `Ports` of arrays in the shape of the broadcast batch. Their derivatives are right, too.

    Source: the invariant embedding of a Lambertian ground, S. Chandrasekhar, Radiative Transfer
    (1960), section 72.
    """
    check_surface(roughness, refractive_index)
    arguments = {
        "albedo": albedo,
        "optical_thickness": optical_thickness,
        "substrate_reflectance": 0.0,
        "cos_incidence": cos_incidence,
    }
    if cos_viewing is not None:
        arguments["cos_viewing"] = cos_viewing

    def one(stacks: BatchOfStacks, surface: Surface) -> Ports:
        ports = _ports(lit_stacks(stacks.flat(), surface), surface)
        return jax.tree.map(lambda leaf: leaf.reshape(stacks.batch), ports)

    return by_index(arguments, roughness, refractive_index, tolerance, one)


@functools.partial(jax.jit, static_argnums=1)
def _ports(lit: Lit, surface: Surface) -> Ports:
    nothing = jnp.zeros_like(lit.ground)
    everything = jnp.ones_like(lit.ground)
    dark = lit._replace(ground=nothing)
    white = lit._replace(ground=everything)
    unlit = jnp.zeros_like(lit.enters[:, 0])

    def on_ground(enters: Array, starts: Array) -> Array:
        """Reflectance of a white ground in light that enters from above, or starts on it."""
        ends = jnp.stack([enters, unlit], axis=1), jnp.stack([starts, everything], axis=1)
        return reflectance(white._replace(enters=ends[0], from_ground=ends[1]), surface)

    itself = on_ground(unlit, everything)
    n = surface.refractive_index
    # In the solver's units a white ground shows 4/(1 - S) of itself, and 2 n T/(1 - S) of light
    # from above.
    light, view = (2.0 * on_ground(lit.enters[:, beam], nothing) / (n * itself) for beam in (0, 1))
    return Ports(reflectance(dark, surface) / n**2, light, view, 1.0 - 4.0 / itself)
