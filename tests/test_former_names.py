"""Names that were changed work for one more version, and say what they are called now."""

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import numpy as np
import pytest

import glazefit
import glazejax as gj
from glazejax.former_names import accept_former_keywords, accept_name_first

FORMER_NAMES = {
    "Discrepancy": "ModelError",
    "FilmPrior": "Prior",
    "leave_films_out": "cross_validate",
    "mixture_of": "mix",
    "named_recipes": "recipes_from_names",
    "over_ground": "reading_over",
    "read_names": "read_recipes",
    "set_names": "set_labels",
}


@pytest.mark.parametrize(("old", "new"), FORMER_NAMES.items())
def test_a_former_name_warns_and_is_the_same(old, new):
    with pytest.warns(DeprecationWarning, match=f"glazefit.{old} is called glazefit.{new} now"):
        found = getattr(glazefit, old)
    assert found is getattr(glazefit, new)
    assert old not in dir(glazefit)


FORMER: dict[str, Any] = {"substrate": 0.3}


@accept_former_keywords(substrate="ground")
def _read(ground, *, wide=False):
    return ground, wide


def test_a_former_keyword_warns_and_arrives():
    with pytest.warns(DeprecationWarning, match="substrate of _read.. is called ground now"):
        assert _read(**FORMER, wide=True) == (0.3, True)


def test_a_former_keyword_beside_the_new_one_is_refused():
    with pytest.raises(TypeError, match="both are given"):
        _read(**FORMER, ground=0.4)


def test_the_prior_of_a_posterior_by_its_former_names():
    with pytest.warns(DeprecationWarning, match="FilmPrior is called glazefit.Prior now"):
        made = glazefit.FilmPrior  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.warns(DeprecationWarning, match="thickness_spread of __init__.. is called spread"):
        prior = made(thickness_spread=0.4)
    assert prior == glazefit.Prior(spread=0.4)
    assert (prior.concentration_sought, prior.concentration_known) == (0.4, 1.0)


@accept_name_first("names")
def _simulate(wavelengths, *, names):
    return wavelengths, names


def test_names_that_came_first_warn_and_arrive():
    for names in ("film", ["a", "b"]):
        with pytest.warns(DeprecationWarning, match="given by keyword now: names=..."):
            found = _simulate(names, (400.0, 500.0))  # pyright: ignore[reportCallIssue]
        assert found == ((400.0, 500.0), names)
    assert _simulate([400.0, 500.0], names=["a"]) == ([400.0, 500.0], ["a"])
    assert _simulate(np.ones(2), names=["a"])[1] == ["a"]


@pytest.mark.parametrize(
    ("function", "given", "complaint"),
    [
        (glazefit.find_recipes, {"max_layers": 9}, "max_coats is 9"),
        (glazefit.find_recipes, {"geometry": "sideways"}, "sideways"),
    ],
)
def test_former_keywords_of_recipes(function, given, complaint):
    with (
        pytest.warns(DeprecationWarning, match="is called (max_coats|instrument) now"),
        pytest.raises(ValueError, match=complaint),
    ):
        function((50, 0, 0), **given)


GRID = np.linspace(400.0, 700.0, 16)
BLUE = gj.Pigment("blue", GRID, np.linspace(1e4, 9e4, 16), np.linspace(5e4, 3e4, 16))
OLD_GLAZE: dict[str, Any] = {"layers": [gj.Layer(BLUE, 5e-6)], "substrate": 0.8}
OLD_GEOMETRY: dict[str, Any] = {"geometry": "45:0"}
OLD_PICTURE: dict[str, Any] = {"layers": [BLUE], "substrate": 0.8} | OLD_GEOMETRY


def test_a_glaze_by_its_former_names():
    new = gj.Glaze([gj.Layer(BLUE, 5e-6)], 0.8)
    with pytest.warns(DeprecationWarning, match="is called (coats|ground) now"):
        old = gj.Glaze(**OLD_GLAZE)
    assert eqx.tree_equal(old, new)
    with pytest.warns(DeprecationWarning, match="Glaze.layers is called coats now"):
        assert new.layers is new.coats
    with pytest.warns(DeprecationWarning, match="Glaze.substrate is called ground now"):
        assert new.substrate is new.ground


@pytest.mark.slow
def test_a_glaze_with_another_ground_by_its_former_name():
    glaze = gj.Glaze([gj.Layer(BLUE, 5e-6)], 0.8)
    with pytest.warns(DeprecationWarning, match="ground now"):
        changed = eqx.tree_at(lambda g: g.substrate, glaze, np.asarray(0.3))
    assert float(changed.ground) == 0.3

    assert eqx.tree_equal(replace(glaze, ground=np.asarray(0.3)), changed)

    def seen(glaze):
        return gj.reflectance(glaze, "45:0").sum()

    assert float(eqx.filter_jit(seen)(changed)) == pytest.approx(float(seen(changed)), rel=1e-6)
    grounds = np.array([0.1, 0.9])
    many = jax.vmap(lambda ground: seen(gj.Glaze(glaze.coats, ground)))(grounds)
    assert many.shape == (2,)
    assert float(eqx.filter_grad(seen)(changed).ground) > 0


def test_reflectance_and_picture_by_their_former_names():
    glaze = gj.Glaze([gj.Layer(BLUE, 5e-6)], 0.8)
    with pytest.warns(DeprecationWarning, match="geometry of reflectance.. is called instrument"):
        old = gj.reflectance(glaze, **OLD_GEOMETRY)
    np.testing.assert_array_equal(old, gj.reflectance(glaze, gj.Bidirectional(45.0, 0.0)))
    maps = [5e-6 * np.arange(1.0, 5.0).reshape(2, 2)]
    with pytest.warns(DeprecationWarning, match="of picture.. is called"):
        picture = gj.picture(thickness_maps=maps, **OLD_PICTURE)
    np.testing.assert_array_equal(picture.xyz, gj.picture([BLUE], maps, 0.8, None).xyz)


def test_grounds_from_air_by_its_former_keyword():
    with pytest.warns(DeprecationWarning, match="geometry of ground_from_air.. is called"):
        found = glazefit.ground_from_air(np.array(0.6), **OLD_GEOMETRY)
    np.testing.assert_array_equal(found, glazefit.ground_from_air(np.array(0.6), "45:0"))
