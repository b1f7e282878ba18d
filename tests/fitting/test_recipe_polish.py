"""The last steps of a recipe, along the solver itself."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import glazejax as gj
from glazefit import lab_target
from glazefit.film.colour_metric import lab_metric
from glazefit.film.numerics.columns import take_rows
from glazefit.recipe.model import read
from glazefit.recipe.refine import colour_misfit, look, refine, score, start
from glazefit.recipe.screen import Stacks
from glazefit.recipe.targets import TargetArrays
from glazefit.recipe.task import make_task
from glazejax import colour

from .palette import GRID, PALETTE

SEEN = gj.Bidirectional(45, 0)
LIGHTS = [colour.find_illuminant(name) for name in ("D65", "A")]
WHITE, BLACK, RED, YELLOW, BLUE = range(5)


def stacks(*some):
    """Stacks of two coats, by the thickness that each paint takes, um; each for a target of its
    own.
    """
    sizes = np.zeros((len(some), 2, 5))
    for row, stack in enumerate(some):
        for coat, paints in enumerate(stack):
            sizes[row, coat, list(paints)] = list(paints.values())
    return Stacks.before_refinement(sizes, np.arange(len(some)), np.zeros(len(some)))


def spectrum(sizes):
    """What the public solver says of a stack, paint by paint through mixtures and layers."""
    layers = [
        gj.Layer(gj.Mixture(PALETTE, coat / coat.sum()), coat.sum() * 1e-6)
        for coat in sizes
        if coat.sum() > 0
    ]
    return np.asarray(gj.reflectance(gj.Glaze(layers, 0.9), SEEN, tolerance=1e-8))


def task_for(spectra, spectral=0.0):
    """Under two lights, so that each counts in part; `spectral` weighs the spectra."""
    labs = np.stack([colour.lab(GRID, spectra, illuminant=light) for light in LIGHTS], axis=1)
    target = lab_target(dict.fromkeys(LIGHTS, (50, 0, 0)))
    task = make_task([target] * len(spectra), PALETTE)
    arrays = TargetArrays(labs, lab_metric(labs), spectra, np.full(len(spectra), spectral))
    return replace(task, target_arrays=arrays)


@pytest.mark.parametrize("table", [False, True])
def test_slopes_under_two_lights_are_those_of_the_cost(table):
    """Half the cost's differences by the logs of thicknesses and free shares."""
    # The second has one amount less than the first.
    some = stacks([{RED: 3.0, WHITE: 4.0}, {BLUE: 9.0}], [{RED: 3.0}, {BLUE: 9.0}])
    goal = spectrum(stacks([{RED: 2.0, WHITE: 6.0}, {BLUE: 5.0}]).sizes[0])
    task = task_for(np.stack([goal, goal]), 100.0)
    optics = None if table else task.optics
    places, point, _ = start(task, some)
    step = 3e-4
    moves = step * np.concatenate([np.zeros((1, 5)), np.eye(5), -np.eye(5)])
    for row, unknowns in enumerate((5, 4)):
        looks, _ = look(task, take_rows(places, np.full(11, row)), point[row] + moves, optics)
        differences = (looks.cost[1:6] - looks.cost[6:]) / (2 * step)
        # Of slopes of some tens a millionth is left, by this difference and by the one that slopes
        # of CIEDE2000 are.
        assert_allclose(looks.slope[0], 0.5 * differences, rtol=1e-5, atol=1e-5)
        assert not looks.slope[0, unknowns:].any()


def test_the_misfit_is_as_long_as_the_colour_difference():
    rng = np.random.default_rng(0)
    aim = rng.uniform((5, -80, -80), (95, 80, 80), (40, 1, 3))
    aim[:2] = (50, 0, 0)
    lab = aim + rng.normal(size=aim.shape) * rng.uniform(0.01, 20, (40, 1, 1))
    lab[0] = aim[0]
    vector, slope = colour_misfit(lab, aim)
    assert_allclose(np.linalg.norm(vector, axis=-1), colour.delta_e_2000(lab, aim), atol=1e-9)
    assert np.all(np.isfinite(slope))
    step = 1e-3 * rng.normal(size=aim.shape)
    moved = colour.delta_e_2000(lab + step, aim) ** 2
    expected = np.sum((vector + np.einsum("nlij,nlj->nli", slope, step)) ** 2, axis=-1)
    assert_allclose(expected, moved, rtol=2e-3, atol=1e-4)


def test_amounts_that_made_a_colour_are_found_again():
    """Two coats, where the table is off: the solver's own steps end where it meets the target, and
    settle.
    """
    made = stacks([{RED: 3.0, WHITE: 4.0}, {BLUE: 9.0}], [{YELLOW: 2.0}, {BLUE: 5.0, WHITE: 10.0}])
    spectra = np.stack([spectrum(sizes) for sizes in made.sizes])
    begin = replace(made, sizes=made.sizes * np.array([1.3, 0.8])[:, None, None])
    task = task_for(spectra, 1e4)
    found = refine(task, begin, task.optics)
    assert found.settled.all()
    assert np.all(found.steps > 0)
    assert np.all(found.before > 0.5)
    assert_allclose(found.sizes, made.sizes, rtol=0.02, atol=1e-3)
    seen = read(task.model, found.sizes, task.optics)
    chosen_by = score(task, found, seen.spectrum, seen.lab)
    assert chosen_by.distance.max() < 0.01
    assert_allclose(np.sqrt(found.cost), np.sqrt(chosen_by.cost), atol=2e-3)


def test_a_coat_at_its_bound_and_a_paint_that_fades_settle():
    """For a white out of reach: white as thick as allowed, and red or black only spoil it."""
    begin = stacks([{WHITE: 30.0}], [{WHITE: 30.0, RED: 1.0}], [{WHITE: 47.0, BLACK: 0.5}])
    task = task_for(np.ones((3, GRID.size)))
    found = refine(task, begin, task.optics)
    assert found.settled.all()
    assert_allclose(found.sizes[0, 0], [50.0, 0, 0, 0, 0])
    shares = found.sizes[:, 0] / found.sizes[:, 0].sum(axis=1, keepdims=True)
    assert np.all(shares[:, [RED, BLACK]] < 1e-3)


@pytest.mark.parametrize("table", [False, True])
def test_steps_that_run_out_are_said(table):
    begin = stacks([{RED: 20.0, WHITE: 4.0}, {BLUE: 40.0}])
    assert not begin.settled.any()
    made = stacks([{RED: 2.0, WHITE: 4.0}, {BLUE: 3.0}]).sizes
    anywhere = task_for(np.zeros((1, GRID.size)))
    optics = None if table else anywhere.optics
    task = task_for(read(anywhere.model, made, optics).spectrum)
    assert not refine(task, begin, optics, 1).settled.any()
    found = refine(task, begin, optics)
    assert found.settled.all()
    assert np.sqrt(found.cost[0]) < 0.05
