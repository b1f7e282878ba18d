"""The command `glazejax map`, with a solver that answers at once: what is asked for is written, and
nothing is lost.
"""

import csv
import functools
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose

import glazefit.mapping.example
import glazefit.mapping.map_cube
from glazefit.identify.families.expected import EXPECTED
from glazefit.mapping.options import read_bands, read_binning, read_memory, read_spots, read_window
from glazefit.mapping.store.chunk import ChunkMaps, SetSum
from glazefit.mapping.store.layout import Status
from glazefit.mapping.store.store import MapStore, open_map
from glazejax import catalogue
from tests.commands import invoke
from tests.io.cubes.images import envi
from tests.mapping.toy import empty_arrays, local_cluster, run_chunks

GRID = np.arange(400.0, 701.0, 30.0)
SHAPE, CHUNK = (12, 10), (4, 10)


OILS = ("--catalogue", "oils")
ONE = (*OILS, "--only", "ZincWhite")
TWO = (*OILS, "--only", "ZincWhite,Eosin")


pytestmark = pytest.mark.usefixtures("here")
run = functools.partial(invoke, "map")


def fail(complaint, *words):
    """Assert that a command ends with an error of one line in which this stands."""
    done = run(*words)
    assert isinstance(done.exception, ValueError | OSError), done.output
    assert complaint in str(done.exception)
    assert "\n" not in str(done.exception)


def succeed(*words):
    """What comes of a command that ends well."""
    done = run(*words)
    assert done.exception is None, done.output
    return done


@pytest.fixture(scope="module")
def cube(tmp_path_factory) -> Path:
    """An ENVI image of some grey, its left column the bare ground."""
    values = np.full((*SHAPE, GRID.size), 0.4)
    values[:, 0] = 0.7
    values[0, 5, 3] = np.nan
    units = {"wavelength units": "Nanometers"}
    folder = tmp_path_factory.mktemp("cube")
    return envi(values, folder=folder, dtype="f4", name="panel", wavelengths=GRID, **units)


@dataclass(frozen=True)
class Halves:
    """The first paint on the left, the first two on the right; the last row was left out."""

    paints: int

    def solve(self, window) -> ChunkMaps:
        y, x = window.shape
        arrays = empty_arrays(window.shape, self.paints)
        arrays["status"][:] = Status.MASKED
        rows = min(y, SHAPE[0] - 1 - window.y0)
        there = {name: values[:rows] for name, values in arrays.items()}
        there["status"][:] = Status.MAPPED
        there["members"][..., 0] = 0
        there["members"][:, x // 2 :, 1] = 1
        there["fraction"][..., :2] = np.where(there["members"][..., :2] >= 0, 0.5, np.nan)
        there["paint_probability"][:] = 0.02
        there["paint_probability"][..., 0] = 0.9
        for name in ("probability", "misfit", "rmse", "none"):
            there[name][:] = 0.1
        there["thickness"][:] = 20e-6
        there["explained"][:] = 1
        there["true_colour"][:] = 120
        half = rows * (x // 2)
        one = SetSum(
            half,
            half * np.full(GRID.size, 0.4),
            half * np.full(GRID.size, 0.41),
            half * np.full(GRID.size, 0.17),
            half * 20e-6,
            half,
        )
        tallies = {"mapped": float(rows * x), "left out by the mask": float((y - rows) * x)}
        return ChunkMaps(arrays, tallies, {(0,): one, (0, 1): one})


def interrupt() -> None:
    raise KeyboardInterrupt


def terminate() -> None:
    os.kill(os.getpid(), signal.SIGTERM)
    # The signal is heard between two steps of Python.
    time.sleep(5)


@pytest.fixture
def mapped(monkeypatch) -> list[dict]:
    """What `map_cube` is called with; it maps halves, and is stopped after two windows as `stops`
    does it.
    """
    calls: list[dict] = []

    def map_cube(source, pigments, *, out, overwrite, progress, client, **given):
        stops = next((call["stops"] for call in calls if "stops" in call), None)
        calls.append({"cube": source, "pigments": pigments, "client": client, **given})
        names = [*(p.name for p in pigments), *(given["spots"] or ())]
        shape = source.open().shape[:2]
        store = MapStore.create(
            out,
            shape,
            CHUNK,
            names,
            options={"path": source.path},
            overwrite=overwrite,
            attrs={
                "working_wavelengths": GRID,
                "representatives": 7,
                "notes": ["a note"],
                "agreement": {
                    "pixels": 9,
                    "first": 1.0,
                    "explained": 1.0,
                    "probability": 0.01,
                    "probability_90": 0.02,
                    "amount": float("nan"),
                    "amount_90": float("nan"),
                },
            },
        )

        def note(done, total, words):
            progress(done, total, words)
            if stops and done == 2:
                stops()

        run_chunks(store, Halves(len(names)), client, note)
        store.note(tallies=store.sums().tallies)
        return open_map(out)

    monkeypatch.setattr(glazefit.mapping.map_cube, "map_cube", map_cube)
    return calls


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("", "no CUBE was given"),
        ("none.hdr --example", "leave out none.hdr, or leave out --example"),
        ("none.hdr", "what is under the paint"),
        ("none.hdr --opaque", "there is no such file"),
        ("none.hdr --opaque --ground 0.9", "show no ground"),
        ("none.hdr --opaque --bare", "give --ground too"),
        ("none.hdr --opaque --max-paints 4", "--max-paints is 4"),
        ("none.hdr --opaque --memory much", "--memory is 'much'"),
        ("none.hdr --opaque --window 3:1,0:4", "--window is '3:1,0:4'"),
        ("none.hdr --opaque --bin 0", "--bin is '0'"),
        ("none.hdr --opaque --bands 700-400", "--bands is '700-400'"),
        ("none.hdr --opaque --wavelengths none.txt", "--wavelengths is 'none.txt'"),
        ("none.hdr --opaque --white-reflectance 99", "--white-reflectance is 99"),
        (
            "none.hdr --opaque --white-reflectance none.txt",
            "neither a number nor a file",
        ),
        ("none.hdr --opaque --export map.tif", "--export map.tif: maps are exported as"),
        ("none.hdr --opaque --out none.hdr", "which is CUBE"),
        ("none.hdr --opaque --out none/map.zarr", "does not exist"),
        ("none.hdr --opaque --csv a.nc --export a.nc", "are both a.nc"),
        ("none.hdr --opaque --report map.zarr", "are both map.zarr"),
        ("none.hdr --opaque --report map.html", "name a folder for them, such as map"),
        ("none.hdr --opaque --scheduler tcp://127.0.0.1:1", "there is no such file"),
    ],
)
def test_bad_options_end_in_one_sentence(arguments, complaint, mapped):
    fail(complaint, *arguments.split())
    assert not os.listdir()
    assert not mapped


