"""A varnish on top of paint: a coat that absorbs, hardly scatters, and that nobody may have
mentioned.

A coat of optical thickness tau and of the paint's own index changes a reading exactly as a film
without scattering does that lies on the paint: both are in `FilmResponse`. Seen from below, all of
the paint is one Lambertian ground.
"""

from typing import TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from glazejax.spectra import Bands

from .response import FilmResponse, ground_below, over_ground

DECAY = 60.0
"""Wavelengths over which a yellowed resin's absorption falls to 1/e, nm."""
AMOUNTS = {"thin": (0.2, 0.15), "yellowed": (0.6, 0.3)}
"""Varnishes that are seen -> optical thickness at 400 nm, and its standard deviation: what is
between them is left open.
"""
# Internal reflectances of paint, with what noise may feign.
_PAINT = (-0.5, 1.0)

BodySpectra: TypeAlias = Float[np.ndarray, "*n bands"]
"""Readings without the surface's part."""


def yellow(wavelengths: Bands, decay: float = DECAY) -> Bands:
    """Absorption of a yellowed varnish in units of that at 400 nm: it falls exponentially to the
    red.
    """
    return np.exp((400.0 - np.maximum(wavelengths, 360.0)) / decay)


def under_varnish(
    response: FilmResponse,
    body: BodySpectra,
    thickness: Bands,
) -> BodySpectra:
    """Reading of a paint under a varnish, from that without it; both without the surface's part.

    Args:
        response: of the instrument.
        body: reading without varnish.
        thickness: optical thickness of the varnish, 0 or more.
    """
    return _change_coat(response, body, before=np.zeros_like(thickness), after=thickness)


def without_varnish(
    response: FilmResponse,
    body: BodySpectra,
    thickness: Bands,
) -> BodySpectra:
    """The inverse of `under_varnish`: what the paint would read if its varnish were taken off."""
    return _change_coat(response, body, before=thickness, after=np.zeros_like(thickness))


def _change_coat(
    response: FilmResponse, body: BodySpectra, *, before: Bands, after: Bands
) -> BodySpectra:
    """Reading of what lies below one varnish under another one in its place."""
    dark, gain, back = _through(response, before)
    below = ground_below(np.asarray(body) - dark, gain, back)
    return over_ground(*_through(response, after), below)


def limits_under(response: FilmResponse, thickness: Bands) -> tuple[Bands, Bands]:
    """Least and largest reading of paint under a varnish, outer surface aside: beyond, the inverse
    of `under_varnish` makes any number.
    """
    numbers = _through(response, thickness)
    low, high = (over_ground(*numbers, below) for below in _PAINT)
    return low, high


def _through(
    response: FilmResponse, thickness: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Black, gain and back of a coat that only absorbs."""
    absorbs = jnp.asarray(thickness, float)
    black, gain, back = (
        np.asarray(a, np.float64) for a in response.numbers(absorbs, jnp.zeros_like(absorbs))
    )
    return black, gain, back
