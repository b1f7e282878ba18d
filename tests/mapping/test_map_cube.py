"""Maps of a small image, from the image to the store, beside searches of its pixels."""

import os
from typing import Any

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose

from glazefit import Noise
from glazefit.mapping.map_cube import map_cube
from glazefit.mapping.solve.spots import spot_pigment
from glazefit.mapping.solve.task import map_task
from glazefit.mapping.store.export import export_map
from glazefit.mapping.store.layout import BY_NAME, Status, Way
from glazefit.mapping.store.store import MapStore, open_map
from glazejax import Glaze, Hemispherical, Layer, Pigment, reflectance
from glazejax.geometry import resolve_instrument
from glazejax.io import CubeSource
from glazejax.io.cubes.arrays import envi_cube
from tests.io.cubes.images import envi
from tests.mapping import small

from ..refusals import refusal
from .toy import Said, local_cluster, store_at

NOISE = Noise(0.003, 0.0003)
GRID = np.linspace(400.0, 700.0, 31)
FEW = [small.paints()[small.PAINTS.index(name)] for name in small.FEW]


class Stopped(Exception):
    """What ends a run before its map is whole."""


@pytest.fixture(scope="module", autouse=True)
def _few_searches():
    """In two pieces."""
    with pytest.MonkeyPatch.context() as patch:
        for module in ("features", "by_paint"):
            patch.setattr(f"glazefit.mapping.solve.{module}.REPRESENTATIVES", (64, 4000))
        patch.setattr("glazefit.mapping.solve.by_paint.PaintSearcher.piece", 32)
        patch.setattr("glazefit.mapping.solve.survey._CHECKED", (48, 48))
        yield


@pytest.fixture(scope="module")
def cube():
    scene = small.scene()
    spectra = scene.rows(0, 24)
    spectra[0, :3] = np.nan
    slope = np.linspace(1.0, 1.01, spectra.shape[-1])
    spectra[1, 0] = 0.0005 * slope
    spectra[1, 1] = -0.3 * slope
    spectra[1, 2] = 3.0 * slope
    return small.image(spectra, scene.wavelengths)


@pytest.fixture(scope="module")
def options(cube) -> dict[str, Any]:
    mask = np.ones(cube.shape[:2], bool)
    mask[-1] = False
    return {"ground": small.scene().ground, "mask": mask, "max_paints": 2, "noise": NOISE}


@pytest.fixture
def map_of(options: dict[str, Any], tmp_path):
    """Maps an image by some paints, with options changed."""

    def map_image(image, paints, **changes) -> xarray.Dataset:
        return map_cube(image, paints, out=tmp_path / "map", **(options | changes))

    return map_image


@pytest.fixture(scope="module")
def made(cube, options, tmp_path_factory):
    """A map by few paints, what it said on the way, and where it lies."""
    said = Said()
    out = tmp_path_factory.mktemp("map") / "map.zarr"
    return map_cube(cube, FEW, out=out, progress=said, **options), said, out


def test_every_pixel_is_answered_or_marked(made, cube):
    found, said, out = made
    status = found["status"].values
    assert (status[0, :3] == Status.NO_DATA).all()
    assert status[1, :3].tolist() == [Status.DARK, Status.NEGATIVE, Status.TOO_BRIGHT]
    assert (status[-1] == Status.MASKED).all()
    mapped = status == Status.MAPPED
    assert mapped.sum() == 23 * 40 - 6
    for name in BY_NAME:
        assert name in found
    assert np.isfinite(found["probability"].values[mapped]).all()
    assert np.isnan(found["probability"].values[~mapped]).all()
    total = found["probability"] + found["none"]
    assert (total.values[mapped] <= 1 + 1e-5).all()
    # A set's paints are at least as probable as the set.
    members = found["members"].values
    each = np.take_along_axis(
        found["paint_probability"].values, np.maximum(members, 0).astype(int), axis=-1
    )
    there = (members >= 0) & mapped[..., None]
    assert (each >= found["probability"].values[..., None] - 1e-4)[there].all()
    sums = np.where(there, found["fraction"].values, 0.0).sum(axis=-1)
    assert_allclose(sums[mapped], 1.0, atol=1e-5)
    assert [stage for done, total, stage in said if done == total][-1] == "mapping"
    sums = MapStore(out).sums()
    assert sums.tallies["mapped"] == mapped.sum() == sum(one.pixels for one in sums.sets.values())
    assert sums.tallies["no data"] == 3
    # Sums of a set are those of its pixels, over all windows.
    image = small.at_bands(cube["wavelength"].values, FEW)
    own = image.means(cube.values.reshape(-1, cube.sizes["wavelength"]))
    named = np.where(found["explained"].values[..., None] == 1, np.sort(members), -1)
    for paints, one in sums.sets.items():
        inside = mapped & (named == np.sort([*paints, -1, -1, -1][:3])).all(axis=-1)
        readings = own[inside.ravel()].astype(float)
        assert one.pixels == len(readings)
        assert_allclose(one.spectrum, readings.sum(axis=0), rtol=1e-5)
        assert_allclose(one.square, (readings**2).sum(axis=0), rtol=1e-5)
        if paints:
            thickness = found["thickness"].values[inside]
            assert one.pixels_with_thickness == np.isfinite(thickness).sum()
            assert one.thickness == pytest.approx(np.nansum(thickness), rel=1e-5)
            assert np.abs(one.fitted / one.pixels - readings.mean(axis=0)).mean() < 0.02


