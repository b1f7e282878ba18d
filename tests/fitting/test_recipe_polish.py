"""The last steps of a recipe, along the solver itself."""

import jax.numpy as jnp
import numpy as np
import pytest

import glazejax as gj
from glazefit.film.colour_metric import lab_metric
from glazefit.film.films import Instrument
from glazefit.film.model.optics import Optics
from glazefit.recipe import polish as polish_module
from glazefit.recipe.model import StackSolver, fill_slots, make_model, solve
from glazefit.recipe.polish import colour_misfit, polish
from glazefit.recipe.screen import Stacks, TargetArrays
from glazefit.recipe.selection import score
from glazejax import colour

from .palette import GRID, palette

SEEN = gj.Bidirectional(45, 0)
LIGHTS = [colour.find_illuminant(name) for name in ("D65", "A")]
SOLVER = StackSolver(Optics.of(SEEN, 1.5), 4)
WHITE, BLACK, RED, YELLOW, BLUE = range(5)


@pytest.fixture(scope="module")
def model():
    """Under two lights, so that each counts in part."""
    return make_model(palette(), 0.9, Instrument(SEEN), LIGHTS, colour.CIE_1931, (1e-6, 50e-6))


def stacks(*some: list[dict[int, float]]) -> Stacks:
    """Stacks of two coats, by the thickness that each paint takes, um; each for a target of its
    own.
    """
    sizes = np.zeros((len(some), 2, 5))
    for row, stack in enumerate(some):
        for coat, paints in enumerate(stack):
            sizes[row, coat, list(paints)] = list(paints.values())
    return Stacks.before_refinement(sizes, np.arange(len(some)), np.zeros(len(some)))


def spectrum(model, sizes: np.ndarray) -> np.ndarray:
    """What the public solver says of a stack, paint by paint through mixtures and layers."""
    layers = [
        gj.Layer(gj.Mixture(palette(), coat / coat.sum()), coat.sum() * 1e-6)
        for coat in sizes
        if coat.sum() > 0
    ]
    return np.asarray(gj.reflectance(gj.Glaze(layers, 0.9), SEEN, tolerance=1e-8))


def aims_of(spectra: np.ndarray, spectral: float = 0.0) -> TargetArrays:
    labs = np.stack([colour.lab(GRID, spectra, illuminant=light) for light in LIGHTS], axis=1)
    weights = np.full(len(spectra), spectral)
    return TargetArrays(
        *(jnp.asarray(values) for values in (labs, lab_metric(labs), spectra, weights))
    )


def test_slopes_are_those_of_the_solver(model):
    """Against differences of readings that the public solver gives for mixtures and layers."""
    some = stacks([{RED: 3.0, WHITE: 2.0}, {BLUE: 6.0}])
    slots, _ = fill_slots(model, some.sizes, 4)
    amount = np.where(
        slots.used, some.sizes[0][np.asarray(slots.coat), np.asarray(slots.paint)], 1.0
    )
    reading, slope, lab, _ = solve(model, SOLVER, slots, amount, 2)
    np.testing.assert_allclose(reading[0], spectrum(model, some.sizes[0]), atol=2e-6)
    np.testing.assert_allclose(lab[0, 0], colour.lab(GRID, reading[0]), atol=1e-9)
    for slot in range(3):
        place = int(slots.coat[0, slot]), int(slots.paint[0, slot])
        ends = []
        for factor in (1.001, 0.999):
            sizes = some.sizes[0].copy()
            sizes[place] *= factor
            ends.append(spectrum(model, sizes))
        expected = (ends[0] - ends[1]) / (0.002 * some.sizes[0][place])
        np.testing.assert_allclose(
            slope[0, slot], expected, atol=2e-3 * np.abs(expected).max() + 1e-6
        )
    assert not np.any(slope[0, 3])


