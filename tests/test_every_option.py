"""Every option of every command changes what it should: a table with an entry for each, checked for
gaps.

An entry is a pair of command lines, without and with the option, and what the computation then gets
(the computation itself does not run), or the name of a test that looks at what the whole command
does. That what the computation gets changes what it finds is tested beside each computation; for
`identify`, in tests/fitting/test_identify_options.py.
"""

import functools
import importlib
import inspect
import json
from collections.abc import Callable
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import glazefit
from glazefit import IdentificationOptions
from glazefit.posterior.sampling import Sampling
from glazefit.recipe.task import make_task
from glazejax import Hemispherical
from glazejax.commands.main import make_app

TESTS = Path(__file__).parent
GRID = np.arange(400.0, 701.0, 30.0)
# What each command computes with; the first that it comes to ends it.
ENGINES = {
    "render": ["glazejax.commands.rendering:render"],
    "identify": ["glazefit.identify.identify:identify_chunks"],
    "recover": [
        "glazefit.recover.film_by_film:recover_chunks",
        "glazefit.recover.joint:recover_jointly",
        "glazefit.film.simulate:simulate_paints",
    ],
    "predict": [
        "glazefit.recover.mixture:predict_mixture",
        "glazefit.recover.mixture:calibrate_mixture",
    ],
    "recipe": ["glazefit.recipe.task:make_task"],
    "posterior": [
        "glazefit.posterior.posterior:posterior_of_film",
        "glazefit.posterior.posterior:posterior_of_bands",
        "glazefit.posterior.stack_posterior:posterior_of_coats",
        "glazefit.film.simulate:simulate_films",
    ],
    "map": ["glazefit.mapping.map_cube:map_cube"],
    "export": [
        "glazejax.appearance.exports.fit:fit_openpbr",
        "glazejax.appearance.exports.textures:texture_set",
    ],
}


class Reached(Exception):
    """What a computation was called with."""

    def __init__(self, name: str, given: dict[str, Any]):
        self.name, self.given = name, given


class Reaches(NamedTuple):
    """What the computation gets with the option, and does not get without."""

    words: str
    found: Callable[[dict[str, Any]], Any]
    expected: Any
    base: str = ""
    """Words of both command lines, in place of the command's usual ones."""
    engine: str = ""
    """Name of the computation, where the option chooses it."""


class Looked(NamedTuple):
    """A test, FILE:NAME, that looks at what the whole command does."""

    test: str


def name_of(paint: Any) -> str:
    return paint.name


def grounds(given: dict[str, Any]) -> Any:
    below = given["ground"] if "ground" in given else given["grounds"]
    return None if below is None else round(float(np.asarray(below).flat[0]), 6)


def geometry(given: dict[str, Any]) -> Any:
    return given["instrument"].geometry


