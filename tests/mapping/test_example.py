"""The example painting: its spectra are the solver's, and its truth is stated."""

import numpy as np
import pytest
from benchmarks.rivals.known_painting import FOREIGN, painting
from benchmarks.rivals.known_painting_scene import NUMBER, REGIONS
from numpy.testing import assert_allclose, assert_array_equal

from glazefit.mapping.example import painting as small_painting
from glazefit.mapping.example import write_painting as small_write
from glazejax import Glaze, Hemispherical, Layer, Mixture, reflectance
from glazejax.catalogue import family
from glazejax.commands.options import read_ground
from glazejax.io import read_cube

GRID = np.linspace(400.0, 700.0, 13)
"""Another than that of other paintings, whose tables are rougher."""


@pytest.fixture(scope="module")
def scene():
    return painting((48, 64), GRID, seed=3)


@pytest.mark.slow
def test_pixels_are_what_the_solver_gives_for_their_truth(scene):
    clear, truth = scene.rows(0, 48, noise=False), scene.truth(0, 48)
    paints = (*scene.paints, *scene.foreign)
    rng = np.random.default_rng(0)
    worst = {}
    for number in np.unique(truth["region"]):
        ys, xs = np.nonzero(truth["region"] == number)
        some = rng.choice(ys.size, 25)
        ys, xs = ys[some], xs[some]
        members, coats, amounts = (truth[name][ys, xs] for name in ("members", "coats", "amounts"))
        # From the truth alone: paints and coats are the same all over a region, amounts differ.
        layers = []
        for coat in range(coats[0].max() + 1):
            places = np.flatnonzero((coats[0] == coat) & (members[0] >= 0))
            thick = amounts[:, places].astype(float)
            medium = Mixture(
                [paints[members[0, i]] for i in places], thick / thick.sum(axis=1, keepdims=True)
            )
            layers.append(Layer(medium, thick.sum(axis=1)))
        exact = reflectance(Glaze(layers, scene.ground, 1.5), Hemispherical(8.0), tolerance=1e-7)
        worst[REGIONS[number].name] = float(np.abs(np.asarray(exact) - clear[ys, xs]).max())
    assert len(worst) > 15
    assert max(worst.values()) < 1e-4, worst


def test_foreign_paints_have_no_relative_in_the_catalogue(scene):
    known = {family(paint.name) for paint in scene.paints}
    assert len(scene.paints) == 18
    assert not known & {family(name) for name in FOREIGN}
    truth = scene.truth(0, 48)
    there = (truth["members"] >= len(scene.paints)).any(axis=-1)
    assert_array_equal(there, truth["foreign"])
    assert (
        scene.names[truth["members"][truth["region"] == NUMBER["foreign stroke"]][0, 0]]
        == FOREIGN[0]
    )


def test_the_small_painting_of_the_command_is_what_its_truth_says(tmp_path):
    made = small_painting((12, 16), 13)
    names = [paint.name for paint in (*made.paints, *made.foreign)]
    sets = {tuple(names[n] for n in one if n >= 0) for one in made.members.reshape(-1, 3)}
    assert len(sets) == 5
    assert (made.foreign[0].name,) in sets
    assert made.foreign[0].name not in [paint.name for paint in made.paints]
    # Paint of the sky in the solver again, thickness found by looking for it.
    sky = made.spectra[0, 0]
    known = {paint.name: paint for paint in made.paints}
    medium = Mixture([known["CobaltBlue"], known["ZincWhite"]], [0.2, 0.8])
    layer = Layer(medium, np.linspace(18e-6, 60e-6, 43))
    curves = reflectance(Glaze([layer], made.ground, 1.5), Hemispherical(8.0))
    assert np.sqrt(np.mean((np.asarray(curves) - sky) ** 2, axis=1)).min() < 0.006
    cube = read_cube(small_write(tmp_path, made))
    assert_allclose(cube[:, :], made.spectra, atol=1e-6)
    assert_array_equal(np.load(tmp_path / "members.npy"), made.members)
    ground = read_ground(str(tmp_path / "ground.csv")).on(made.wavelengths)
    assert_allclose(ground, made.ground, atol=1e-6)
