import json
import shlex
from dataclasses import MISSING, fields, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rich.console import Console

from glazefit import find_recipes
from glazefit.recipe.model import read
from glazefit.recipe.parts import whole_parts
from glazefit.recipe.recipe import Recipe, _with_gamut
from glazefit.recipe.refine import pack_coats
from glazefit.recipe.report import (
    _print_warnings,
    describe_coat,
    print_best,
    print_recipes,
    write_json,
)
from glazefit.recipe.screen import Stacks, screen
from glazefit.recipe.selection import by_effort, roundings, select
from glazefit.recipe.targets import (
    as_targets,
    colourchecker_targets,
    lab_target,
    spectral_target,
    srgb_target,
)
from glazefit.recipe.task import make_task
from glazejax import Glaze, Layer, catalogue, colour
from glazejax.paint.describe import Coat

from ..refusals import refusal
from .palette import GRID, PALETTE

D65 = colour.find_illuminant("D65")


@pytest.fixture(scope="module")
def task():
    return make_task([lab_target((40, 40, 40)), lab_target((60, 0, -20))], PALETTE)


def stacks(count, coats):
    rng = np.random.default_rng(1)
    sizes = rng.uniform(0, 6, (count, 2, 5)) * (rng.uniform(size=(count, 2, 5)) < 0.4)
    sizes[:, 0, 0] += 1.0
    sizes[:, coats:] = 0.0
    return sizes


def test_the_table_is_exact_for_one_coat_and_near_for_two(task):
    one, two = (
        [read(task.model, stacks(20, n), optics).spectrum for optics in (None, task.optics)]
        for n in (1, 2)
    )
    assert_allclose(one[0], one[1], atol=3e-5)
    apart = np.abs(two[0] - two[1])
    assert apart.mean() < 0.005
    assert apart.max() < 0.05


def test_an_empty_coat_is_no_coat(task):
    one = stacks(5, 1)
    for optics in (None, task.optics):
        below, above = (read(task.model, sizes, optics).spectrum for sizes in (one[:, ::-1], one))
        assert_allclose(below, above, atol=1e-6)
    assert_array_equal(pack_coats(one[:, ::-1]), one)


def test_of_like_stacks_the_best_is_kept():
    sizes = np.zeros((5, 2, 3))
    sizes[:3, 0, 0], sizes[3, 0, 1], sizes[4, 1, 0] = (1.0, 2.0, 3.0), 1.0, 1.0
    cost = np.array([3.0, 1.0, 2.0, 5.0, 4.0])
    some = Stacks.before_refinement(sizes, np.array([0, 0, 1, 0, 0]), cost)
    assert some.best(3).cost.tolist() == [1.0, 2.0, 4.0, 5.0]
    assert some.best(2).cost.tolist() == [1.0, 2.0, 4.0]


@pytest.mark.slow
def test_a_recipe_that_did_not_settle_is_named(capsys):
    recipe = find_recipes((60, 10, 10), PALETTE, max_paints=2, max_coats=1, count=1)[0]
    for settled in (True, False):
        print_recipes([recipe, replace(recipe, converged=settled)], Console(), "--instrument 45:0")
        print_best([[replace(recipe, converged=settled)]], Console())
        said = " ".join(capsys.readouterr().out.split())
        assert f"glazejax render --coats '{recipe.text}' --instrument 45:0" in said
        for what in ("recipe 2", f"the recipe of {recipe.target.name}"):
            assert (f"stopped before it had settled for {what}:" in said) is not settled


@pytest.mark.parametrize(
    ("shares", "parts"),
    [
        ((0.84, 0.15, 0.01), (84, 15, 1)),
        ((0.505, 0.495), (1, 1)),
        ((0.667, 0.333), (2, 1)),
        ((1.0,), (1,)),
    ],
)
def test_parts_are_whole_numbers(shares, parts):
    assert whole_parts(shares) == parts


def test_parts_stand_to_each_other_as_shares_do():
    rng = np.random.default_rng(2)
    for count in (2, 3, 4) * 50:
        shares = np.maximum(rng.dirichlet(np.full(count, 0.4)), 0.001)
        shares /= shares.sum()
        parts = np.array(whole_parts(shares))
        assert parts.min() >= 1
        assert_allclose(parts / parts.sum(), shares, rtol=0.08)