SPECTRA, FILMS = "spectra.csv", "films.csv"
JOINT = f"{FILMS} --out found --joint"
TUBE = "tube.csv --out found"
USUAL = {
    "render": "--coats ZincWhite:5um,CobaltBlue:9um",
    "identify": f"{SPECTRA} --ground 0.5",
    "recover": f"{FILMS} --out found",
    "predict": "1*ZincWhite",
    "recipe": "--lab 50,20,30",
    "posterior": f"{FILMS} --sample one --paints CobaltBlue,ZincWhite --out found",
    "map": "cube.npy --wavelengths bands.txt --ground 0.5",
    "export": "ZincWhite:5um,CobaltBlue:9um",
}
INSTRUMENT = {
    "--instrument": Reaches("--instrument d:0", geometry, Hemispherical(0.0)),
    "--refractive-index": Reaches(
        "--refractive-index 1.4", lambda g: g["instrument"].refractive_index, 1.4
    ),
    "--noise": Reaches("--noise 0.01", lambda g: g["noise"].floor, 0.01),
    "--noise-share": Reaches("--noise-share 0.07", lambda g: g["noise"].share, 0.07),
}
OWN_PAINTS = "--pigments paints.csv"
TEXTURES = "ZincWhite:5um,CobaltBlue:9um --to textures --thickness-map thick.npy"
BARE_CUBE, WHITE = (
    "cube.npy --wavelengths bands.txt",
    "cube.npy --wavelengths bands.txt --ground 0.5 --white white.txt",
)
TABLE: dict[str, dict[str, Reaches | Looked]] = {
    "render": {
        "--coats": Reaches(
            "--coats Eosin:7um",
            lambda g: [x.medium.name for x in g["glaze"].coats],
            ["Eosin"],
            base="--out x.png",
        ),
        "--stack": Looked("test_render.py:test_a_stack_is_written_and_drawn"),
        "--write-stack": Looked("test_render.py:test_a_stack_is_written_and_drawn"),
        "--ground": Reaches("--ground 0.3", lambda g: float(np.mean(g["glaze"].ground)), 0.3),
        "--refractive-index": Reaches(
            "--refractive-index 1.4", lambda g: g["glaze"].refractive_index, 1.4
        ),
        "--instrument": Reaches("--instrument d:8", lambda g: g["geometry"], Hemispherical(8.0)),
        "--illuminant": Reaches("--illuminant A", lambda g: g["illuminant"], "A"),
        "--observer": Reaches(
            "--observer 10", lambda g: g["observer"].startswith("CIE 1964"), True
        ),
        "--ladder": Reaches("--ladder CobaltBlue", lambda g: g["layer"], 1),
        "--pigments": Reaches(
            OWN_PAINTS, lambda g: float(g["glaze"].coats[0].medium.absorption[0]), 1000.0
        ),
        "--catalogue": Reaches(
            "--catalogue acrylics",
            lambda g: g["glaze"].coats[0].medium.wavelengths[0],
            380.0,
            base="--coats TitaniumWhite:9um",
        ),
        "--tolerance": Reaches("--tolerance 0.001", lambda g: g["tolerance"], 0.001),
        "--out": Looked("test_render.py:test_files_are_not_overwritten_unasked"),
        "--csv": Looked("test_render.py:test_numbers_picture_and_table"),
        "--overwrite": Looked("test_render.py:test_files_are_not_overwritten_unasked"),
        "--list": Looked("test_render.py:test_own_pigments_come_before_the_catalogue"),
    },
    "convert": {
        "source": Looked("test_convert.py:test_every_format"),
        "target": Looked("test_convert.py:test_every_format"),
        "--to": Looked("test_convert.py:test_format_by_name_of_the_option"),
        "--resample": Looked("test_convert.py:test_resampled_and_long"),
        "--long": Looked("test_convert.py:test_resampled_and_long"),
        "--overwrite": Looked("test_convert.py:test_existing_files_are_kept"),
    },
    "paints": {
        "--family": Looked("test_paints.py:test_a_family_is_listed_and_drawn"),
        "--out": Looked("test_paints.py:test_a_family_is_listed_and_drawn"),
        "--csv": Looked("test_paints.py:test_the_exemplars_as_a_table"),
        "--overwrite": Looked("test_paints.py:test_files_are_kept_unless_asked"),
    },
    "export": {
        "stack": Reaches(
            "Eosin:7um", lambda g: [x.medium.name for x in g["glaze"].coats], ["Eosin"], base=" "
        ),
        "--to": Reaches(
            "--to textures --thickness-map thick.npy", bool, True, engine="texture_set"
        ),
        "--out": Looked("appearance/test_exports_files.py:test_the_command_reads_a_stack_and_maps"),
        "--ground": Reaches("--ground 0.3", lambda g: float(np.mean(g["glaze"].ground)), 0.3),
        "--refractive-index": Reaches(
            "--refractive-index 1.4", lambda g: g["glaze"].refractive_index, 1.4
        ),
        "--roughness": Reaches("--roughness 0.2", lambda g: g["roughness"], 0.2),
        "--space": Reaches("--space acescg", lambda g: g["space"], "acescg"),
        "--illuminant": Reaches("--illuminant A", lambda g: g["illuminant"], "A"),
        "--observer": Reaches(
            "--observer 10", lambda g: g["observer"].startswith("CIE 1964"), True
        ),
        "--layering": Reaches("--layering reciprocal", lambda g: g["layering"], "reciprocal"),
        "--coat": Reaches("--coat", lambda g: g["coat"], True),
        "--thickness-map": Reaches(
            "--thickness-map three.npy", lambda g: g["thickness"].shape, (1, 3), base=TEXTURES
        ),
        "--thickness-range": Reaches(
            "--thickness-range 0-20um",
            lambda g: float(g["thickness"].max()),
            pytest.approx(8e-6),
            base=TEXTURES.replace("thick.npy", "share.npy"),
        ),
        "--fraction-map": Reaches(
            "--fraction-map thick.npy", lambda g: g["fraction"] is not None, True, base=TEXTURES
        ),
        "--ground-map": Reaches(
            "--ground-map thick.npy", lambda g: g["ground"] is not None, True, base=TEXTURES
        ),
        "--layer": Reaches("--layer 2", lambda g: g["layer"], 1, base=TEXTURES),
        "--pixel": Reaches(
            "--pixel 50um", lambda g: g["pixel"], pytest.approx(50e-6), base=TEXTURES
        ),
        "--format": Reaches("--format exr", lambda g: g["kind"], "exr", base=TEXTURES),
        "--delta-e": Reaches("--delta-e 0.7", lambda g: g["delta_e"], 0.7, base=TEXTURES),
        "--pigments": Reaches(
            OWN_PAINTS, lambda g: float(g["glaze"].coats[0].medium.absorption[0]), 1000.0
        ),
        "--tolerance": Reaches("--tolerance 0.001", lambda g: g["tolerance"], 0.001),
        "--overwrite": Looked(
            "appearance/test_exports_files.py:test_the_command_reads_a_stack_and_maps"
        ),
    },
    "scene": {
        "file": Looked(
            "appearance/test_scene_file.py:test_the_command_writes_a_picture_and_its_spectra"
        ),
        "--out": Looked(
            "appearance/test_scene_file.py:test_the_command_writes_a_picture_and_its_spectra"
        ),
        "--spectral": Looked(
            "appearance/test_scene_file.py:test_the_command_writes_a_picture_and_its_spectra"
        ),
        "--size": Looked(
            "appearance/test_scene_file.py:test_the_command_writes_a_picture_and_its_spectra"
        ),
        "--renderer": Looked("appearance/test_scene_file.py:test_the_command_path_traces"),
        "--samples": Looked("appearance/test_scene_file.py:test_the_command_path_traces"),
        "--overwrite": Looked(
            "appearance/test_scene_file.py:test_the_command_writes_a_picture_and_its_spectra"
        ),
        "--example": Looked("appearance/test_scene_file.py:test_the_example_is_printed"),
    },
    "identify": {
        "file": Reaches("films.csv", lambda g: g["names"], ("one", "two"), base="--noise 0.001"),
        "--ground": Reaches("--ground 0.3", grounds, 0.3),
        "--bare": Reaches("--bare", lambda g: 0.5 < grounds(g) < 0.8, True),
        "--opaque": Reaches(f"{SPECTRA} --opaque", grounds, None, base=" "),
        "--pigments": Reaches(
            OWN_PAINTS, lambda g: [*map(name_of, g["pigments"])], ["ZincWhite", "Own"]
        ),
        "--catalogue": Reaches(
            "--catalogue acrylics", lambda g: name_of(g["pigments"][-1]), "TitaniumWhite"
        ),
        "--only": Reaches(
            "--only Eosin,ZincWhite",
            lambda g: {*map(name_of, g["pigments"])},
            {"Eosin", "ZincWhite"},
        ),
        "--without": Reaches(
            "--without Eosin", lambda g: "Eosin" in {*map(name_of, g["pigments"])}, False
        ),
        "--samples": Reaches("--samples two", lambda g: tuple(g["names"]), ("two",)),
        "--max-paints": Reaches("--max-paints 1", lambda g: g["max_paints"], 1),
        "--max-coats": Reaches("--max-coats 2", lambda g: g["max_coats"], 2),
        "--thorough": Reaches("--thorough", lambda g: g["thorough"], True),
        "--own-films": Reaches("--own-films", lambda g: g["own_films"], True),
        "--elements": Reaches(
            "--elements Cu,Pb",
            lambda g: g["elements"],
            ("Cu", "Pb"),
            base=f"{SPECTRA} --opaque --catalogue pigments",
        ),
        "--without-elements": Reaches(
            "--without-elements Co",
            lambda g: g["without_elements"],
            ("Co",),
            base=f"{SPECTRA} --opaque --catalogue pigments",
        ),
        "--varnish": Reaches("--varnish none", lambda g: g["varnish"], "none"),
        "--painted": Reaches(
            "--painted 1620",
            lambda g: g["painted"],
            1620,
            base=f"{SPECTRA} --opaque --catalogue pigments",
        ),
        **INSTRUMENT,
        "--model-error": Reaches("--model-error 0.02", lambda g: g["discrepancy"].amplitude, 0.02),
        "--thickness": Reaches(
            "--thickness 40um", lambda g: g["prior"].thickness, pytest.approx(40e-6)
        ),
        "--top": Reaches("--top 9", lambda g: g["keep"], 9),
        "--csv": Looked("fitting/test_cli_identify.py:test_films_are_identified_written_and_drawn"),
        "--residuals": Looked(
            "fitting/test_cli_identify.py:test_films_are_identified_written_and_drawn"
        ),
        "--out": Looked("fitting/test_cli_identify.py:test_films_are_identified_written_and_drawn"),
        "--report": Looked("fitting/test_cli_identify.py:test_a_report_is_filed"),
        "--overwrite": Reaches(
            "--overwrite", bool, True, base=f"{SPECTRA} --ground 0.5 --csv paints.csv"
        ),
    },
    "recover": {
        "file": Looked("fitting/test_cli_recover.py:test_results_are_those_of_the_library"),
        "--out": Looked("fitting/test_cli_recover.py:test_results_are_those_of_the_library"),
        "--samples": Reaches("--samples two", lambda g: len(g["films"]), 1),
        "--masstones": Reaches("--masstones", lambda g: len(g["films"]), 1),
        "--names": Reaches("--names other.tsv", lambda g: "Umber" in str(g["films"].names), True),
        "--thickness": Reaches(
            "--simulate --thickness 40um",
            lambda g: g.get("thickness"),
            pytest.approx(40e-6),
            base="--out found --simulate",
        ),
        **INSTRUMENT,
        "--into": Reaches(
            "--into paints.csv",
            lambda g: [*(g["pigments"] or ())],
            ["ZincWhite", "Own"],
            base=TUBE,
            engine="recover_jointly",
        ),
        "--white": Reaches(
            "--white ZincWhite",
            lambda g: [*(g["pigments"] or ())],
            ["ZincWhite"],
            base=TUBE,
            engine="recover_jointly",
        ),
        "--catalogue": Reaches(
            "--catalogue acrylics --white TitaniumWhite",
            lambda g: [*(g["pigments"] or ())],
            ["TitaniumWhite"],
            base="acrylic.csv --out found",
            engine="recover_jointly",
        ),
        "--wet-film": Reaches(
            "--wet-film 80um±20%",
            lambda g: (g["gauge"].typical, g["gauge"].error),
            (pytest.approx(80e-6), 0.2),
            engine="recover_jointly",
        ),
        "--excluded": Reaches(
            "--excluded dull.csv",
            lambda g: g["gloss"],
            {"one": pytest.approx(0.8, abs=0.05)},
            engine="recover_jointly",
        ),
        "--simulate": Reaches(
            "--out found --simulate --samples Eosin",
            lambda g: [*map(name_of, g["paints"])],
            ["Eosin"],
            base=" ",
            engine="simulate_paints",
        ),
        "--seed": Reaches("--seed 7", lambda g: g["seed"], 7, base="--out found --simulate"),
        "--joint": Reaches("--joint", lambda g: "recipes" in g, True, engine="recover_jointly"),
        "--law": Reaches("--law strength", lambda g: g["law"].name, "strength", base=JOINT),
        "--check": Looked("fitting/test_cli_recover.py:test_mixtures_are_left_out_when_asked"),
        "--plots": Looked("fitting/test_cli_recover.py:test_names_and_masstones"),
        "--overwrite": Looked("fitting/test_cli_recover.py:test_overwrite"),
    },
    "predict": {
        "mixture": Reaches(
            "1*Eosin+4*ZincWhite", lambda g: g["recipe"], {"Eosin": 1.0, "ZincWhite": 4.0}, base=" "
        ),
        "--reading": Reaches(
            "--reading one.csv", lambda g: g["films"].names, ("one",), engine="calibrate_mixture"
        ),
        "--samples": Reaches(
            f"--reading {FILMS} --samples two",
            lambda g: g["films"].names,
            ("two",),
            base="1*ZincWhite --reading one.csv",
        ),
        "--film-thickness": Reaches(
            "--reading one.csv --film-thickness 40um±5%",
            lambda g: (g["gauge"].typical, g["gauge"].error),
            (pytest.approx(40e-6), 0.05),
            engine="calibrate_mixture",
        ),
        "--thickness": Reaches(
            "--thickness 5um,40um", lambda g: g["thickness"], pytest.approx([5e-6, 40e-6])
        ),
        "--csv": Looked("fitting/test_variation.py:test_command_says_how_sure_it_is"),
        "--pigments": Reaches(OWN_PAINTS, lambda g: [*g["pigments"]], ["ZincWhite", "Own"]),
        "--catalogue": Reaches(
            "1*TitaniumWhite --catalogue acrylics",
            lambda g: [*g["recipe"]],
            ["TitaniumWhite"],
            base=" ",
        ),
        "--instrument": INSTRUMENT["--instrument"],
        "--refractive-index": INSTRUMENT["--refractive-index"],
        "--illuminant": Looked("fitting/test_variation.py:test_light_and_eye_reach_the_colours"),
        "--observer": Looked("fitting/test_variation.py:test_light_and_eye_reach_the_colours"),
        "--overwrite": Reaches("--overwrite", bool, True, base="1*ZincWhite --csv paints.csv"),
    },
    "recipe": {
        "--lab": Reaches("--lab 60,10,5", lambda g: "60" in g["targets"][0].name, True, base=" "),
        "--srgb": Reaches(
            "--srgb #8a4b2d", lambda g: "8a4b2d" in g["targets"][0].name, True, base=" "
        ),
        "--spectrum": Reaches(f"--spectrum {SPECTRA}", lambda g: len(g["targets"]), 2, base=" "),
        "--samples": Reaches(
            "--samples two",
            lambda g: [*map(name_of, g["targets"])],
            ["two"],
            base=f"--spectrum {SPECTRA}",
        ),
        "--after": Looked("fitting/test_addition.py:test_command_says_what_to_add"),
        "--mixed": Looked("fitting/test_addition.py:test_command_says_what_to_add"),
        "--batch": Looked("fitting/test_addition.py:test_command_says_what_to_add"),
        "--colourchecker": Reaches("--colourchecker", lambda g: len(g["targets"]), 24, base=" "),
        "--patch": Reaches("--patch white", lambda g: len(g["targets"]), 1, base="--colourchecker"),
        "--illuminants": Reaches(
            "--illuminants D65,A", lambda g: [*g["illuminants"]], ["D65", "A"]
        ),
        "--test-illuminant": Reaches(
            "--test-illuminant FL11", lambda g: g["test_illuminant"], "FL11"
        ),
        "--observer": Reaches("--observer 10", lambda g: g["observer"], "10"),
        "--max-paints": Reaches("--max-paints 2", lambda g: g["max_paints"], 2),
        "--glazes": Reaches("--glazes", lambda g: g["glazes"], True),
        "--max-coats": Reaches("--max-coats 1", lambda g: g["max_coats"], 1),
        "--coat-thickness": Reaches(
            "--coat-thickness 2-7", lambda g: g["thickness"], pytest.approx((2e-6, 7e-6))
        ),
        "--only": Reaches(
            "--only Eosin,ZincWhite",
            lambda g: {*map(name_of, g["pigments"])},
            {"Eosin", "ZincWhite"},
        ),
        "--without": Reaches(
            "--without Eosin", lambda g: "Eosin" in [*map(name_of, g["pigments"])], False
        ),
        "--modern": Reaches(
            f"--modern {OWN_PAINTS} --catalogue oils",
            lambda g: {"EmeraldGreen", "Own", "ZincWhite"} & {*map(name_of, g["pigments"])},
            {"Own", "ZincWhite"},
            base=f"--lab 50,20,30 {OWN_PAINTS} --catalogue oils",
        ),
        "--pigments": Reaches(
            OWN_PAINTS, lambda g: [*map(name_of, g["pigments"])], ["ZincWhite", "Own"]
        ),
        "--catalogue": Reaches(
            "--catalogue acrylics", lambda g: name_of(g["pigments"][-1]), "TitaniumWhite"
        ),
        "--ground": Reaches("--ground 0.3", lambda g: float(np.mean(g["ground"])), 0.3),
        "--refractive-index": Reaches(
            "--refractive-index 1.4", lambda g: g["refractive_index"], 1.4
        ),
        "--instrument": Reaches("--instrument d:8", lambda g: g["instrument"], Hemispherical(8.0)),
        "--metamerism": Reaches("--metamerism 0.7", lambda g: g["metamerism"], 0.7),
        "--count": Reaches("--count 2", lambda g: g["count"], 2),
        "--seed": Reaches("--seed 7", lambda g: g["seed"], 7),
        "--out": Looked("fitting/test_cli_recipe.py:test_patches_of_a_chart"),
        "--csv": Looked("fitting/test_cli_recipe.py:test_patches_of_a_chart"),
        "--json": Looked("fitting/test_cli_recipe.py:test_patches_of_a_chart"),
        "--spectra": Looked("fitting/test_cli_recipe.py:test_patches_of_a_chart"),
        "--overwrite": Reaches("--overwrite", bool, True, base="--lab 50,20,30 --csv paints.csv"),
    },
    "studio": {
        "stack": Looked("studio/test_server.py:test_options_of_the_command"),
        "--page": Looked("studio/test_server.py:test_the_page_as_one_file"),
        "--catalogue": Looked("studio/test_server.py:test_the_page_as_one_file"),
        "--overwrite": Looked("studio/test_server.py:test_the_page_as_one_file"),
        "--no-open": Looked("studio/test_server.py:test_options_of_the_command"),
        "--port": Looked("studio/test_server.py:test_options_of_the_command"),
    },
    "posterior": {
        "file": Looked("fitting/test_posterior_chain.py:test_command_writes_what_it_says"),
        "--out": Reaches("--out other", lambda g: Path(g["path"]).parent.name, "other"),
        "--sample": Reaches("--sample two", lambda g: g["film"].names, ("two",)),
        "--paints": Reaches("--paints Eosin", lambda g: [*map(name_of, g["pigments"])], ["Eosin"]),
        "--coats": Reaches(
            "--coats Eosin:?,ZincWhite:20um",
            lambda g: [c.open_thickness for c in g["coats"]],
            [True, False],
            base=f"{FILMS} --sample one --out found",
            engine="posterior_of_coats",
        ),
        "--bands": Reaches(
            "--bands",
            lambda g: "pigments" in g,
            False,
            base=f"{FILMS} --sample one --out found",
            engine="posterior_of_bands",
        ),
        "--pigments": Reaches(
            OWN_PAINTS,
            lambda g: float(g["pigments"][0].absorption[0]),
            1000.0,
            base=f"{FILMS} --sample one --paints ZincWhite --out found",
        ),
        "--catalogue": Reaches(
            "--catalogue acrylics --paints TitaniumWhite",
            lambda g: [*map(name_of, g["pigments"])],
            ["TitaniumWhite"],
            base=f"{FILMS} --sample one --paints acrylics:CadmiumOrange --out found",
        ),
        "--ground": Reaches(
            "--ground 0.3",
            lambda g: float(np.asarray(g["film"].ground).flat[0]),
            0.3,
            base=f"{SPECTRA} --sample one --paints ZincWhite --out found --ground 0.9",
        ),
        "--thickness": Reaches(
            "--thickness 40um", lambda g: g["prior"].thickness, pytest.approx(40e-6)
        ),
        "--sampler": Reaches("--sampler emcee", lambda g: g["sampler"], "emcee"),
        "--steps": Reaches("--steps 70", lambda g: g["steps"], 70),
        "--walkers": Reaches("--walkers 48", lambda g: g["walkers"], 48),
        "--thin": Reaches("--thin 3", lambda g: g["thin"], 3),
        "--seed": Reaches("--seed 7", lambda g: g["seed"], 7),
        "--resume": Looked("fitting/test_posterior_chain.py:test_command_writes_what_it_says"),
        "--overwrite": Reaches("--overwrite", lambda g: g["overwrite"], True),
        "--paint-error": Reaches("--paint-error 0.2", lambda g: g["prior"].error, 0.2),
        **INSTRUMENT,
        "--simulate": Reaches(
            "--out found --paints Eosin --simulate",
            lambda g: g["names"],
            ["simulated"],
            base=" ",
            engine="simulate_films",
        ),
    },
    "map": {
        "cube": Reaches(
            "other.npy",
            lambda g: g["cube"].path.name,
            "other.npy",
            base="--wavelengths bands.txt --opaque",
        ),
        "--out": Reaches("--out other.zarr", lambda g: g["out"].name, "other.zarr"),
        "--wavelengths": Reaches(
            "--wavelengths bands.txt",
            lambda g: g["cube"].wavelengths,
            Path("bands.txt"),
            base="cube.npy --ground 0.5",
        ),
        "--dataset": Reaches(
            "--dataset two",
            lambda g: g["cube"].dataset,
            "two",
            base="cubes.nc --wavelengths bands.txt --ground 0.5",
        ),
        "--white": Reaches("--white white.txt", lambda g: g["cube"].white, Path("white.txt")),
        "--dark": Reaches(
            "--dark dark.txt", lambda g: g["cube"].dark, Path("dark.txt"), base=WHITE
        ),
        "--white-reflectance": Reaches(
            "--white-reflectance 0.9", lambda g: g["cube"].white_reflectance, 0.9, base=WHITE
        ),
        "--scale": Reaches("--scale 1.25", lambda g: g["cube"].scale, 1.25),
        "--window": Reaches("--window 1:4,0:3", lambda g: g["cube"].window, (0, 3, 1, 4)),
        "--mask": Reaches("--mask corner.csv", lambda g: g["mask"], Path("corner.csv")),
        "--bin": Reaches("--bin 2", lambda g: g["cube"].binning, (2, 2, 1)),
        "--bands": Reaches("--bands 420-650", lambda g: g["cube"].bands, (420.0, 650.0)),
        "--pigments": Reaches(
            OWN_PAINTS, lambda g: [*map(name_of, g["pigments"])], ["ZincWhite", "Own"]
        ),
        "--catalogue": Reaches(
            "--catalogue acrylics", lambda g: name_of(g["pigments"][-1]), "TitaniumWhite"
        ),
        "--only": Reaches(
            "--only Eosin,ZincWhite",
            lambda g: {*map(name_of, g["pigments"])},
            {"Eosin", "ZincWhite"},
        ),
        "--without": Reaches(
            "--without Eosin", lambda g: "Eosin" in {*map(name_of, g["pigments"])}, False
        ),
        "--spot": Reaches("--spot Grey=1,1", lambda g: [*g["spots"]], ["Grey"]),
        "--ground": Reaches("--ground 0.3", grounds, 0.3),
        "--bare": Reaches("--bare", lambda g: 0.5 < grounds(g) < 0.8, True),
        "--opaque": Reaches("--opaque", grounds, None, base=BARE_CUBE),
        "--max-paints": Reaches("--max-paints 1", lambda g: g["max_paints"], 1),
        "--max-coats": Reaches("--max-coats 2", lambda g: g["max_coats"], 2),
        "--instrument": INSTRUMENT["--instrument"],
        "--refractive-index": INSTRUMENT["--refractive-index"],
        "--noise": Reaches("--noise 0.01", lambda g: g["noise"] and g["noise"].floor, 0.01),
        "--noise-share": Reaches(
            "--noise-share 0.07", lambda g: g["noise"] and g["noise"].share, 0.07
        ),
        "--model-error": Reaches("--model-error 0.02", lambda g: g["discrepancy"].amplitude, 0.02),
        "--thickness": Reaches(
            "--thickness 40um", lambda g: g["prior"].thickness, pytest.approx(40e-6)
        ),
        "--memory": Reaches("--memory 3GiB", lambda g: g["memory"], 3 * 2**30),
        "--scheduler": Looked("mapping/test_command.py:test_a_dask_scheduler_is_asked"),
        "--report": Looked(
            "mapping/test_command.py:test_a_map_its_report_its_table_and_its_exports_are_written"
        ),
        "--csv": Looked(
            "mapping/test_command.py:test_a_map_its_report_its_table_and_its_exports_are_written"
        ),
        "--export": Looked(
            "mapping/test_command.py:test_a_map_its_report_its_table_and_its_exports_are_written"
        ),
        "--overwrite": Reaches("--overwrite", lambda g: g["overwrite"], True),
        "--example": Looked("mapping/test_command.py:test_the_example_is_made_and_mapped"),
    },
}


