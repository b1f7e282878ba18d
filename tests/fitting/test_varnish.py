"""A varnish that is put on and taken off, against the solver's coat on top."""

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit import identify
from glazefit.film.model.optics import Optics
from glazefit.film.model.response import film_response
from glazefit.film.model.varnish import AMOUNTS, DECAY, under_varnish, without_varnish, yellow
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.search.searcher import Searcher
from glazefit.identify.search.task import Measured
from glazefit.identify.search.unstated_conditions import remove_varnish
from glazejax import Bidirectional, Hemispherical, catalogue
from glazejax.geometry import resolve_instrument

GRID = np.arange(400.0, 701.0, 10.0)
WHITE = 0.9


@pytest.fixture(scope="module")
def sphere():
    return film_response(Hemispherical())


@pytest.fixture(scope="module")
def paints():
    return [catalogue.pigment(name) for name in ("ZincWhite", "PrussianBlue")]


@pytest.mark.parametrize("geometry", [Hemispherical(), Bidirectional(45, 0)], ids=["d8", "45:0"])
def test_varnish_on_a_diffuse_white_is_a_coat_that_only_absorbs(geometry):
    """A Lambertian white under a clear coat: what the table says is what the solver says of the
    stack.
    """
    response, optics = film_response(geometry), Optics.of(geometry)
    coat = 0.4 * yellow(GRID)
    bare = np.asarray(response.body(np.zeros_like(GRID), np.zeros_like(GRID), WHITE))
    depth = jnp.asarray(coat)[:, None]
    solved = optics.body(depth, 0.0 * depth, jnp.full(GRID.size, WHITE), 1e-7)
    assert_allclose(under_varnish(response, bare, coat), solved, atol=3e-5)


def test_varnish_comes_off_again(sphere):
    coat = 0.8 * yellow(GRID)
    body = np.linspace(0.02, 0.85, GRID.size)
    read = under_varnish(sphere, body, coat)
    assert_allclose(without_varnish(sphere, read, coat), body, atol=1e-9)
    # The blue end loses more than the red.
    lost = read / body
    assert lost[0] < 0.5 * lost[-1]


def read_as(reading, noise):
    """A film over white, with the surface."""
    whole = np.broadcast_to(reading, (1, 1, GRID.size))
    return Measured(
        names=("film",),
        wavelengths=GRID,
        readings=whole,
        grounds=np.full_like(whole, WHITE),
        noise_sd=np.full_like(whole, noise),
        doubt=np.empty((1, 0, 1, GRID.size)),
    )


@pytest.mark.parametrize("reading", [0.0, 0.039, 0.95])
def test_a_film_that_no_paint_under_a_varnish_reads_is_finite(sphere, reading):
    """Brighter in the blue than any paint under the varnish is not possible; darker may be noise."""
    found, change = remove_varnish(read_as(reading, 1e-4), sphere, 0.04, "yellowed")
    for values in (found.readings, found.noise_sd, found.doubt):
        assert np.isfinite(values).all()
    assert (found.noise_sd > 0).all()
    assert np.isnan(change).all() == (reading > 0.9)


def test_a_film_taken_from_under_a_varnish_keeps_what_is_not_known(sphere):
    """Readings as of the bare film; noise, doubt and volume by finite differences of taking the
    varnish off.
    """
    surface, noise = 0.04, 1e-3
    body = np.linspace(0.1, 0.8, GRID.size)
    spreads = {}
    for name, (level, _) in AMOUNTS.items():
        read = under_varnish(sphere, body, level * yellow(GRID))
        found, change = remove_varnish(read_as(read + surface, noise), sphere, surface, name)
        assert_allclose(found.readings[0, 0], body + surface, atol=1e-9)

        def off(change, depth, read=read):
            return without_varnish(sphere, read + change, depth * yellow(GRID))

        slope = (off(1e-5, level) - off(-1e-5, level)) / 2e-5
        assert_allclose(found.noise_sd[0, 0], noise * slope, rtol=1e-3)
        assert_allclose(change[0, 0], slope, rtol=1e-3)
        by_level = (off(0.0, level + 1e-4) - off(0.0, level - 1e-4)) / 2e-4
        ratio = found.doubt[0, 0, 0] / by_level
        assert_allclose(ratio, ratio.mean(), rtol=0.02)
        spreads[level] = ratio.mean()
    # A standard deviation less is still a varnish, and the two levels leave no gap.
    assert all(0.0 < spread < level for level, spread in spreads.items())
    assert 0.2 + spreads[0.2] > 0.6 - spreads[0.6]


def test_yellow_falls_by_e_over_its_length():
    assert yellow(np.array([400.0, 400.0 + DECAY])) == pytest.approx([1.0, np.exp(-1.0)])


def film_of(paint, depth, sphere):
    """Reflectance of a film of one paint over white, without its surface."""
    return np.asarray(sphere.body(paint.absorption * depth, paint.scattering * depth, WHITE))


@pytest.mark.parametrize(
    ("stated", "under"), [("none", False), ("thin", True), ("unknown", True), ("yellowed", True)]
)
def test_what_is_stated_of_a_varnish_says_what_is_tried(sphere, paints, stated, under):
    """A film of one paint under a varnish: nobody sees a varnish who states that there is none."""
    grid = paints[0].wavelengths
    coat = (0.6 if stated == "yellowed" else 0.2) * yellow(grid)
    body = under_varnish(sphere, film_of(paints[0], 60e-6, sphere), coat)
    seen = body + resolve_instrument(None).seen_surface
    found = identify(grid, seen, paints, ground=WHITE, max_paints=1, varnish=stated)
    best = found.ranked(0)[0]
    assert ("varnish" in best.condition) == under
    if stated in ("thin", "yellowed"):
        assert best.paints == ("ZincWhite",)
        assert found.none[0] < 0.5


def test_a_film_over_another_ground_is_without_the_stated_varnish_too(paints):
    """A green that neither paint reads, so that other grounds are tried: all that is not under the
    stated varnish weighs a twentieth of what it does where there is none.
    """
    grid = np.asarray(paints[0].wavelengths)
    green = 0.06 + 0.6 * np.exp(-(((grid - 530.0) / 30.0) ** 2))

    def weights(varnish):
        options = IdentificationOptions(max_paints=1, varnish=varnish)
        searcher = Searcher.of(grid, paints, options)
        ((_, pool, _),) = searcher.search(searcher.measure(green, WHITE))
        films = zip(pool.members[0, :, 0], pool.condition[0], pool.log_weight[0], strict=True)
        return {(paint, lies): weight for paint, lies, weight in films if np.isfinite(weight)}

    bare, stated = weights("none"), weights("yellowed")
    # As stated, hiding its ground, over a lighter one and over a darker one.
    assert len({condition for _, condition in bare}) == 4
    for key, weight in bare.items():
        assert stated[key] - weight == pytest.approx(np.log(0.05))


@pytest.mark.slow
def test_a_stated_varnish_that_is_not_there_weighs_little(sphere):
    paints = list(catalogue.load("oils").values())[:4]
    grid = paints[0].wavelengths
    seen = film_of(paints[0], 40e-6, sphere) + resolve_instrument(None).seen_surface

    def chance_without(stated):
        found = identify(grid, seen, paints, ground=WHITE, max_paints=1, varnish=stated)
        return sum(c.probability for c in found.ranked(0) if not c.condition)

    assert chance_without("yellowed") < chance_without("none")