@pytest.mark.parametrize(
    ("files", "arguments", "complaint"),
    [
        ("a.raw a.hdr", "a.raw --export a.img", "--export is a.hdr, a file that is read"),
        ("a a.hdr", "a --export a.img", "--export is a.hdr, a file that is read"),
        ("a.raw a.raw.hdr", "a.raw --csv a.raw.hdr", "--csv is a.raw.hdr, a file that is read"),
        ("a.img a.img.hdr", "a.img.hdr --export a.hdr", "--export is a.img, a file that is read"),
        ("w.raw w.hdr", "a.hdr --white w.raw --export w.img", "--export is w.hdr, a file that"),
        ("nm.csv", "a.hdr --wavelengths nm.csv --csv nm.csv", "--csv is nm.csv, a file that"),
        ("w.csv", "a.hdr --white-reflectance w.csv --csv w.csv", "--csv is w.csv, a file that"),
        (
            "page/references.csv",
            "a.hdr --references page/references.csv --report page",
            "--report page holds references.csv, a file that is read",
        ),
        (
            "page/paints_with_spots.csv",
            "a.hdr --pigments page/paints_with_spots.csv --report page",
            "--report page holds paints_with_spots.csv, a file that is read",
        ),
    ],
)
def test_no_file_that_is_read_is_replaced(files, arguments, complaint, mapped):
    kept = {Path(file) for file in files.split()}
    for file in kept:
        file.parent.mkdir(exist_ok=True)
        file.write_text("kept")
    fail(complaint, *arguments.split(), "--opaque", "--overwrite")
    assert {file for file in Path().rglob("*") if file.is_file()} == kept
    assert {file.read_text() for file in kept} == {"kept"}
    assert not mapped


