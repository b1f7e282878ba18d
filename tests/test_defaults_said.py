"""Numbers that a text takes from the program, not from a result: defaults, limits, counts of what ships."""

import csv
import importlib
import inspect
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
SPELT = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
SPELT += ("thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen", "twenty")


def of(name: str) -> Any:
    """A thing of the code by its module, a colon and its name."""
    module, _, thing = name.partition(":")
    return getattr(importlib.import_module(module), thing)


def default(function: str, argument: str) -> Any:
    """What an argument is if it is left out."""
    return inspect.signature(of(function)).parameters[argument].default


def um(metres: float) -> str:
    return f"{1e6 * metres:g}"


def power(value: float) -> str:
    """1e-06 as texts say it."""
    return f"{value:.0e}".replace("e-0", "e-")


def paints(name: str) -> int:
    return len(of("glazejax.catalogue:load")(name))


def films() -> int:
    return len(of("glazefit:read_films")(of("glazejax.samples:path")()).names)


def card(bare: float) -> float:
    return float(of("glazefit:ground_from_air")(np.array(bare)))


def surface() -> float:
    """Per cent that the surface adds at d:8."""
    return 100 * of("glazejax:Instrument").parse("d:8").seen_surface


def grid(name: str) -> Any:
    return next(iter(of("glazejax.catalogue:load")(name).values())).wavelengths


def pythons() -> list[str]:
    classifiers = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["classifiers"]
    return re.findall(r":: (3\.\d+)", " ".join(classifiers))


