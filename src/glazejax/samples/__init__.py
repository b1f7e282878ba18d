"""Measured films to try things on: twelve oil paints over a black and a white card, with what is in
them.

Reflectance as fractions, 400-700 nm step 10, four rows a film: ``06A_b`` and ``06A_w`` are the bare
black and white card of film 06A, ``06A_ob`` and ``06A_ow`` its paint over them. The numbers are in
`films.csv`, the recipes in
`mixtures.tsv`, source and licence (CC0 1.0) in `SOURCE.md`, next to this file::

    glazejax identify "$(python -m glazejax.samples)" --catalogue oils
    films = glazefit.read_films(glazejax.samples.path())

The oils of `glazejax.catalogue` were fitted to these films among others: a paint left out of the
catalogue is a test of identification, the whole catalogue is only a demonstration.
"""

import atexit
import functools
from contextlib import ExitStack
from importlib.resources import as_file, files
from pathlib import Path

_FILES = {"films": "films.csv", "recipes": "mixtures.tsv"}


@functools.cache
def path(name: str = "films") -> Path:
    """A file of samples, as a path that lasts as long as the program, also where the package is
    zipped.

    Args:
        name: "films", a table of spectra, four rows a film; or "recipes", a line a film with its
            paints and weights in percent, ``07F<TAB>ZincWhite-BoneBlack|25.8-74.2``, in the names
            of the catalogue's oils.

    Raises:
        ValueError: there is no file of that name; the message lists them.
    """
    if name not in _FILES:
        raise ValueError(f"there are no samples {name!r}; choose from {', '.join(_FILES)}")
    resources = ExitStack()
    atexit.register(resources.close)
    return resources.enter_context(as_file(files(__name__).joinpath(_FILES[name])))


def recipes() -> dict[str, dict[str, float]]:
    """Recipes of the films: name of the film -> paint -> share of the paint's weight; the shares
    sum to 1.

    Example:
        >>> recipes()["14E"]
        {'ChromeYellow': 0.898, 'BoneBlack': 0.102}
    """
    by_film = {}
    for line in path("recipes").read_text(encoding="utf-8").splitlines():
        film, _, recipe = line.partition("\t")
        paints, _, percentages = recipe.partition("|")
        weights = [float(weight) for weight in percentages.split("-")]
        shares = (weight / sum(weights) for weight in weights)
        by_film[film] = dict(zip(paints.split("-"), shares, strict=True))
    return by_film


def names() -> tuple[str, ...]:
    """Names of the films."""
    return tuple(recipes())
