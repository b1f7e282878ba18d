"""Every option of every command changes what the command does.

The options are those that the commands declare, and each gets a word. Where a command comes to its
computation, that is not run: what it is called with must differ from what it is called with without
the option, and a number must arrive as it was said. Other commands run, and their output or files
must differ. A file to write that is there is refused by its name. That what a computation is called
with changes what it finds is tested beside the computation.
"""

import dataclasses
import functools
import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import glazefit
from glazefit import IdentificationOptions
from glazefit.film.sampling import Sampling
from glazefit.recipe.task import make_task
from glazejax.appearance.scene.file import example

from .commands import commands, invoke
from .tables import rows

TESTS = Path(__file__).parent
GRID = np.arange(400.0, 701.0, 30.0)
# The computations: the first that a command comes to ends it.
ENGINES = {
    "glazejax.appearance.exports.fit": "fit_openpbr",
    "glazejax.appearance.exports.textures": "texture_set",
    "glazejax.appearance.scene.draw.render": "render",
    "glazejax.appearance.scene.path.path_trace": "path_trace",
    "glazejax.commands.rendering": "render",
    "glazejax.studio.command": "serve",
    "glazejax.studio.one_file": "one_file",
    "glazefit.film.simulate": "simulate_paints simulate_films",
    "glazefit.identify.families.references": "recover_jointly",
    "glazefit.identify.identify": "identify_chunks",
    "glazefit.mapping.map_cube": "map_cube",
    "glazefit.posterior.posterior": "posterior_of_film posterior_of_bands posterior_of_coats",
    "glazefit.recipe.command_after": "say_addition",
    "glazefit.recipe.task": "make_task",
    "glazefit.recover.fits": "recover_chunks recover_jointly",
    "glazefit.recover.predict.mixture": "predict_mixture calibrate_mixture",
}
USUAL = dict(
    rows("""
render | --coats ZincWhite:5um,CobaltBlue:9um
convert | spectra.csv new.csv
paints |
export | ZincWhite:5um,CobaltBlue:9um
scene | scene.toml
studio |
identify | spectra.csv --ground 0.5
recover | films.csv --out found
predict | 1*ZincWhite
recipe | --lab 50,20,30
posterior | films.csv --sample one --paints CobaltBlue,ZincWhite --out found
map | cube.npy --wavelengths bands.txt --ground 0.5
""")
)
# What follows an option, in all commands that have it. A flag needs nothing; a number with a default
# that is not here gets another one.
WORDS = """
bands=420-650 bin=2 catalogue=acrylics coat-thickness=2-7 coats=Eosin:7um dark=dark.txt dataset=two
elements=Cu,Pb excluded=dull.csv family=azurite film-thickness=40um±5% format=exr
fraction-map=thick.npy ground=0.3 ground-map=thick.npy illuminant=A illuminants=A instrument=d:0
into=paints.csv lab=60,10,5 ladder=CobaltBlue layering=reciprocal mask=corner.csv
max-coats=2 max-paints=2 memory=3GiB mixed=1*ZincWhite model-error=0.021 names=other.tsv noise=0.013
noise-share=0.07 observer=2 only=Eosin,ZincWhite painted=1620 paints=Eosin patch=white
pigments=paints.csv pixel=50um reading=one.csv references=own.csv renderer=mitsuba
quantity=reflectance refractive-index=1.4 resample=400:600:50 sample=two
sampler=emcee out=other.zarr samples=two scale=1.25 scheduler=tcp://127.0.0.1:9 size=8x6 space=acescg
spectrum=spectra.csv spot=Grey=1,1 srgb=#8a4b2d stack=stack.json steps=70 test-illuminant=FL11
thickness=40um unit=percent thickness-map=three.npy thickness-range=0-20um thin=3 varnish=none walkers=48
wavelengths=bands.txt wet-film=80um±20% white=white.txt white-reflectance=0.9 window=1:4,0:3
without=Eosin without-elements=Co to=cxf after=one.csv batch=100
"""
# Files to write, of which one is there already; but --out is a folder of some.
FILES = """
csv=there.csv export=there.npy json=there.json out=there.png page=there.html report=there.html
residuals=there.csv spectra=there.csv spectral=there.npz write-stack=there.json
"""
FOLDERS = ("map", "posterior", "recover")
# Where these do not serve: options of a command, the line without them, and what is added to it. An
# argument has another line.
LINES = """
render --coats --stack | --out x.png
render --catalogue | --coats TitaniumWhite:9um
convert source | | films.csv new.csv
convert target | | spectra.csv other.csv
identify --scale | spectra.csv --ground 0.5 | --scale 1.25
identify --top | spectra.csv --ground 0.5 | --top 50
recover --scale | films.csv --out found | --scale 1.25
posterior --scale | ONE --paints ZincWhite | --scale 1.25
convert --quantity | odd.csv new.csv
identify --quantity | odd.csv --opaque
recover --quantity | odd.csv --out found
predict --quantity | 1*ZincWhite --reading odd.csv
predict --unit | 1*ZincWhite --reading one.csv
predict --scale | 1*ZincWhite --reading one.csv | --scale 1.25
recipe --quantity | --spectrum odd.csv
recipe --unit | --spectrum spectra.csv
recipe --scale | --spectrum spectra.csv | --scale 1.25
posterior --quantity | odd.csv --sample one --paints ZincWhite --out found
paints --quantity | --references strange.csv
paints --unit | --references cards.csv
paints --scale | --references cards.csv | --scale 1.25
map --quantity | radiance.nc --wavelengths bands.txt --ground 0.5
map --unit | cube.npy --wavelengths bands.txt --ground 0.5
convert --overwrite | spectra.csv there.csv
paints --out | --family azurite
paints --instrument | --references cards.csv | --references cards.csv --instrument 45:0
export stack | | Eosin:7um
export --to | ZincWhite:5um | --to textures --thickness-map thick.npy
export --thickness-map --fraction-map --ground-map --layer --pixel --format --delta-e | TEXTURES
export --thickness-range | ZincWhite:5um --to textures --thickness-map share.npy
export --overwrite | TEXTURES --out there
scene file | | other.toml
scene --samples | scene.toml --renderer mitsuba | --samples 32
scene --example |
scene --overwrite | scene.toml --out there.png
studio stack | | stack.json
studio --catalogue | | --catalogue paints.csv
studio --overwrite | --page there.html
identify file | | films.csv --ground 0.5
identify --opaque | spectra.csv
identify --references | spectra.csv --opaque --instrument 45:0 --catalogue pigments
identify --elements --without-elements --painted | spectra.csv --opaque --catalogue pigments
recover file | | one.csv --out found
recover --thickness --seed | --out found --simulate
recover --simulate | --out found --samples Eosin
recover --into | tube.csv --out found
recover --white | tube.csv --out found | --white ZincWhite
recover --catalogue | acrylic.csv --out found --white TitaniumWhite
recover --overwrite | films.csv --out made
predict mixture | | 1*Eosin+4*ZincWhite
predict --samples | 1*ZincWhite --reading films.csv
predict --film-thickness | 1*ZincWhite --reading one.csv
predict --thickness | 1*ZincWhite | --thickness 5um,40um
predict --catalogue | 1*TitaniumWhite
recipe --lab --srgb --spectrum --colourchecker |
recipe --samples --spectra | --spectrum spectra.csv
recipe --patch | --colourchecker
recipe --modern | --lab 50,20,30 --pigments paints.csv --catalogue oils
recipe --after | --lab 50,20,30 | --after one.csv --mixed 1*ZincWhite
recipe --mixed | --lab 50,20,30 --after one.csv
recipe --batch | --lab 50,20,30 --after one.csv --mixed 1*ZincWhite
posterior file | | dull.csv --sample one --paints ZincWhite --out found
posterior --coats | ONE | --coats Eosin:?,ZincWhite:20um
posterior --bands | ONE
posterior --pigments | ONE --paints ZincWhite
posterior --catalogue | ONE --paints TitaniumWhite
posterior --ground | spectra.csv --sample one --paints ZincWhite --out found --ground 0.9
posterior --simulate | --out found --paints Eosin
posterior --overwrite | films.csv --sample one --paints CobaltBlue,ZincWhite --out found
map cube | | other.npy --wavelengths bands.txt --ground 0.5
map --wavelengths | cube.npy --ground 0.5
map --opaque | cube.npy --wavelengths bands.txt
map --dataset | cubes.nc --wavelengths bands.txt --ground 0.5
map --dark --white-reflectance | CUBE --white white.txt
map --overwrite | CUBE
"""
# What happens after the computation: tests of the whole command, FILE:NAME.
AFTERWARDS = dict(
    rows("""
export --out | appearance/test_exports_files.py:test_the_command_reads_a_stack_and_maps
identify --object | fitting/test_cli_identify.py:test_a_report_is_filed
identify --inventory | fitting/test_cli_identify.py:test_a_report_is_filed
identify --spot | fitting/test_cli_identify.py:test_a_report_is_filed
identify --operator | fitting/test_cli_identify.py:test_a_report_is_filed
map --object | mapping/test_command.py:test_a_map_its_report_its_table_and_its_exports_are_written
map --inventory | mapping/test_command.py:test_a_map_its_report_its_table_and_its_exports_are_written
map --operator | mapping/test_command.py:test_a_map_its_report_its_table_and_its_exports_are_written
map --example | mapping/test_command.py:test_the_example_is_made_and_mapped
map --scheduler | mapping/test_command.py:test_a_dask_scheduler_is_asked
posterior --resume | fitting/test_posterior_chain.py:test_command_writes_what_it_says
predict --illuminant | fitting/test_variation.py:test_light_and_eye_reach_the_colours
predict --observer | fitting/test_variation.py:test_light_and_eye_reach_the_colours
recover --check | fitting/test_cli_recover.py:test_mixtures_are_left_out_when_asked
recover --out | fitting/test_cli_recover.py:test_results_are_those_of_the_library
recover --plots | fitting/test_cli_recover.py:test_names_and_masstones
""")
)