def layered() -> list[dict[str, str]]:
    with (ROOT / "benchmarks" / "results" / "layered_truth.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


STACK, ROUGH = "glazejax:stack_reflectance_factor", "glazejax:rough_reflectance_factor"
RECIPE, CHUNKS = "glazefit.recipe.task", "glazejax.radiative.common.chunks"
# A document, what it says with a hole for each number, and the numbers.
SAID: list[tuple[str, str, Callable[[], tuple[Any, ...]]]] = [
    ("README.md", "Python {} to {}.", lambda: (pythons()[0], pythons()[-1])),
    ("README.md", "a typical one is taken as {} µm", lambda: (um(of("glazejax.catalogue:ASSUMED_THICKNESS")),)),
    ("README.md", "in {} measured films, with one paint", lambda: (SPELT[films()],)),
    (
        "README.md",
        "{} values of albedo and BRDF of {} varnished",
        lambda: (len(layered()), len({row["number"] for row in layered()})),
    ),
    ("README.md", "a card that reads 84 % bare is about {:.2f}.", lambda: (card(0.84),)),
    ("docs/glossary.md", "a card that reads 84 % bare is about {:.2f} ", lambda: (card(0.84),)),
    ("docs/glossary.md", "R_s is {:.0f} % at n = 1.5 and", lambda: (surface(),)),
    ("docs/instruments.md", "reads {:.0f} % more than with `de:8`", lambda: (surface(),)),
    ("docs/instruments.md", "by about {:.0f} % of the light", lambda: (surface(),)),
    ("docs/index.md", "Python {} to {}.", lambda: (pythons()[0], pythons()[-1])),
    (
        "docs/conventions.md",
        "The catalogue of oils has {:g} to {:g} in steps of {:g}",
        lambda: (grid("oils")[0], grid("oils")[-1], grid("oils")[1] - grid("oils")[0]),
    ),
    (
        "docs/conventions.md",
        "A typical one is taken as {} µm",
        lambda: (um(of("glazejax.catalogue:ASSUMED_THICKNESS")),),
    ),
    ("docs/conventions.md", "{} and the 2° observer", lambda: (default("glazejax.colour:lab", "illuminant"),)),
    (
        "docs/errors.md",
        "{} is the default ({} under a rough surface)",
        lambda: (power(default(STACK, "tolerance")), power(default(ROUGH, "tolerance"))),
    ),
    ("docs/errors.md", "{} is the finest", lambda: (power(of("glazejax.radiative.stack:FINEST")["ordinates"]),)),
    (
        "docs/errors.md",
        "about {} is what rounding leaves",
        lambda: (power(of("glazejax.radiative.stack:FINEST_SINGLE")),),
    ),
    ("docs/performance.md", "Batches of {} and more", lambda: (of("glazejax.radiative.stack:_MANY"),)),
    ("docs/accuracy.md", "a batch of {} or more", lambda: (of("glazejax.radiative.stack:_MANY"),)),
    (
        "docs/gpu.md",
        "{:g} KiB of matrices on a processor, {:g} MiB elsewhere",
        lambda: (
            of("glazejax.radiative.stack:_ORDINATES_CHUNK_BYTES") / 2**10,
            of(f"{CHUNKS}:_LEAST_ON_ACCELERATOR") / 2**20,
        ),
    ),
    ("docs/method.md", "up to {} representatives", lambda: (of("glazefit.mapping.map_cube:_REPRESENTATIVES")[1],)),
    ("docs/method.md", "{} pixels are searched in full", lambda: (of("glazefit.mapping.map_cube:_CHECKED"),)),
    (
        "docs/method.md",
        "all sets of up to {} paints in one coat or {} are",
        lambda: (SPELT[of(f"{RECIPE}:_PAINTS")], SPELT[of(f"{RECIPE}:_LAYERS")]),
    ),
    ("docs/method.md", "(tolerance {})", lambda: (power(of("glazefit.recipe.model:TOLERANCE")),)),
    ("docs/method.md", "promises less than {:g}", lambda: (of("glazefit.recipe.polish:PROMISE"),)),
    ("docs/method.md", "between, up to {}, and", lambda: (SPELT[of(f"{RECIPE}:_MOST_GLAZES")],)),
    (
        "docs/what-there-is.md",
        "any number of layers, index {:g} to {:g},",
        lambda: of("glazejax.radiative.common.inputs:INDEX_RANGE"),
    ),
    ("docs/what-there-is.md", "to {} by default", lambda: (power(default(ROUGH, "tolerance")),)),
    ("docs/what-there-is.md", "| {} oil paints", lambda: (paints("oils"),)),
    ("docs/what-there-is.md", "| {} acrylics", lambda: (paints("acrylics"),)),
    ("docs/what-there-is.md", "| {} measured films", lambda: (films(),)),
    (
        "docs/what-there-is.md",
        "error at some {:.0f} points that",
        lambda: (round(sum(of("glazejax.interpolated:_CHECKS")), -2),),
    ),
    ("docs/what-there-is.md", "drawn for the first {} spots", lambda: (of("glazefit.identify.page:DRAWN"),)),
    (
        "docs/what-there-is.md",
        "a dask cluster, {} at a time for each",
        lambda: (SPELT[of("glazefit.mapping.cluster:_IN_FLIGHT")],),
    ),
    ("docs/what-there-is.md", "up to {} coats, each a tube", lambda: (SPELT[of(f"{RECIPE}:_MOST_GLAZES")],)),
    (
        "docs/start/paint.md",
        "coats of {} to {} µm",
        lambda: tuple(map(um, default("glazefit:find_recipes", "thickness"))),
    ),
    ("docs/start/paint.md", "You get {} recipes", lambda: (SPELT[default("glazefit:find_recipes", "count")],)),
    (
        "docs/start/paint.md",
        "holds {} historical oils and {} acrylics",
        lambda: (SPELT[paints("oils")], SPELT[paints("acrylics")]),
    ),
    ("docs/own-tubes.md", "Spectra finer than {:g} nm", lambda: (of("glazefit.film.loose:FINEST"),)),
    ("docs/own-tubes.md", "a tint of 1:{}, 1:{} or 1:{},", lambda: of("glazefit.recover.next_film:TINTS")),
    ("docs/own-tubes.md", "taken as {} µm (`--thickness`)", lambda: (um(of("glazejax.catalogue:ASSUMED_THICKNESS")),)),
    ("docs/studio.md", "thick and as {} µm over white", lambda: (um(of("glazejax.studio.shelf:THIN")),)),
    ("docs/studio.md", "Files above {:.0f} MB", lambda: (of("glazejax.studio.wire:MOST_FILE") / 2**20,)),
    ("docs/studio.md", "for {} minutes without", lambda: (SPELT[int(of("glazejax.studio.jobs:PATIENCE") / 60)],)),
    ("docs/mitsuba.md", "{:g} below a line of coats", lambda: (of("glazejax.appearance.mitsuba.coats:GROUND"),)),
    (
        "docs/mitsuba.md",
        "wanted of the reflectance factor, {}",
        lambda: (power(default("glazejax.appearance.mitsuba:glaze_bsdf", "tolerance")),),
    ),
    ("docs/mitsuba.md", "at {} random angles", lambda: (of("glazejax.appearance.mitsuba.table:_CHECKS"),)),
]


@pytest.mark.parametrize(("document", "words", "numbers"), SAID, ids=lambda value: value if type(value) is str else "")
def test_the_text_says_what_the_program_does(document, words, numbers):
    said = " ".join((ROOT / document).read_text("utf-8").split())
    assert words.format(*numbers()) in said, f"{document} should say: {words.format(*numbers())}"