@pytest.mark.slow
def test_what_is_poisonous_is_marked_and_parts_stand_beside_per_cent(capsys, tmp_path):
    oils = catalogue.load("oils")
    (recipe,) = find_recipes(
        (78, 20, 25), [oils["Minium"], oils["ZincWhite"]], max_coats=1, max_paints=2, count=1
    )
    assert recipe.cautions == {"Minium": "poisonous (lead), rarely sold"}
    (coat,) = recipe.coats
    parts = whole_parts([share for share, _ in coat.parts])
    ratio = " : ".join(map(str, parts))
    print_recipes([recipe], Console(width=100))
    said = capsys.readouterr().out
    assert f"{ratio} " in said
    assert "% Minium ! " in said
    assert "% ZincWhite ! " not in said
    assert "! Minium: poisonous (lead), rarely sold (--modern" in " ".join(said.split())
    assert describe_coat(coat).replace("\u00a0", " ").endswith(f"({ratio})")
    write_json([[recipe]], tmp_path / "r.json", overwrite=False)
    found = json.loads((tmp_path / "r.json").read_text())[0][0]
    assert list(found["coats"][0]["parts"].values()) == list(parts)
    assert found["cautions"] == recipe.cautions


def test_a_file_that_came_to_be_during_the_search_is_kept(tmp_path):
    """Whether a file exists is asked again when the recipes are written."""
    path = tmp_path / "r.json"
    path.write_text("mine")
    with refusal(r"r\.json exists", FileExistsError):
        write_json([], path, overwrite=False)
    assert path.read_text() == "mine"
    write_json([], path, overwrite=True)
    assert json.loads(path.read_text()) == []


def test_roundings_are_all_neighbours():
    sizes = np.array([[1.234, 0.0, 2.0], [0.0, 5.55, 0.0]])
    options = roundings(sizes, (1.0, 50.0))
    assert len(options) == 2 * 2 * 2
    for option in options:
        assert np.abs(option.sum(axis=1) - sizes.sum(axis=1)).max() < 0.1
        shares = option / option.sum(axis=1, keepdims=True)
        assert_allclose(shares * 1000, np.round(shares * 1000), atol=1e-6)


def test_targets_of_a_screen():
    assert_allclose(srgb_target("#fff").lab(D65, colour.CIE_1931), [100, 0, 0], atol=1e-6)
    science = colour.colour_science()
    expected = science.XYZ_to_Lab(science.sRGB_to_XYZ(np.array([0x8A, 0x4B, 0x2D]) / 255))
    for text in ("8a4b2d", "138, 75, 45"):
        target = srgb_target(text)
        assert target.name == "#8a4b2d"
        assert_allclose(target.lab(D65, colour.CIE_1931), expected, atol=0.02)
    for wrong in ("300,0,0", "1,2", "0.5,0.5,0.5"):
        with refusal("write red, green and blue from 0 to 255, such as 138,75,45"):
            srgb_target(wrong)


def test_targets_of_a_chart():
    chart = colourchecker_targets()
    assert len(chart) == 24
    (red,) = colourchecker_targets(["Red"])
    assert red.name == "red"
    lightness, a, b = red.lab(D65, colour.CIE_1931)
    assert 35 < lightness < 50
    assert a > 40
    assert b > 15
    assert [t.name for t in colourchecker_targets(["blue_sky", "blue  sky"])] == ["blue sky"]


def test_a_batch_may_be_an_iterator():
    batch = [(50, 20, 30), {"D65": (40, 0, 0)}, srgb_target("#8a4b2d")]
    targets, several = as_targets(iter(batch))
    assert several
    assert [target.name for target in targets] == ["Lab 50, 20, 30", "Lab 40, 0, 0", "#8a4b2d"]
    ((alone,), several) = as_targets(iter((50, 20, 30)))
    assert not several
    assert alone.name == "Lab 50, 20, 30"


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: srgb_target("#12345"), "hexadecimal"),
        (
            lambda: colourchecker_targets(["mauve"]),
            "unknown patch 'mauve': the chart has dark skin",
        ),
        (lambda: colourchecker_targets(["blue s", "n"]), "unknown patch 'n'"),
        (lambda: lab_target({}), "at least one"),
        (lambda: lab_target({"Z9": (50, 0, 0)}), "unknown illuminant"),
        (lambda: spectral_target([400, 500], [0.1], name="x"), "1 values for 2 wavelengths"),
        (lambda: spectral_target(GRID, np.full(GRID.size, -0.1), name="x"), "negative"),
    ],
)
def test_bad_targets_are_refused(make, match):
    with refusal(match):
        make()