SHORT = {
    "TEXTURES": "ZincWhite:5um,CobaltBlue:9um --to textures --thickness-map thick.npy",
    "ONE": "films.csv --sample one --out found",
    "CUBE": USUAL["map"],
}


def pairs(text: str) -> dict[str, str]:
    return dict(pair.split("=", 1) for pair in text.split())


def cases() -> dict[str, list[str]]:
    """By command and option: the line without it, and what is added to it where that is said."""
    by_name = {}
    for names, *columns in rows(LINES):
        command, *options = names.split()
        words = [" ".join(SHORT.get(word, word) for word in each.split()) for each in columns]
        by_name |= {f"{command} {option}": words for option in options}
    return by_name


CASES, NEW_WORDS, WRITTEN = cases(), pairs(WORDS), pairs(FILES)


class Reached(Exception):
    """A computation, and what it was called with."""

    def __init__(self, name: str, arguments: dict[str, Any]):
        self.name, self.arguments = name, arguments


def plain(value: Any) -> Any:
    """A value as lists, words and numbers, which compare by what they hold."""
    if isinstance(value, (bool, int, float, str, type(None))):
        return value
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return [[*value.shape], np.asarray(value).ravel().tolist()]
    if isinstance(value, dict):
        return [[plain(key), plain(each)] for key, each in value.items()]
    if isinstance(value, (set, frozenset)):
        return sorted(map(plain, value))
    if isinstance(value, (list, tuple)):
        return [*map(plain, value)]
    if type(value).__module__.startswith("glaze") and hasattr(value, "__dict__"):
        return plain(vars(value))
    return str(value) if isinstance(value, Path) else type(value).__name__