def test_colours_are_those_of_the_spectra(made, cube):
    from glazejax.colour import srgb

    found = made[0]
    wanted = np.asarray(srgb(cube["wavelength"].values, cube.values[4:8, 4:8].astype(float)))
    assert np.abs(found["true_colour"].values[4:8, 4:8] / 255.0 - wanted).max() < 0.02


def test_what_no_paint_explains_is_offered_as_paints(made):
    found, _, out = made
    none = (found["status"].values == Status.MAPPED) & (found["explained"].values == 0)
    kept = MapStore(out).sums().unexplained
    assert kept.pixels.sum() == none.sum() > 0
    spots = found.attrs["spots"]
    assert 0 < len(spots) <= 10
    for spot in spots:
        assert none[tuple(spot["place"])]
        assert len(spot["reading"]) == len(found.attrs["working_wavelengths"])
        assert spot["pixels"] <= none.sum()


def test_the_map_says_how_far_it_agrees(made):
    """With searches of single pixels."""
    agreement = made[0].attrs["agreement"]
    assert agreement["pixels"] == 48
    assert agreement["first"] > 0.9
    assert agreement["explained"] >= 0.95
    assert agreement["probability"] < 0.05
    assert agreement["amount"] < 0.2


def test_a_second_run_does_nothing_again(made, cube, options: dict[str, Any], monkeypatch):
    found, _, out = made
    before = found.compute()

    def never(*_):
        raise AssertionError("a finished window was solved again")

    monkeypatch.setattr("glazefit.mapping.solve.solver.PixelSolver.solve", never)
    monkeypatch.setattr("glazefit.mapping.solve.by_paint.PaintSearcher.search", never)
    monkeypatch.setattr("glazefit.mapping.map_cube.agreement", never)
    xarray.testing.assert_equal(map_cube(cube, FEW, out=out, **options), before)
    with refusal(r"other options \(max_paints: 2 there, 3 now\)"):
        map_cube(cube, FEW, out=out, **dict(options, max_paints=3))


@pytest.mark.slow
def test_an_interrupted_run_ends_as_an_undisturbed_one(made, cube, map_of):
    def stop_at(stage, done):
        def stop(parts, total, words):
            if words == stage and parts >= done:
                raise Stopped

        return stop

    for stage, done in (("searching", 1), ("checking", 0), ("mapping", 0)):
        with pytest.raises(Stopped):
            map_of(cube, FEW, progress=stop_at(stage, done))
    xarray.testing.assert_equal(map_of(cube, FEW), made[0])


