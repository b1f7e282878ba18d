"""A varnish that is put on and taken off, against the solver's coat on top."""

import jax.numpy as jnp
import numpy as np
import pytest

from glazefit.film.optics import Optics
from glazefit.film.response import film_response
from glazefit.film.varnish import DECAY, varnished, without_varnish, yellow
from glazejax import Bidirectional, Hemispherical

GRID = np.arange(400.0, 701.0, 10.0)
WHITE = 0.9


@pytest.mark.parametrize("geometry", [Hemispherical(), Bidirectional(45, 0)], ids=["d8", "45:0"])
def test_varnish_on_a_diffuse_white_is_a_coat_that_only_absorbs(geometry):
    """A Lambertian white under a clear coat: what the table says is what the solver says of the stack."""
    response, optics = film_response(geometry), Optics.of(geometry, 1.5)
    coat = 0.4 * yellow(GRID)
    bare = np.asarray(response.body(np.zeros_like(GRID), np.zeros_like(GRID), WHITE))
    depth, ground = jnp.asarray(coat)[:, None], jnp.full(GRID.size, WHITE)
    solved = np.asarray(optics.body(depth, 0.0 * depth, ground, 1e-7))
    np.testing.assert_allclose(varnished(response, bare, coat), solved, atol=3e-5)


def test_varnish_comes_off_again():
    response, coat = film_response(Hemispherical()), 0.8 * yellow(GRID)
    body = np.linspace(0.02, 0.85, GRID.size)
    np.testing.assert_allclose(without_varnish(response, varnished(response, body, coat), coat), body, atol=1e-9)
    # The blue end loses more than the red.
    lost = varnished(response, body, coat) / body
    assert lost[0] < 0.5 * lost[-1]


def test_yellow_falls_by_e_over_its_length():
    assert yellow(np.array([400.0, 400.0 + DECAY])) == pytest.approx([1.0, np.exp(-1.0)])
