"""Formats of makers: those that are read, and those that are named with what to export.

`TRIED` lists makers and formats; docs/instruments.md says the same.
"""

import io
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from glazejax.io import open_cube

from ..refusals import refusal
from .cubes.images import IMAGE, WAVELENGTHS
from .cubes.test_kinds import agree
from .samples import GRID, same, spectra

DOCS = Path(__file__).parents[2] / "docs" / "instruments.md"


def qtx(unit=100.0, **changes):
    """Two standards in percent, 400 to 700 nm by 10."""
    sections = []
    for number, (name, row) in enumerate(zip(["dark red", "blue"], spectra(2), strict=True)):
        kind = ("STANDARD", "STD") if number == 0 else ("BATCH", "BAT")
        keys = {
            "NAME": name,
            "REFLPOINTS": len(GRID),
            "REFLINTERVAL": 10,
            "REFLLOW": 400,
            "R": ",".join(f"{unit * value:.6g}" for value in row),
        } | changes
        lines = "\n".join(f"{kind[1]}_{key}={text}" for key, text in keys.items())
        sections.append(f"[{kind[0]}_DATA {number}]\n{lines}\n")
    return "".join(sections)


def test_datacolor_qtx_is_percent_however_dark(read):
    table = read(qtx(unit=1.0), "match.txt")
    same(table, GRID, spectra(2) / 100, ["dark red", "blue"], atol=1e-7)
    assert table.unit == "percent"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"REFLPOINTS": 30}, "31 readings, where the first section has 30 from 400 nm by 10"),
        ({"REFLLOW": "x"}, "must be numbers"),
        ({"R": ""}, "no section has STD_R="),
    ],
)
def test_qtx_that_is_not_legal(read, changes, message):
    with refusal(message):
        read(qtx(**changes), "match.qtx")


def procspec(**texts):
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("OOIVersion.txt", "1")
        file.writestr(
            "ps_3.xml",
            "<Spectrum><source><pixelValues><double>9e3</double></pixelValues></source>"
            + "".join(f"<{title}>{text}</{title}>" for title, text in texts.items())
            + "</Spectrum>",
        )
    return archive.getvalue()


def doubles(values):
    return "".join(f"<double>{value}</double>" for value in values)


def test_procspec_is_read(read):
    texts = {"channelWavelengths": doubles(GRID)}
    with refusal(r"no plain numbers of processedPixels: .*save it as ASCII"):
        read(procspec(**texts), "leaf.ProcSpec")
    texts["processedPixels"] = doubles(100 * spectra(1)[0])
    table = read(procspec(**texts), "leaf.ProcSpec")
    same(table, GRID, spectra(1), ["leaf"], atol=1e-9)
    assert table.format == "SpectraSuite .ProcSpec"


OLE = b"\xd0\xcf\x11\xe0" + bytes(99)
NAMED = {
    "Galactic SPC": (b"\0K" + bytes(600), "JCAMP-DX or as text"),
    "Bruker OPUS": (b"\n\n\xfe\xfe" + bytes(99), r"\.dpt"),
    "Thermo OMNIC": (b"Spectral Data File\r\n" + bytes(99), "CSV or JCAMP-DX"),
    "PerkinElmer": (b"PEPE2D constant interval" + bytes(99), "ASCII or JCAMP-DX"),
    "Renishaw": (b"WDF1" + bytes(99), "text"),
    "JASCO": (OLE + "Y-Data".encode("utf-16-le") + bytes(99), "ASCII or JCAMP-DX"),
    "Word": (OLE + "WordDocument".encode("utf-16-le") + bytes(99), "UTF-8 CSV"),
    "CxF 2": (b'<?xml version="1.0"?><CXF xmlns="http://colorexchangeformat.com/v2"/>', "CxF3"),
    "MATLAB": (b"MATLAB 5.0 MAT-file" + bytes(99), "glazejax map"),
}


@pytest.mark.parametrize("maker", NAMED)
def test_formats_that_are_not_read_are_named_with_the_way_out(read, maker):
    content, way_out = NAMED[maker]
    with refusal(f"{maker}.*{way_out}"):
        read(content, "file.dat")


def test_a_table_may_begin_with_such_a_word(read):
    text = "PEPE,400,410,420\nWDF1,.1,.2,.3\nSpectral Data File,.1,.2,.3\n"
    assert len(read(text, "file.dat")) == 2


@pytest.mark.parametrize("row", [True, False])
def test_matlab_5_cubes(tmp_path, row):
    wavelengths = np.array(WAVELENGTHS)[None if row else slice(None), ...]
    savemat(tmp_path / "scene.mat", {"R": IMAGE, "lambda": wavelengths, "note": "made up"})
    agree(open_cube(tmp_path / "scene.mat"), IMAGE)


@pytest.mark.parametrize("block", [0, 512])
def test_matlab_7_cubes_have_their_axes_in_reverse(tmp_path, block):
    import h5py

    path = tmp_path / "scene.mat"
    with h5py.File(path, "w", userblock_size=block) as file:
        file["R"] = IMAGE.transpose(2, 1, 0)
        file["wavelengths"] = np.array(WAVELENGTHS)[:, None]
    if block:
        with path.open("r+b") as stream:
            stream.write(b"MATLAB 7.3 MAT-file")
    agree(open_cube(path), IMAGE)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_folder_of_png_is_a_cube_of_counts(tmp_path, dtype):
    most = int(np.iinfo(dtype).max)
    values = np.round(IMAGE * most).astype(dtype)
    for number, nm in enumerate(WAVELENGTHS):
        Image.fromarray(values[..., number]).save(tmp_path / f"scene_{nm:g}nm.png")
    cube = open_cube(tmp_path, scale=most)
    agree(cube, values / most)
    np.testing.assert_allclose(cube[3:9:2, 4], (values / most)[3:9:2, 4], atol=1e-6)
    with refusal("a camera's counts"):
        open_cube(tmp_path)
    Image.new("RGB", (31, 23)).save(tmp_path / "scene_600nm.png")
    with refusal(r"scene_600nm.png: \(23, 31, 3\)"):
        open_cube(tmp_path, scale=most)


TRIED = {
    "Tested on real files:": ["ASD", "SVC", "ECOSTRESS", "USGS", "CGATS", "CxF3"],
    "On files written by their description:": [
        "QTX",
        "ProcSpec",
        "JCAMP-DX",
        "MATLAB",
        "SpectraSuite",
        "Avantes",
    ],
    "Not read": [maker for maker in NAMED if maker != "MATLAB"],
}


@pytest.mark.parametrize("how", TRIED)
def test_the_page_of_instruments_says_how_each_maker_was_tried(how):
    _, there, words = DOCS.read_text().partition(f"**{how}**")
    assert there
    sentence = " ".join(re.split(r"\n\n|\*\*", words)[0].split())
    for maker in TRIED[how]:
        assert maker in sentence