@pytest.mark.parametrize("limits", [(3, 2), (2, 2), (1, 1)])
def test_no_paint_lies_over_itself_and_no_more_paints_than_allowed(limits):
    paints, coats = limits
    asked = make_task([lab_target((40, 40, 40))] * 2, PALETTE, max_paints=paints, max_coats=coats)
    found = screen(asked, (1000,) * 3)
    inside = found.sizes > 0
    assert found.paints.max() == paints
    assert found.coats.max() == coats
    both = inside[found.coats == 2]
    assert (both[:, 0] != both[:, -1]).any(axis=1).all()
    # Sets of one to three of five paints in a coat, and in two coats those that differ.
    pairs = {3: 20 + 2 * 50, 2: 20 + 2 * 20}
    single = sum(count for n, count in ((1, 5), (2, 10), (3, 10)) if n <= paints)
    expected = single + (pairs[paints] if coats == 2 else 0)
    assert found.size == 2 * expected
    # The cost is that of the table, by the difference of small steps.
    seen = read(asked.model, found.sizes, None)
    miss = seen.lab - asked.target_arrays.lab[found.target]
    moved = np.einsum("nlij,nlj->nli", asked.target_arrays.metric[found.target], miss)
    assert_allclose(np.sum(moved**2, axis=(1, 2)), found.cost, rtol=1e-3, atol=1e-3)


def scored(*some):
    """Stacks of one coat for one target, by the thickness of each paint and by Delta E."""
    sizes = np.zeros((len(some), 2, 4))
    for row, (paints, _) in enumerate(some):
        sizes[row, 0, list(paints)] = list(paints.values())
    distance = np.array([delta_e for _, delta_e in some])
    stacks = Stacks.before_refinement(sizes, np.zeros(len(some), int), distance**2)
    return replace(stacks, distance=distance)


def names(task, stacks, count):
    found = select(task, stacks, count)
    paints = [set(np.flatnonzero(sizes.any(axis=0)).tolist()) for sizes in found.sizes]
    return list(zip(paints, found.distance.tolist(), strict=True))


def test_recipes_that_are_chosen_differ_and_add_nothing_in_vain(task):
    """With one paint more a recipe must come nearer by what simplicity asks; else it waits behind
    the others.
    """
    alone = ({0: 5.0}, 2.0)
    again = ({0: 7.0}, 2.1)
    nearer = ({0: 5.0, 1: 1.0}, 1.2)
    in_vain = ({0: 5.0, 2: 1.0}, 1.9)
    other = ({3: 5.0}, 4.0)
    pool = scored(other, in_vain, again, nearer, alone)
    every = [({0, 1}, 1.2), ({0}, 2.0), ({3}, 4.0), ({0, 2}, 1.9)]
    assert names(task, pool, 4) == every
    assert names(task, pool, 3) == every[:3]
    assert names(task, pool, 1) == every[:1]
    # Of another simplicity the trace earns its place, and with much of it the paint alone comes
    # first.
    assert names(replace(task, simplicity=0.05), pool, 4)[1] == ({0, 2}, 1.9)
    assert names(replace(task, simplicity=1.0), pool, 4)[0] == ({0}, 2.0)
    # Two paints more that do bring it nearer are worth a place, though their price puts them
    # behind.
    richer = ({0: 5.0, 1: 1.0, 2: 1.0}, 1.65)
    both = [({0}, 2.0), ({0, 1, 2}, 1.65)]
    assert names(task, scored(alone, richer, other), 2) == both
    # What is in gamut comes first, whatever it takes.
    best = ({0: 1.0, 1: 1.0, 2: 1.0}, 0.9)
    assert names(task, Stacks.join([pool, scored(best)]), 1) == [({0, 1, 2}, 0.9)]
    # Each target has its own.
    second = replace(pool, target=np.ones(5, int))
    assert names(task, Stacks.join([second, pool]), 4) == every * 2


