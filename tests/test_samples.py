import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import glazefit
from glazejax import catalogue, samples
from glazejax.io import read_spectra


def test_films_are_read_four_rows_each():
    films = glazefit.read_films(samples.path())
    assert films.names == samples.names()
    assert len(films.names) == 12
    np.testing.assert_array_equal(films.wavelengths, np.arange(400.0, 701.0, 10.0))
    assert films.notes == ()
    for rows in (films.bare_black, films.bare_white, films.over_black, films.over_white):
        assert rows.min() > 0.02
        assert rows.max() < 0.93


def test_recipes_name_paints_of_the_catalogue():
    recipes = samples.recipes()
    given = glazefit.read_recipes(samples.path("recipes"))
    oils = catalogue.load()
    assert list(recipes) == list(given)
    for film, shares in recipes.items():
        assert set(shares) <= set(oils)
        assert sum(shares.values()) == pytest.approx(1.0)
        total = sum(given[film].values())
        assert shares == pytest.approx(
            {paint: weight / total for paint, weight in given[film].items()}
        )


def test_they_are_the_readings_of_the_source(shared_data):
    source = read_spectra(shared_data / "revigo" / "reflectance.tsv")
    table = read_spectra(samples.path())
    for name in table.names:
        np.testing.assert_allclose(table[name], source[name], rtol=0, atol=1e-12)
    recipes = glazefit.read_recipes(shared_data / "revigo" / "mixtures.tsv")
    assert glazefit.read_recipes(samples.path("recipes")) == {
        film: recipes[film] for film in samples.names()
    }


def test_unknown_files_are_refused():
    with pytest.raises(ValueError, match="no samples 'spectra'; choose from films, recipes"):
        samples.path("spectra")


def test_a_command_line_is_told_where_they_are():
    command = [sys.executable, "-m", "glazejax.samples"]
    said = subprocess.run([*command, "recipes"], capture_output=True, text=True, check=True)
    assert Path(said.stdout.strip()) == samples.path("recipes")
    wrong = subprocess.run([*command, "x"], capture_output=True, text=True)
    assert wrong.returncode == 1
    assert wrong.stderr.strip() == "there are no samples 'x'; choose from films, recipes"


def test_the_wheel_holds_what_ships(tmp_path):
    """Every table of both packages, with what says where it comes from."""
    wheel = pytest.importorskip("hatchling.builders.wheel")
    here = Path(__file__).parents[1]
    built = next(
        wheel.WheelBuilder(str(here)).build(directory=str(tmp_path), versions=["standard"])
    )
    with zipfile.ZipFile(built) as archive:
        held = set(archive.namelist())
    for folder in (here / "src", here / "fitting"):
        data = {
            str(p.relative_to(folder))
            for kind in ("csv", "tsv", "md")
            for p in folder.rglob(f"*.{kind}")
        }
        assert data <= held
    for name in (
        "catalogue/acrylics.csv",
        "catalogue/ACRYLICS.md",
        "samples/films.csv",
        "samples/SOURCE.md",
    ):
        assert f"glazejax/{name}" in held