@pytest.mark.slow
def test_a_cluster_gives_the_same_map(made, cube, map_of):
    """In double precision, whose digits must arrive on the workers, and in the same pieces."""
    distributed = pytest.importorskip("distributed")
    with (
        local_cluster(2, processes=True) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        found = map_of(cube, FEW, client=client)
    xarray.testing.assert_equal(found, made[0])


@pytest.mark.slow
def test_spectra_far_from_all_others_are_searched(cube, map_of, monkeypatch):
    """A stroke that no sampled line has."""
    monkeypatch.setattr("glazefit.mapping.solve.survey._LINES", 4)
    spectra = np.repeat(np.repeat(cube.values[5:6, 5:6], 24, axis=0), 40, axis=1)
    spectra = spectra + 0.001 * np.random.default_rng(1).standard_normal(spectra.shape).astype("f4")
    spectra[10, 20:30] = cube.values[15, 30]
    strokes = small.image(spectra, cube["wavelength"].values)
    found = map_of(strokes, small.paints(), mask=None, max_paints=1)
    way = found["way"].values
    assert (way[10, 20:30] == Way.SEARCHED).any()
    assert np.isin(way[10, 20:30], (Way.SEARCHED, Way.NEIGHBOUR)).all()
    assert (np.delete(way, 10, axis=0) == Way.UPDATED).mean() > 0.98


@pytest.mark.slow
def test_a_window_that_the_mask_leaves_out_is_empty(cube, map_of, monkeypatch):
    monkeypatch.setattr("glazefit.mapping.map_cube.chunk_shape", lambda *_, **__: (12, 20))
    mask = np.zeros((24, 40), bool)
    mask[:12, :20] = True
    mask[14, 30] = True
    found = map_of(cube, small.paints()[:2], mask=mask, max_paints=1)
    status = found["status"].values
    assert (status[:12, 20:] == Status.MASKED).all()
    assert (status == Status.MAPPED).sum() == 240 - 6 + 1
    assert found.attrs["tallies"]["mapped"] == 235


@pytest.mark.slow
def test_films_that_hide_their_ground_have_no_thickness(cube, tmp_path):
    found = map_cube(
        cube[4:10, 4:12],
        small.paints(),
        opaque=True,
        out=tmp_path / "map",
        max_paints=1,
        noise=NOISE,
    )
    told = found["condition"].values == 0
    assert told.any()
    assert np.isnan(found["thickness"].values[told]).all()


def test_a_spot_is_a_paint_whose_hiding_film_reads_the_spot():
    seen_by = resolve_instrument()
    spectrum = 0.1 + 0.5 / (1 + np.exp(-(GRID - 560) / 20))
    paint = spot_pigment("Stroke", GRID, spectrum, small.paints(), seen_by)
    film = reflectance(Glaze([Layer(paint, 0.01)], 0.0, 1.5), Hemispherical())
    assert_allclose(film, spectrum, atol=2e-3)
    assert paint.absorption_sd is not None
    for wrong, words in ((np.full(31, 1.5), r"reads 1\.5"), (np.full(5, 0.5), "has 5 readings")):
        with refusal(words):
            spot_pigment("Wrong", GRID, wrong, small.paints(), seen_by)


@pytest.mark.slow
def test_a_spot_of_the_image_is_found_in_it(cube, tmp_path):
    spectrum = cube.values[15, 30].astype(float)
    found = map_cube(
        cube[14:16, 28:32],
        small.paints()[:3],
        out=tmp_path / "map",
        spots={"Stroke": spectrum},
        opaque=True,
        max_paints=1,
        noise=NOISE,
    )
    assert found["paint"].values.tolist()[-1] == "Stroke"
    assert found["paint_probability"].values[1, 2, 3] > 0.2


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ground": 1.5}, "internal reflectance is 1.5"),
        ({"ground": np.full(7, 0.5)}, "neither a number nor one for each of 61 bands"),
        ({"mask": np.ones((3, 3), bool)}, "mask has 3 x 3 pixels, the image 24 x 40"),
        ({"ground": None}, "what is under the paint"),
        ({"opaque": True}, "opaque films show no ground"),
        ({"max_paints": 4}, "max_paints is 4"),
        ({"mask": np.zeros((24, 40), bool)}, "no pixel that can be mapped"),
        ({"memory": 2**20}, "memory bound is 1 MiB; with .* it must be at least"),
        (
            {"image": xarray.DataArray(np.zeros((3, 4, 5)), dims=("x", "y", "band")), "mask": None},
            "dimensions y, x, wavelength",
        ),
        ({"image": small.image(np.zeros((3, 4, 31)), GRID / 1000), "mask": None}, "in nm"),
        (
            {
                "image": small.image(np.full((6, 8, 31), np.nan), GRID),
                "mask": None,
                "noise": None,
                "ground": 0.5,
            },
            r"no pixel that can be mapped .* 48 no data",
        ),
    ],
)
def test_what_does_not_fit_is_said(cube, map_of, change, words):
    with refusal(words):
        map_of(**{"image": cube, "paints": small.paints()} | change)