def test_stacks_differ_by_the_order_of_their_coats(task):
    sizes = np.stack([np.eye(2), np.eye(2)[::-1]])
    both = Stacks.before_refinement(sizes, np.zeros(2, int), np.ones(2))
    both = replace(both, distance=np.array([2.0, 0.5]))
    assert select(task, both, 5).size == 2
    assert both.coats.tolist() == both.paints.tolist() == [2, 2]
    assert by_effort(task, both).tolist() == [1, 0]


def at_distance(delta_e, limit="", **others):
    """A recipe so far from its target, of which only that is known, and what else is stated."""
    unset = dict.fromkeys(field.name for field in fields(Recipe) if field.default is MISSING)
    stated = {"target": lab_target((50, 90, 0), "pink"), "delta_e": {D65: delta_e}, "limit": limit}
    return Recipe(**unset | stated | others)  # pyright: ignore[reportArgumentType]


def test_the_line_that_draws_a_recipe_may_be_pasted_into_a_shell(capsys):
    recipe = at_distance(
        0.5,
        coats=(Coat(((1.0, "Painter's Red"),), 2e-6, 1),),
        glaze=Glaze([Layer(PALETTE[2], 2e-6)], 0.9),
        wavelengths=GRID,
        lab={D65: np.array([50.0, 60.0, 0.0])},
        test_illuminant="A",
        sensitivity=(0.1,),
        between_mixings=1.0,
    )
    print_recipes([recipe], Console(width=200), "--ground 0.5")
    _, line = capsys.readouterr().out.split("See the first: ")
    words = ["glazejax", "render", "--coats", "Painter's Red:2um", "--ground", "0.5"]
    assert shlex.split(line) == words


@pytest.mark.parametrize(
    ("bounds", "narrow"),
    [
        ({}, False),
        ({"max_paints": 1}, True),
        ({"max_coats": 1}, True),
        ({"max_paints": 5, "max_coats": 3}, False),
        ({"glazes": True}, False),
        ({"glazes": True, "max_coats": 3}, True),
    ],
)
def test_a_search_of_fewer_paints_or_coats_is_narrow(bounds, narrow):
    assert make_task([lab_target((40, 40, 40))], PALETTE, **bounds).is_narrow == narrow


@pytest.mark.slow
def test_a_target_out_of_reach_of_few_paints_says_so():
    (best,) = find_recipes(lab_target((60, 30, 60)), PALETTE, max_paints=1, count=1)
    assert not best.in_gamut
    assert best.limit == "no more than 1 paint in 2 coats is allowed"


def test_a_target_out_of_reach_is_so_for_the_reason_of_its_nearest_recipe(capsys):
    bound = "coat 2 is as thick as allowed"
    simple, nearest = _with_gamut([at_distance(6.9, "paints"), at_distance(6.5, bound)])
    assert (simple.limit, nearest.limit) == ("paints", bound)
    assert simple.gamut_distance == nearest.gamut_distance == 6.5
    for recipes, why in (
        ([simple, nearest], f"in recipe 2, {bound}: try other bounds."),
        ([nearest, simple], f"{bound}: try other bounds."),
        ([replace(nearest, limit="paints"), simple], "these paints reach no further."),
    ):
        _print_warnings([recipes], "recipe", [], Console(width=200))
        said = capsys.readouterr().out
        assert said.strip() == f"pink: out of reach by a Delta E of 6.5; {why}"
    reached = _with_gamut([at_distance(1.2, bound), at_distance(0.9, "paints")])
    assert [(recipe.limit, recipe.gamut_distance) for recipe in reached] == [("", 0.0)] * 2


def test_recipes_for_one_target_are_drawn_on_one_scale():
    from glazefit.recipe.plots import recipe_figure

    def recipe(target, reflectance):
        return at_distance(
            0.1,
            target=target,
            wavelengths=GRID,
            reflectance=np.full(GRID.size, reflectance),
            coats=(),
            lab={D65: np.array([40.0, 0.0, 0.0])},
        )

    brown, white = lab_target((40, 0, 0), "brown"), lab_target((40, 0, 0), "white")
    recipes = [recipe(brown, 0.44), recipe(brown, 0.2), recipe(white, 0.3)]
    figure = recipe_figure(recipes, titles=["1", "2", "3"], heading="h", subtitle="s")
    tops = [axes.get_ylim()[1] for axes in figure.axes[1::2]]
    assert tops == [1.0, 1.0, 0.4]
