"""The example painting of the command: its spectra are those of its truth."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from glazefit.mapping.example import FOREIGN, painting, write_painting
from glazejax import Glaze, Hemispherical, Layer, Mixture, catalogue, reflectance
from glazejax.commands.options import read_ground
from glazejax.io import open_cube


def test_the_small_painting_of_the_command_is_what_its_truth_says(tmp_path):
    made = painting((12, 16), 13)
    known = catalogue.load()
    names = [*(name for name in known if name != FOREIGN), FOREIGN]
    sets = {tuple(names[n] for n in one if n >= 0) for one in made.members.reshape(-1, 3)}
    assert len(sets) == 5
    assert (FOREIGN,) in sets
    # Paint of the sky in the solver again, thickness found by looking for it.
    sky = made.spectra[0, 0]
    of_sky = [known[name].resample(made.wavelengths) for name in ("CobaltBlue", "ZincWhite")]
    medium = Mixture(of_sky, [0.2, 0.8])
    layer = Layer(medium, np.linspace(18e-6, 60e-6, 43))
    curves = reflectance(Glaze([layer], made.ground, 1.5), Hemispherical(8.0))
    assert np.sqrt(np.mean((np.asarray(curves) - sky) ** 2, axis=1)).min() < 0.006
    cube = open_cube(write_painting(tmp_path, made))
    assert_allclose(cube, made.spectra, atol=1e-6)
    assert_array_equal(np.load(tmp_path / "members.npy"), made.members)
    ground = read_ground(str(tmp_path / "ground.csv")).on(made.wavelengths)
    assert_allclose(ground, made.ground, atol=1e-6)