def test_slopes_under_two_lights_are_those_of_the_cost(model):
    """Half the cost's differences by the logs of thicknesses and free shares."""
    some = stacks([{RED: 3.0, WHITE: 4.0}, {BLUE: 9.0}])
    aim = spectrum(model, stacks([{RED: 2.0, WHITE: 6.0}, {BLUE: 5.0}]).sizes[0])
    place, point = polish_module._start(model, aims_of(aim[None], 100.0), some, SOLVER.slots)
    step = 3e-4
    used = 5  # two thicknesses, three shares; the fourth slot is empty
    moves = step * np.concatenate([np.zeros((1, 6)), np.eye(6)[:used], -np.eye(6)[:used]])
    looks, _ = polish_module._look(model, SOLVER, place.take(np.zeros(11, int)), point + moves)
    differences = (looks.cost[1 : 1 + used] - looks.cost[1 + used :]) / (2 * step)
    # Of slopes of some tens a millionth is left, by this difference and by the one that slopes of
    # CIEDE2000 are.
    np.testing.assert_allclose(looks.slope[0, :used], 0.5 * differences, rtol=1e-5, atol=1e-5)
    assert looks.slope[0, used] == 0.0


def test_the_misfit_is_as_long_as_the_colour_difference():
    rng = np.random.default_rng(0)
    aim = rng.uniform((5, -80, -80), (95, 80, 80), (40, 1, 3))
    aim[:2] = (50, 0, 0)
    lab = aim + rng.normal(size=aim.shape) * rng.uniform(0.01, 20, (40, 1, 1))
    lab[0] = aim[0]
    vector, slope = colour_misfit(lab, aim)
    np.testing.assert_allclose(
        np.linalg.norm(vector, axis=-1), colour.delta_e_2000(lab, aim), atol=1e-9
    )
    assert np.all(np.isfinite(slope))
    step = 1e-3 * rng.normal(size=aim.shape)
    moved = colour.delta_e_2000(lab + step, aim) ** 2
    expected = np.sum((vector + np.einsum("nlij,nlj->nli", slope, step)) ** 2, axis=-1)
    np.testing.assert_allclose(expected, moved, rtol=2e-3, atol=1e-4)


def test_amounts_that_made_a_colour_are_found_again(model):
    """Two coats, where the table is off: the solver's own steps end where it meets the target, and
    settle.
    """
    made = stacks([{RED: 3.0, WHITE: 4.0}, {BLUE: 9.0}], [{YELLOW: 2.0}, {BLUE: 5.0, WHITE: 10.0}])
    spectra = np.stack([spectrum(model, sizes) for sizes in made.sizes])
    start = made._replace(sizes=made.sizes * np.array([1.3, 0.8])[:, None, None])
    aims = aims_of(spectra, 1e4)
    found = polish(model, SOLVER, aims, start)
    assert found.settled.all()
    assert np.all(found.steps > 0)
    assert np.all(found.before > 0.5)
    np.testing.assert_allclose(found.sizes, made.sizes, rtol=0.02, atol=1e-3)
    own = score(model, SOLVER, aims, found)
    assert max(one.distance for one in own) < 0.01
    # The cost is what recipes are chosen by.
    np.testing.assert_allclose(np.sqrt(found.cost), [one.score for one in own], atol=2e-3)


def test_a_coat_at_its_bound_and_a_paint_that_fades_settle(model):
    """For a white out of reach: white as thick as allowed, and red or black only spoil it."""
    start = stacks([{WHITE: 30.0}], [{WHITE: 30.0, RED: 1.0}], [{WHITE: 47.0, BLACK: 0.5}])
    aims = aims_of(np.ones((3, GRID.size)))
    found = polish(model, SOLVER._replace(slots=3), aims, start)
    assert found.settled.all()
    np.testing.assert_allclose(found.sizes[0, 0], [50.0, 0, 0, 0, 0])
    shares = found.sizes[:, 0] / found.sizes[:, 0].sum(axis=1, keepdims=True)
    assert np.all(shares[:, [RED, BLACK]] < 1e-3)


def test_steps_that_run_out_are_said(model, monkeypatch):
    start = stacks([{RED: 20.0, WHITE: 4.0}, {BLUE: 40.0}])
    aims = aims_of(spectrum(model, stacks([{RED: 2.0, WHITE: 4.0}, {BLUE: 3.0}]).sizes[0])[None])
    monkeypatch.setattr(polish_module, "_STEPS", 1)
    assert not polish(model, SOLVER, aims, start).settled.any()
    monkeypatch.undo()
    found = polish(model, SOLVER, aims, start)
    assert found.settled.all()
    assert score(model, SOLVER, aims, found)[0].distance < 0.05