def test_options_are_read_as_they_are_written():
    assert read_memory("2GiB") == 2**31
    assert read_memory("800 MB") == 800_000_000
    assert read_memory("1.5g") == 3 * 2**29
    assert read_window("1:3,10:30") == (10, 30, 1, 3)
    assert read_window("") is None
    assert read_binning("2") == (2, 2, 1)
    assert read_binning("2,3,4") == (2, 3, 4)
    assert read_bands("420-700 nm") == (420.0, 700.0)
    assert read_spots(["A = 1,2", "B=m.png"], ["C"]) == {"A": "1,2", "B": "m.png"}
    for texts in (["A"], ["=1,2"], ["A="], ["C=1,2"], ["A=1,2", "A=3,4"]):
        with pytest.raises(ValueError, match="--spot"):
            read_spots(texts, ["C"])


def test_a_map_its_report_its_table_and_its_exports_are_written(
    tmp_path, monkeypatch, cube, mapped
):
    monkeypatch.setattr("glazefit.mapping.show.page.write_pictures", lambda *_, **__: [])
    files = ["--report", "page", "--csv", "sets.csv", "--export", "map.nc", "--out", "panel.zarr"]
    subject = ["--object", "Panel", "--inventory", "A-1", "--operator", "N.N."]
    done = succeed(cube, "--ground", "0.9", *TWO, *files, *subject)
    assert "10 x 12 pixels: 110 mapped; 10 left out by the mask." in done.output
    assert sorted(os.listdir()) == [
        "map.nc",
        "page",
        "panel.zarr",
        "sets.csv",
    ]
    rows = list(csv.DictReader((tmp_path / "sets.csv").open()))
    assert [(row["paints"], row["pixels"], float(row["share"])) for row in rows] == [
        ("ZincWhite", "55", 0.5),
        ("ZincWhite + Eosin", "55", 0.5),
    ]
    numbers = {
        "thickness_um": 20.0,
        "rmse_of_mean": 0.01,
        "sd_of_pixels": 0.1,
        "measured_430": 0.4,
        "fitted_700": 0.41,
    }
    assert {title: float(rows[0][title]) for title in numbers} == pytest.approx(numbers)
    with xarray.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as exported:
        assert int((exported.status == Status.MAPPED).sum()) == 110
    page = (tmp_path / "page" / "report.html").read_text()
    command = (
        f"glazejax map {cube} --ground 0.9 --catalogue oils --only ZincWhite,Eosin --report page "
        "--csv sets.csv --export map.nc --out panel.zarr --object Panel --inventory A-1 "
        "--operator N.N."
    )
    for words in (
        command,
        "7 spectra of the image were searched in full",
        "Same first set",
        "a note",
        "reflectance 0.9",
        "<dt>Object</dt><dd>Panel</dd>",
        "<dt>Inventory number</dt><dd>A-1</dd>",
        "<dt>Operator</dt><dd>N.N.</dd>",
    ):
        assert words in page
    # What is there already is not replaced unasked, and a finished map is not made again.
    for kept in ("--csv", "--export", "--report"):
        assert isinstance(
            run(cube, "--ground", "0.9", *files[: files.index(kept) + 2]).exception, FileExistsError
        )
    succeed(cube, "--ground", "0.9", *TWO, "--out", "panel.zarr")
    words = ("--ground", "0.9", *ONE, "--out", "panel.zarr")
    fail("was begun with other options (paints: ", cube, *words)
    succeed(cube, "--ground", "0.9", *OILS, "--only", "ZincWhite,BoneBlack", *files, "--overwrite")
    assert open_map("panel.zarr").paint.values.tolist() == ["ZincWhite", "BoneBlack"]


@pytest.mark.parametrize(
    ("stops", "status", "words"), [(interrupt, 130, "Interrupted"), (terminate, 143, "Stopped")]
)
def test_a_stop_keeps_what_is_finished_and_says_how_to_go_on(cube, mapped, stops, status, words):
    before = signal.getsignal(signal.SIGTERM)
    mapped.append({"stops": stops})
    for more, how in (([], ""), (["--overwrite"], " without --overwrite")):
        done = run(cube, "--opaque", *TWO, *more)
        assert done.exit_code == status
        assert (
            f"{words}: 2 of 3 windows are finished and kept in map.zarr; the same command{how} "
            "goes on from there." in " ".join(done.output.split())
        )
    assert signal.getsignal(signal.SIGTERM) == before
    mapped.clear()
    assert "110 mapped" in succeed(cube, "--opaque", *TWO).output


def test_an_interrupt_before_there_is_a_map_is_only_that(monkeypatch, cube):
    monkeypatch.setattr(glazefit.mapping.map_cube, "map_cube", lambda *_, **__: interrupt())
    done = run(cube, "--opaque")
    assert done.exit_code in (1, 130)
    assert "finished" not in done.output
    monkeypatch.setattr(glazefit.mapping.map_cube, "map_cube", lambda *_, **__: terminate())
    done = run(cube, "--opaque")
    assert done.exit_code == 143
    assert "Stopped: no map was begun." in done.output