@pytest.fixture(scope="module")
def reach(tmp_path_factory):
    """Run a command line in a folder of small files; what its computation is called with. Each line
    runs once.
    """
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(tmp_path_factory.mktemp("options"))
        yield functools.cache(_reach(monkeypatch))


def _two_cubes(path: str) -> None:
    """A file of two images, of which one must be named."""
    import h5py

    with h5py.File(path, "w") as file:
        for name in ("one", "two"):
            file[name] = np.full((4, 5, GRID.size), 0.4, np.float32)


def _reach(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], Reached | None]:
    def table(path: str, rows: dict[str, float]) -> None:
        lines = [",".join(["Name", *(f"{w:g}" for w in GRID)])]
        lines += [",".join([name, *[f"{value:g}"] * GRID.size]) for name, value in rows.items()]
        Path(path).write_text("\n".join(lines) + "\n")

    table(SPECTRA, {"one": 0.4, "two": 0.6})
    cards = {"b": 0.06, "w": 0.85, "ob": 0.3, "ow": 0.5}
    table(
        FILMS, {f"{film}_{end}": value for film in ("one", "two") for end, value in cards.items()}
    )
    table("dull.csv", {f"one_{end}": value - 0.032 for end, value in cards.items()})
    table("one.csv", {f"one_{end}": value for end, value in cards.items()})
    mixed = ("Blue", "Blue 1:3 ZincWhite", "Blue 1:3 Own")
    table("tube.csv", {f"{film}_{end}": value for film in mixed for end, value in cards.items()})
    acrylic = ("Blue", "Blue 1:3 TitaniumWhite")
    table(
        "acrylic.csv", {f"{film}_{end}": value for film in acrylic for end, value in cards.items()}
    )
    Path("mixtures.tsv").write_text("one\tRed-White|100-0\ntwo\tRed-White|40-60\n")
    Path("other.tsv").write_text("one\tUmber|100\ntwo\tUmber-White|40-60\n")
    paints = [
        f"{name},{w:g},1000,50000"
        for name in ("ZincWhite", "Own")
        for w in np.arange(380.0, 731.0, 10.0)
    ]
    np.save("cube.npy", np.full((4, 5, GRID.size), 0.4, np.float32))
    np.save("other.npy", np.full((4, 5, GRID.size), 0.6, np.float32))
    np.savetxt("bands.txt", GRID)
    np.save("thick.npy", np.array([[2e-6, 4e-6]]))
    np.save("share.npy", np.array([[0.2, 0.4]]))
    np.save("three.npy", np.array([[2e-6, 4e-6, 1e-6]]))
    Path("corner.csv").write_text("0,0\n3,0\n0,3\n")
    np.savetxt("white.txt", np.full(GRID.size, 0.9))
    np.savetxt("dark.txt", np.full(GRID.size, 0.01))
    _two_cubes("cubes.nc")
    Path("paints.csv").write_text(
        "\n".join(["pigment,wavelength_nm,absorption,scattering", *paints]) + "\n"
    )

    def records(name: str, signature: inspect.Signature) -> Callable[..., None]:
        def record(*arguments, **named):
            given = signature.bind(*arguments, **named)
            given.apply_defaults()
            # What is handed on as one class of options counts as named.
            whole = dict(given.arguments)
            for group in ("sampling", "options", "search"):
                chosen = whole.pop(group, {})
                whole |= vars(chosen) if is_dataclass(chosen) else chosen
            raise Reached(name, whole)

        return record

    for engine in {engine for group in ENGINES.values() for engine in group}:
        path, name = engine.split(":")
        module = importlib.import_module(path)
        monkeypatch.setattr(module, name, records(name, inspect.signature(getattr(module, name))))

    def call(command: str, words: str) -> Reached | None:
        done = CliRunner().invoke(make_app(), [command, *words.split()])
        if isinstance(done.exception, Reached):
            return done.exception
        assert not words.strip() or done.exception is not None, done.output
        return None

    return call