def is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def numbers(value: Any) -> Iterator[float]:
    """All numbers of a plain value."""
    if isinstance(value, list):
        for each in value:
            yield from numbers(each)
    elif isinstance(value, (int, float)):
        yield value


@pytest.fixture(scope="module")
def call(tmp_path_factory):
    """Run a command line in a folder of small files; what it did. Each line runs once."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(tmp_path_factory.mktemp("options"))
        monkeypatch.setenv("COLUMNS", "300")
        write_files()
        for path, names in ENGINES.items():
            module = importlib.import_module(path)
            for name in names.split():
                monkeypatch.setattr(module, name, records(name, getattr(module, name)))
        yield functools.cache(call_command)


def records(name: str, computation: Callable[..., Any]) -> Callable[..., None]:
    signature = inspect.signature(computation)

    def record(*arguments, **named):
        bound = signature.bind(*arguments, **named)
        bound.apply_defaults()
        # What is handed on as one class of options counts as named.
        whole = dict(bound.arguments)
        for group in ("sampling", "options", "search"):
            options = whole.pop(group, {})
            whole |= vars(options) if dataclasses.is_dataclass(options) else options
        raise Reached(name, whole)

    return record


def call_command(line: str) -> Reached | tuple[bool, str, list]:
    """What the computation was called with; or whether all went well, the output, and the files."""
    before = {*Path().rglob("*")}
    done = invoke(*line.split())
    if isinstance(done.exception, Reached):
        return done.exception
    written = sorted(path for path in {*Path().rglob("*")} - before if path.is_file())
    files = [(path.name, path.read_bytes()) for path in written]
    for path in written:
        path.unlink()
    return done.exit_code == 0, f"{done.output}{done.exception}", files


def write_files() -> None:
    def table(path: str, spectra: dict[str, float]) -> None:
        lines = [["Name", *(f"{w:g}" for w in GRID)]]
        lines += [[name, *[f"{value:g}"] * GRID.size] for name, value in spectra.items()]
        Path(path).write_text("\n".join(map(",".join, lines)) + "\n")

    def films(path: str, *names: str, less: float = 0.0) -> None:
        cards = {"b": 0.06, "w": 0.85, "ob": 0.3, "ow": 0.5}
        table(path, {f"{n}_{end}": value - less for n in names for end, value in cards.items()})

    for path, name in (("odd.csv", "one"), ("strange.csv", "PB29")):
        films(path, name, less=0.032)
        Path(path).write_text("Data units,Radiance\n" + Path(path).read_text())
    table("spectra.csv", {"one": 0.4, "two": 0.6})
    films("films.csv", "one", "two")
    films("one.csv", "one")
    films("dull.csv", "one", less=0.032)
    films("cards.csv", "PB29", less=0.032)
    table("own.csv", {"PB29": 0.4})
    films("tube.csv", "Blue", "Blue 1:3 ZincWhite", "Blue 1:3 Own")
    films("acrylic.csv", "Blue", "Blue 1:3 TitaniumWhite")
    paints = ["pigment,wavelength_nm,absorption,scattering"]
    for name in ("ZincWhite", "Own"):
        paints += [f"{name},{w:g},1000,50000" for w in np.arange(380.0, 731.0, 10.0)]
    cube = np.full((4, 5, GRID.size), 0.4, np.float32)
    with h5py.File("cubes.nc", "w") as file:
        for name in ("one", "two"):
            file[name] = cube
    with h5py.File("radiance.nc", "w") as file:
        file["radiance"] = cube
    np.save("cube.npy", cube)
    np.save("other.npy", 1.5 * cube)
    np.savetxt("bands.txt", GRID)
    np.savetxt("white.txt", np.full(GRID.size, 0.9))
    np.savetxt("dark.txt", np.full(GRID.size, 0.01))
    np.save("thick.npy", [[2e-6, 4e-6]])
    np.save("share.npy", [[0.2, 0.4]])
    np.save("three.npy", [[2e-6, 4e-6, 1e-6]])
    Path("made").mkdir()
    texts = {
        "mixtures.tsv": "one\tRed-White|100-0\ntwo\tRed-White|40-60\n",
        "other.tsv": "one\tUmber|100\ntwo\tUmber-White|40-60\n",
        "paints.csv": "\n".join(paints) + "\n",
        "stack.json": '{"glazejax": "stack", "coats": [{"paint": {"Eosin": 1}, "um": 7}]}',
        "scene.toml": example(),
        "other.toml": example().replace("width = 640", "width = 320"),
        "corner.csv": "0,0\n3,0\n0,3\n",
        **dict.fromkeys([*WRITTEN.values(), "made/pigments.csv"], "there\n"),
    }
    for path, text in texts.items():
        Path(path).write_text(text)


def declared() -> Iterator[Any]:
    """Each option of each command, as typer declares them."""
    for name, command in commands().items():
        for option in command.params:
            if (word := option.opts[0]) != "--help":
                yield pytest.param(name, option, id=f"{name} {word}")


def word_after(option: Any) -> str:
    """The word of the table, or another number than the usual one."""
    name, usual = option.opts[0].removeprefix("--"), option.default
    if getattr(option, "is_flag", False):
        return ""
    if name == "observer":
        return "2" if usual == "10" else "10"
    if name in NEW_WORDS:
        return NEW_WORDS[name]
    if isinstance(usual, int):
        return str(usual + 3 if usual > 1 else usual + 1)
    return f"{0.93 * usual or 0.17:g}"


@pytest.mark.parametrize(("command", "option"), list(declared()))
def test_an_option_changes_what_the_command_does(call, command: str, option: Any):
    name = option.opts[0]
    case, short = f"{command} {name}", name.removeprefix("--")
    if case in AFTERWARDS:
        check_test(AFTERWARDS[case], name)
        return
    usual = USUAL[command] + (" --csv there.csv" if name == "--overwrite" else "")
    base, *added = CASES.get(case, [usual])
    writes = short in WRITTEN and (name != "--out" or command not in FOLDERS)
    word = WRITTEN[short] if writes else "" if added else word_after(option)
    without = call(f"{command} {base if name.startswith('--') else usual}")
    with_it = call(f"{command} {base} {added[0] if added else f'{name} {word}'}")
    if writes:
        # It is there: refused before anything is computed.
        assert isinstance(with_it, tuple)
        assert not with_it[0]
        assert word in with_it[1]
        assert isinstance(without, Reached) or without[0]
    elif isinstance(with_it, Reached):
        arrived = plain(with_it.arguments)
        if isinstance(without, Reached):
            assert (with_it.name, arrived) != (without.name, plain(without.arguments))
        if is_number(word) and name != "--observer":
            assert float(word) in set(numbers(arrived))
    else:
        assert with_it[0], with_it[1]
        assert with_it != without


def check_test(test: str, option: str) -> None:
    """The test is there, and has the option."""
    file, name = test.split(":")
    _, there, after = (TESTS / file).read_text(encoding="utf-8").partition(f"def {name}(")
    assert there, f"{file} has no {name}"
    body = after.partition("\ndef ")[0]
    words = {"--out": ("--out", "-o"), "--plots": ("--plots", "--no-plots")}.get(option, (option,))
    # Alone, or in a line of words.
    assert {*words} & {*re.findall(r"(?<=[\"\s])--?[a-z][\w-]*", body)}, f"{name} has no {option}"


@pytest.mark.parametrize(
    ("command", "function", "names"),
    [
        ("identify", IdentificationOptions, "max_paints max_coats thorough"),
        ("map", IdentificationOptions, "max_paints noise"),
        ("map", glazefit.map_cube, "memory overwrite"),
        ("posterior", Sampling, "sampler steps walkers thin seed resume overwrite"),
        (
            "recipe",
            make_task,
            "refractive_index test_illuminant max_paints max_coats count metamerism seed thickness",
        ),
    ],
)
def test_defaults_of_a_command_are_those_of_its_function(
    call, command: str, function: Callable, names: str
):
    usual = inspect.signature(function).parameters
    reached = call(f"{command} {USUAL[command]}")
    for name in names.split():
        assert reached.arguments[name] == usual[name].default
