"""Recipes of unmixed coats: each tube as it is."""

import itertools
from io import StringIO
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from rich.console import Console

import glazejax as gj
from glazefit import find_recipes, lab_target, spectral_target
from glazefit.recipe.refine import enlargements, merge_coats
from glazefit.recipe.report import print_best, print_recipes
from glazefit.recipe.task import RecipeTask, make_task
from glazejax import colour

from .palette import GRID, PALETTE

SEEN = gj.Bidirectional(45, 0)
WHITE, BLACK, RED, YELLOW, BLUE = PALETTE


def said(show, *what):
    page = StringIO()
    show(*what, Console(file=page, width=200))
    return " ".join(page.getvalue().split())


def recipes_of_coats(**options):
    """For what two unmixed coats reflect, and for a pink that only a mixture gives in one coat or
    two.
    """
    coats = [gj.Layer(RED, 1.5e-6), gj.Layer(WHITE, 12e-6)]
    made = np.asarray(gj.reflectance(gj.Glaze(coats, 0.9), SEEN))
    targets = [spectral_target(GRID, made, name="made"), lab_target((35, 5, -5), "plum")]
    return find_recipes(targets, PALETTE, glazes=True, **options)


@pytest.fixture(scope="module")
def found():
    """Of fewer coats than it would try: each number of coats is a program of its own."""
    return recipes_of_coats(max_coats=2)


@pytest.mark.slow
def test_six_coats_are_tried_and_come_as_near(found):
    six = recipes_of_coats()
    assert all(len(recipe.coats) <= 6 for recipe in itertools.chain(*six))
    for more, fewer in zip(six, found, strict=True):
        assert more[0].distance < fewer[0].distance + 0.05


@pytest.mark.slow
def test_every_coat_is_one_paint_and_no_two_alike_touch(found):
    for recipe in itertools.chain(*found):
        assert 1 <= len(recipe.coats) <= 2
        names = [coat.name for coat in recipe.coats]
        assert all(len(coat.parts) == 1 for coat in recipe.coats)
        assert all(upper != lower for upper, lower in itertools.pairwise(names))
        assert recipe.converged


@pytest.mark.slow
def test_a_stack_of_unmixed_coats_is_found_again(found):
    assert found[0][0].distance < 0.5
    assert max(len(recipe.coats) for recipe in found[0]) >= 2


@pytest.mark.slow
def test_what_mixing_would_gain_is_a_recipe_of_its_own(found):
    for recipes in found:
        mixed = recipes[0].mixed
        assert all(recipe.mixed is mixed for recipe in recipes)
        own = colour.lab(GRID, gj.reflectance(mixed.glaze, SEEN))
        wanted = mixed.target.lab("D65", colour.CIE_1931)
        assert mixed.distance == pytest.approx(float(colour.delta_e_2000(own, wanted)), abs=0.01)
        assert len(mixed.coats) <= 2
        assert len(mixed.paints) <= 3


@pytest.mark.slow
def test_the_answer_says_what_mixing_would_gain(found):
    for recipes in found:
        here, mixed = min(recipe.distance for recipe in recipes), recipes[0].mixed.distance
        assert f"ΔE00 {mixed:.2f} instead of {here:.2f}" in said(print_recipes, recipes)
    table = said(print_best, found)
    assert "if mixed" in table
    assert "Mixed within a coat: ΔE00" in table


def task(glazes: bool = True, **others: Any) -> RecipeTask:
    return make_task([lab_target((50, 0, 0))], PALETTE, glazes=glazes, **others)


def test_limits_of_unmixed_coats():
    assert (task().max_coats, task().max_paints) == (6, 5)
    mixed = task().mixed
    assert mixed is not None
    assert (mixed.max_coats, mixed.max_paints, mixed.glazes) == (2, 3, False)
    plain = task(glazes=False)
    assert (plain.max_coats, plain.max_paints, plain.mixed) == (2, 3, None)
    narrow = task(max_coats=1, max_paints=2).mixed
    assert narrow is not None
    assert narrow.max_coats == 1


def test_a_coat_is_added_anywhere_and_never_mixed_in():
    stack = np.zeros((4, 5))
    stack[0, 0], stack[1, 1] = 5.0, 3.0
    children = list(enlargements(task(max_coats=4), stack))
    assert all(
        ((child > 0).sum(axis=1) <= 1).all() and (child > 0).sum() == 3 for child in children
    )
    orders = {tuple(np.argmax(child[:3], axis=1).tolist()) for child in children}
    # Between two coats only what neither of them is; above and below, whatever the outer coat is
    # not.
    assert {order for order in orders if order[1] not in (0, 1)} == {
        (0, 2, 1),
        (0, 3, 1),
        (0, 4, 1),
    }
    assert all(a != b for order in orders for a, b in itertools.pairwise(order))
    assert len(orders) == 3 + 4 + 4


def test_coats_that_become_neighbours_of_one_paint_are_one():
    stack = np.zeros((3, 2))
    stack[0, 0], stack[1, 0], stack[2, 1] = 20.0, 25.0, 4.0
    assert_array_equal(merge_coats(stack[None], 50.0), [[[45.0, 0], [0, 4.0], [0, 0]]])
    assert_array_equal(merge_coats(stack[None], 40.0), stack[None])