def test_an_image_that_changed_is_another(options: dict[str, Any], tmp_path):
    """Whatever changed in it, the image or its white, and when."""
    path = tmp_path / "cube.npy"
    white = tmp_path / "white.npy"
    np.save(path, np.full((200, 200, 31), 0.4, "f4"))
    np.save(white, np.full(31, 0.9, "f4"))
    source = CubeSource(path, wavelengths=tuple(GRID.tolist()), white=white)
    asked = options | {"mask": None, "max_paints": 1, "ground": 0.5}

    def begin() -> MapStore:
        task = map_task(source, small.paints(), **asked)
        return store_at(tmp_path / "map", options=task.options)

    begin()
    begin()
    for file in (path, white):
        time = file.stat().st_mtime_ns
        os.utime(file, ns=(0, time + 1))
        with refusal(r"other options \(image: time of change is another\)"):
            begin()
        os.utime(file, ns=(0, time))
        begin()
    # Its numbers, as if it had not been touched.
    np.save(white, np.full(31, 0.8, "f4"))
    os.utime(white, ns=(0, time))
    with refusal(r"other options \(image: hash is another\)"):
        begin()


@pytest.mark.parametrize(
    "change",
    [
        {"wavelengths": GRID + 10.0},
        {"absorption_sd": np.full(31, 0.2)},
        {"scattering_sd": np.full(31, 0.1)},
        {"error_modes": np.full((1, 2, 31), 0.1)},
        {"family": "zinc white"},
        {"source": "another hand"},
    ],
)
def test_a_paint_that_changed_is_another(change: dict[str, Any]):
    image = small.image(np.full((2, 2, 31), 0.4, "f4"), GRID)
    usual: dict[str, Any] = {
        "name": "Paint",
        "wavelengths": GRID,
        "absorption": np.full(31, 1.0),
        "scattering": np.full(31, 2.0),
        "absorption_sd": np.full(31, 0.1),
    }
    further = Pigment("Other", GRID, np.full(31, 2.0), np.full(31, 1.0))
    kept, same, changed = (
        map_task(image, [Pigment(**described), further], opaque=True).options["catalogue"]
        for described in (usual, usual, usual | change)
    )
    assert kept == same
    assert kept["Paint"] != changed["Paint"]
    assert kept["Other"] == changed["Other"]


def test_a_map_keeps_the_place_of_its_image(map_of, tmp_path, monkeypatch):
    """Of a part of it, with larger pixels; and as an export has it."""

    def stop(*_):
        raise Stopped

    # The place is written as a map is begun.
    monkeypatch.setattr("glazefit.mapping.map_cube.survey", stop)
    values = np.full((12, 16, 31), 0.4)
    place = ["UTM", "1", "1", "500000", "4000000", "2", "3", "33", "North", "WGS-84"]
    fields = {
        "map info": [*place, "units=Meters"],
        "coordinate system string": ['PROJCS["x"', "y]"],
    }
    path = envi(values, folder=tmp_path, dtype="f4", wavelengths=GRID, **fields)
    source = CubeSource(path, window=(4, 12, 6, 16), binning=(2, 2, 1))
    with pytest.raises(Stopped):
        map_of(source, FEW, mask=None, ground=0.5)
    corner = "UTM, 1, 1, 500012.0, 3999988.0, 4.0, 6.0, 33, North, WGS-84, units=Meters"
    assert open_map(tmp_path / "map").attrs["map_info"] == corner
    header, _ = export_map(tmp_path / "map", tmp_path / "export.hdr")
    lines = header.read_text().splitlines()
    assert f"map info = {{ {corner} }}" in lines
    assert 'coordinate system string = { PROJCS["x",y] }' in lines
    again = envi_cube(header, None)
    assert again.y is not None
    assert again.x is not None
    assert_allclose(again.y, source.open().y)
    assert_allclose(again.x, source.open().x)


def test_the_bar_moves_in_every_stage(made):
    said = made[1]
    assert list(dict.fromkeys(stage for _, _, stage in said)) == [
        "reading",
        "surveying",
        "searching",
        "checking",
        "mapping",
    ]
    for stage in ("reading", "surveying"):
        done = [done for done, _, words in said if words == stage]
        assert len(set(done)) > 20
        assert done == sorted(done)
        assert next(d == of for d, of, words in reversed(said) if words == stage)
