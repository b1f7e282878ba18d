import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit.film.model import response
from glazefit.film.model.optics import Optics
from glazefit.film.model.response import _NODES, HIGHEST, SHIPPED, _load_shipped, film_response
from glazefit.film.model.spline import BEND
from glazejax import Bidirectional, Hemispherical
from glazejax.geometry import Instrument
from glazejax.radiative.stack import stack_hemispherical_reflectance, stack_reflectance_factor

SPHERE = Hemispherical()


@pytest.fixture(scope="module")
def table():
    return film_response(SPHERE)


def random_films(count=500):
    kd, sd, ground = np.random.default_rng(5).uniform(size=(3, count))
    return 1e-7 * 1e9**kd, 1e-7 * 4e9**sd, ground


def solved(kd, sd, ground, solve=stack_hemispherical_reflectance, **options):
    depth = kd + sd
    albedo = sd / np.where(depth > 0, depth, 1.0)
    options = {"cos_incidence": SPHERE.cos_incidence, "tolerance": 1e-7} | options
    return np.asarray(solve(albedo[:, None], depth[:, None], ground, **options))


def test_equals_the_solver(table):
    films = random_films()
    assert_allclose(table.body(*films), solved(*films), atol=5e-6)


def test_clear_and_opaque_ends(table):
    kd = np.array([0.0, 0.0, 1e4, 0.0, 5.0])
    sd = np.array([0.0, 3.0, 0.0, 1e4, 1e5])
    ground = np.array([0.9, 0.9, 0.9, 0.0, 0.5])
    values = table.body(kd, sd, ground)
    # Beyond the table its ends hold: an opaque film's own k/s is then the end's, so only the first
    # three are exact.
    assert_allclose(values[:3], solved(kd, sd, ground)[:3], atol=5e-6)
    assert np.all(np.isfinite(values))
    # A spline through noughts is nought but for rounding.
    assert np.all((values > -1e-15) & (values < 1))


@pytest.mark.parametrize(("each", "library"), [(200, np), (300, jnp)])
def test_numpy_is_asked_for_few_films_alone(table, monkeypatch, each, library):
    """Not for few k d and few s d that make many films."""
    libraries = []
    look_up = response.look_up

    def noted(xp, *arguments):
        libraries.append(xp)
        return look_up(xp, *arguments)

    monkeypatch.setattr(response, "look_up", noted)
    thickness = np.geomspace(0.01, 10.0, each)
    black, _, _ = table.numbers(thickness[:, None], thickness)
    assert black.shape == (each, each)
    assert libraries == [library]


def test_slopes_equal_finite_differences_of_the_solver(table):
    films = np.array([[1e-3, 0.3, 2.0], [4.0, 0.2, 9.0]])
    ground = np.array([0.93, 0.5, 0.02])
    _, *slopes = table.body_and_slopes(*films, ground)
    for which, slope in enumerate(slopes):
        step = 1e-3 * films * (np.arange(2)[:, None] == which)
        up, down = (solved(k, s, ground, tolerance=1e-9) for k, s in (films + step, films - step))
        assert_allclose(slope, (up - down) / (2 * step[which]), rtol=2e-3, atol=1e-5)


def test_slopes_are_finite_at_the_ends(table):
    ends = np.array([[0.0, 0.0, 1e5, 0.0], [0.0, 1.0, 0.0, 1e5]])
    slopes = jax.jit(jax.grad(lambda k, s: jnp.sum(table.body(k, s, 0.9)), argnums=(0, 1)))(*ends)
    assert np.all(np.isfinite(slopes))


@pytest.mark.slow
def test_reflectance_factor():
    table = film_response(Instrument(Bidirectional(45, 0), 1.4))
    films = random_films(100)
    seen_by = {"refractive_index": 1.4, "cos_incidence": np.cos(np.pi / 4)}
    expected = solved(*films, stack_reflectance_factor, **seen_by)
    assert_allclose(table.body(*films), expected, atol=5e-6)


def test_many_angles_are_refused():
    with pytest.raises(ValueError, match="one angle of each kind, but incidence is an array"):
        film_response(Hemispherical([0.0, 8.0]))


@pytest.mark.parametrize("name", SHIPPED)
def test_tables_that_ship_are_the_solver_s(name):
    """At a hundred nodes, over three grounds: to rounding, not only to the solver's tolerance."""
    optics = Optics.of(SHIPPED[name])
    values = _load_shipped(optics)
    assert values is not None
    rows, columns = np.random.default_rng(2).integers(0, _NODES, (2, 100))
    rows[:4], columns[:4] = (0, 0, -1, -1), (0, -1, 0, -1)
    kd, sd = (
        BEND * np.expm1(np.linspace(0.0, np.log1p(highest / BEND), _NODES))[place]
        for highest, place in zip(HIGHEST, (rows, columns), strict=True)
    )
    grounds = np.array([0.0, 0.5, 1.0])
    black, gain, back = values[:, rows, columns, None]
    deep_k, deep_s = (jnp.asarray(depth[:, None, None]) for depth in (kd, sd))
    expected = optics.body(deep_k, deep_s, jnp.asarray(grounds), 1e-6)
    assert_allclose(black + gain * grounds / (1 - back * grounds), expected, atol=1e-9)


def test_other_instruments_ship_no_table():
    assert _load_shipped(Optics.of(Instrument(SPHERE, 1.51))) is None
    assert _load_shipped(Optics.of(Bidirectional(45, 1))) is None
    assert _load_shipped(Optics.of(Hemispherical(8.0, specular=False))) is not None


def test_slopes_from_one_look_are_those_of_tangents(table):
    """Also with no film, beyond the table, and over several grounds."""
    kd, sd, _ = (jnp.asarray(a) for a in random_films(60))
    # The last two are beyond one end each.
    kd = jnp.append(kd, jnp.array([0.0, 400.0, 3000.0]))
    sd = jnp.append(sd, jnp.array([0.0, 2000.0, 60.0]))
    ground = jnp.array([[0.02], [0.95]])
    look = jax.jit(lambda kd, sd: table.body_and_slopes(kd, sd, ground))
    values, by_k, by_s = look(kd, sd)
    seen, unit, none = lambda k, s: table.body(k, s, ground), jnp.ones_like(kd), jnp.zeros_like(kd)
    for tangent, slopes in (((unit, none), by_k), ((none, unit), by_s)):
        # No film is at the table's end, where a tangent is half the slope: a hair beyond it.
        film = (jnp.maximum(kd, 1e-13), jnp.maximum(sd, 1e-13))
        exact, expected = jax.jit(lambda film, along: jax.jvp(seen, film, along))(film, tangent)
        assert_allclose(values, exact, rtol=1e-9)
        assert_allclose(slopes, expected, rtol=1e-8, atol=1e-9)
    # Only k/s counts there: readings are those where the table ends, and do not change with depth.
    inside = table.body(jnp.array([200.0, 300.0]), jnp.array([1000.0, 6.0]), ground)
    assert_allclose(values[:, -2:], inside, rtol=1e-12)
    assert_allclose((kd * by_k + sd * by_s)[:, -2:], 0.0, atol=1e-15)
    assert np.all(by_k[:, -2:] < 0.0)