def entries(kind: type) -> list:
    rows = [
        (c, o, entry)
        for c, group in TABLE.items()
        for o, entry in group.items()
        if isinstance(entry, kind)
    ]
    return [pytest.param(*row, id=f"{row[0]} {row[1]}") for row in rows]


@pytest.mark.parametrize(("command", "option", "entry"), entries(Reaches))
def test_the_computation_gets_what_the_option_says(
    reach, command: str, option: str, entry: Reaches
):
    base = entry.base or USUAL[command]
    # A later word for the same option takes the earlier one's place.
    with_it = reach(command, f"{base} {entry.words}")
    assert with_it is not None, "the computation was not reached"
    assert entry.found(with_it.given) == entry.expected
    assert entry.engine in ("", with_it.name)
    without = reach(command, base)
    if without is not None and without.name == with_it.name:
        assert entry.found(without.given) != entry.expected
    else:
        assert entry.engine or base.strip() != USUAL[command], (
            "without the option the command does not run"
        )


@pytest.mark.parametrize(
    ("command", "function", "names"),
    [
        ("identify", IdentificationOptions, {"max_paints", "max_coats", "thorough"}),
        ("map", IdentificationOptions, {"max_paints", "max_coats", "noise"}),
        ("map", glazefit.map_cube, {"memory", "overwrite"}),
        (
            "posterior",
            Sampling,
            {"sampler", "steps", "walkers", "thin", "seed", "resume", "overwrite"},
        ),
        (
            "recipe",
            make_task,
            {
                "refractive_index",
                "test_illuminant",
                "max_paints",
                "max_coats",
                "count",
                "metamerism",
                "seed",
                "thickness",
            },
        ),
    ],
)
def test_defaults_of_a_command_are_those_of_its_function(
    reach, command: str, function: Callable, names: set[str]
):
    usual = inspect.signature(function).parameters
    reached = reach(command, USUAL[command])
    assert reached is not None
    assert {name: reached.given[name] for name in names} == {
        name: usual[name].default for name in names
    }


@pytest.mark.parametrize(("command", "option", "entry"), entries(Looked))
def test_the_test_named_exists_and_uses_the_option(command: str, option: str, entry: Looked):
    file, name = entry.test.split(":")
    text = (TESTS / file).read_text(encoding="utf-8")
    _, found, after = text.partition(f"def {name}(")
    assert found, f"{file} has no {name}"
    body = after.partition("\ndef ")[0]
    names = (
        {option, "--no-plots"}
        if option == "--plots"
        else {option, "-o"}
        if option == "--out"
        else {option}
    )
    assert not option.startswith("--") or any(json.dumps(word) in body for word in names), (
        f"{name} has no {option}"
    )


def test_every_option_of_every_command_has_an_entry():
    commands = typer.main.get_command(make_app()).commands  # pyright: ignore[reportAttributeAccessIssue]
    there = {
        name: {p.opts[0] for p in command.params} - {"--help"} for name, command in commands.items()
    }
    assert there == {name: set(group) for name, group in TABLE.items()}