def test_pigments_are_mapped_unless_another_catalogue_is_named(cube, mapped):
    for words, name in (([], "pigments"), (OILS, "oils")):
        done = succeed(cube, "--opaque", "--out", f"{name}.zarr", *words)
        assert [p.name for p in mapped[-1]["pigments"]] == list(catalogue.load(name))
        assert done.output.splitlines()[-1].startswith(f"Asked: {name}, ")
    # Far fewer films are of no family than of no paint of one maker.
    assert mapped[0]["prior"] == EXPECTED
    assert mapped[1]["prior"].unknown > EXPECTED.unknown


def test_ground_and_spots_are_measured_in_the_cube(cube, mapped):
    succeed(cube, "--ground", "cube:0:1,2:10", *ONE, "--spot", "Grey=2:4,3:6", "--spot", "Bare=0,1")
    (call,) = mapped
    assert call["ground"].shape == GRID.shape
    # In air it reads 0.7; under paint it is brighter, as the surface throws light back to it.
    assert 0.8 < call["ground"].min() <= call["ground"].max() < 0.95
    assert_allclose(call["spots"]["Grey"], 0.4, rtol=1e-6)
    assert_allclose(call["spots"]["Bare"], 0.7, rtol=1e-6)
    assert call["cube"].path.is_absolute()
    assert call["noise"] is None
    for words, complaint in (
        (["--ground", "cube:0:99,0:1"], "does not lie in the image"),
        (["--ground", "cube:5,0"], "1 bands have no reading there"),
        (["--opaque", "--spot", "A=5,0"], "1 bands have no reading there"),
        (["--opaque", "--spot", "ZincWhite=2,2"], "a paint 'ZincWhite' already"),
        (["--opaque", "--spot", "A=none.png"], "neither a place such as"),
    ):
        fail(complaint, cube, "--out", "other.zarr", *ONE, *words)


def test_a_ground_needs_to_be_known_only_where_paints_are(cube, mapped):
    paints = [
        f"{name},{nm:g},1000,50000"
        for name in ("Own", "Other")
        for nm in np.arange(450.0, 641.0, 10.0)
    ]
    Path("own.csv").write_text(
        "\n".join(["pigment,wavelength_nm,absorption,scattering", *paints]) + "\n"
    )
    Path("ground.csv").write_text("Name,450,550,650\ncard,0.5,0.6,0.7\n")
    succeed(cube, "--pigments", "own.csv", "--ground", "ground.csv")
    assert_allclose(
        mapped[0]["ground"][2:9], np.interp(GRID[2:9], [450, 550, 650], [0.5, 0.6, 0.7]), atol=0.01
    )


def test_a_dask_scheduler_is_asked(cube, mapped):
    pytest.importorskip("distributed")
    with local_cluster() as cluster:
        succeed(cube, "--opaque", *TWO, "--scheduler", cluster.scheduler_address)
        assert mapped[0]["client"].status == "closed"
    assert int((open_map("map.zarr").status == Status.MAPPED).sum()) == 110


@pytest.mark.slow
def test_the_example_is_made_and_mapped(tmp_path, monkeypatch, mapped):
    small = functools.partial(glazefit.mapping.example.painting, (6, 8), 8)
    monkeypatch.setattr(glazefit.mapping.example, "painting", small)
    succeed("--example", "--out", "small.zarr")
    made = small()
    assert mapped[0]["cube"].path == tmp_path / "small-example" / "painting.hdr"
    assert_allclose(mapped[0]["ground"], made.ground, atol=1e-6)
    oils = {*catalogue.load("oils")} - {glazefit.mapping.example.FOREIGN}
    assert {paint.name for paint in mapped[0]["pigments"]} == oils
    # A second run maps the same painting.
    before = (tmp_path / "small-example" / "painting.dat").stat().st_mtime_ns
    words = ("--opaque", *OILS, "--only", "ZincWhite,BoneBlack", "--overwrite")
    succeed("--example", "--out", "small.zarr", *words)
    assert (tmp_path / "small-example" / "painting.dat").stat().st_mtime_ns == before
    assert mapped[1]["ground"] is None
    assert mapped[1]["opaque"]
    assert [paint.name for paint in mapped[1]["pigments"]] == ["ZincWhite", "BoneBlack"]
