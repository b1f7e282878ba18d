"""Where measured films are: GLAZEJAX_DATA, or the folder shared/data next to the repository."""

import os
from collections.abc import Collection
from pathlib import Path

from glazefit.film.films import Films
from glazefit.film.readers import read_films, read_recipes

# Enough paints for a small run: two colours, the white and the black that they are mixed with.
FEW = ("Minium", "Vermillion", "ZincWhite", "BoneBlack")


def data_folder() -> Path:
    """GLAZEJAX_DATA, or shared/data next to the repository."""
    return Path(os.environ.get("GLAZEJAX_DATA") or Path(__file__).parents[2] / "shared" / "data")


def measured_data(name: str) -> Path:
    """Folder of one set of measurements, such as "revigo".

    Raises:
        SystemExit: it is not there; says what to do.
    """
    base = data_folder()
    if not (base / name).is_dir():
        raise SystemExit(
            f"no folder {name} in {base}; set GLAZEJAX_DATA to the folder that holds it"
        )
    return base / name


def measured_films(paints: Collection[str] = ()) -> tuple[Films, dict[str, dict[str, float]]]:
    """The measured films of revigo and all recipes; only films of these paints, if any are named.

    Raises:
        SystemExit: the measurements are not there.
    """
    folder = measured_data("revigo")
    films, recipes = read_films(folder / "reflectance.tsv"), read_recipes(folder / "mixtures.tsv")
    if paints:
        parts = {
            name: {paint for paint, weight in recipes[name].items() if weight > 0}
            for name in films.names
        }
        films = films.select([name for name in films.names if parts[name] <= set(paints)])
    return films, recipes
