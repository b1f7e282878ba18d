import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazejax.io import read_spectra

from .samples import GRID, refused, same, spectra
from .samples import jcamp_block as block

FILE = "paint.dx"


@pytest.mark.parametrize("form", ["XYPOINTS", "XYDATA"])
def test_one_spectrum(read, form):
    table = read(block(form=form))
    same(table, GRID, spectra(1), ["red"], atol=1e-6)
    assert table.format == "JCAMP-DX"
    assert table.notes == ["no unit is stated: taken as fractions"]


def test_written_by_the_package(tmp_path):
    import jcamp

    data = {
        "title": "red",
        "jcamp-dx": 4.24,
        "xunits": "NANOMETERS",
        "yunits": "REFLECTANCE",
        "npoints": GRID.size,
        "firstx": GRID[0],
        "lastx": GRID[-1],
        "xfactor": 1,
        "yfactor": 1e-6,
        "x": GRID,
        "y": spectra(1)[0],
    }
    jcamp.writefile(str(tmp_path / "paint.dx"), data)
    same(read_spectra(tmp_path / "paint.dx"), GRID, spectra(1), ["red"], atol=2e-6)


@pytest.mark.parametrize(
    ("xunits", "grid"),
    [("MICROMETERS", GRID / 1000), ("1/CM", 1e7 / GRID), ("1/CM", 1e7 / GRID[::-1])],
)
def test_units_of_wavelength(read, xunits, grid):
    wanted = spectra(1)[0]
    values = np.interp(grid / 1e-3 if xunits[0] == "M" else 1e7 / grid, GRID, wanted)
    table = read(block(values=values, grid=grid, xunits=xunits))
    assert_allclose(table.wavelengths, GRID, rtol=1e-7)
    assert_allclose(table.reflectance, [wanted], atol=1e-7)
    assert table.notes


@pytest.mark.parametrize("linked", [True, False])
def test_many_blocks(read, linked):
    blocks = "".join(
        block(name, values) for name, values in zip("aab", spectra() * 100, strict=True)
    )
    blocks = blocks.replace("=REFLECTANCE", "=%REFLECTANCE")
    if linked:
        blocks = f"##TITLE=all\n##DATA TYPE=LINK\n##BLOCKS=3\n{blocks}##END=\n"
    table = read(blocks)
    same(table, GRID, spectra(), ["a", "a (2)", "b"], atol=1e-6)
    assert table.unit == "percent"


def test_a_repeated_difference_is_added_each_time(read):
    """The example of McDonald and Wilks, 1 2 3 3 2 1 0 -1 -2 -3 as 1JT%jX, fifty higher."""
    grid = np.arange(400.0, 491.0, 10.0)
    text = block(grid=grid, form="XYDATA").replace("##YFACTOR=1e-06", "##YFACTOR=0.01")
    text = re.sub(r"(?m)^400 .*\n(?:\d.*\n)*", "400E1JT%jX\n", text)
    values = np.array([1, 2, 3, 3, 2, 1, 0, -1, -2, -3]) + 50.0
    same(read(text), grid, [values / 100], ["red"], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (block().replace("##END=\n", ""), "no ##END=; the file was cut short"),
        (block()[:-50], "cut short"),
        (block().replace("##XYPOINTS", "##PEAKS"), "without data"),
        (
            block(form="XYDATA").replace("##NPOINTS=31", "##NPOINTS=40"),
            "promises 40 points and holds 31",
        ),
        (block(yunits="ABSORBANCE"), "'ABSORBANCE' is absorbance, and only reflectance"),
        (block(xunits="SECONDS"), "wavelengths are in 'SECONDS'"),
        (block(values=np.where(GRID == 500, np.nan, 0.5)), "not finite|promises|damaged"),
        (block(values=np.where(GRID == 500, -0.5, 0.5)), "negative at band 11"),
        (block(values=np.full(31, 4000.0)), "reaches 4000, too much for a fraction"),
        (block("a") + block("b", grid=GRID + 1), "'b' is on other wavelengths than 'a'"),
        (
            block("a") + block("b", yunits="%REFLECTANCE"),
            "some blocks are in 'REFLECTANCE' and some in '%REFLECTANCE'",
        ),
        (
            block("a").replace("##END=\n", "") + block("b"),
            "a block begins before the one above has its ##END=",
        ),
        (block().replace("##TITLE=red\n", "##TITLE=red\n##BROKEN\n"), "is damaged"),
        # Nothing to repeat, and nothing to differ from.
        (re.sub(r"(?m)^(400)[@A-I].*$", r"\1S5", block(form="DIFDUP")), "damaged"),
        (re.sub(r"(?m)^(400)[@A-I].*$", r"\1J5", block(form="DIFDUP")), "damaged"),
        # Decimal commas double the numbers of a line.
        (
            re.sub(
                r"(?m)^(\d\S*) (\S+)$",
                lambda row: f"{row[1]},0 {row[2]}".replace(".", ","),
                block(),
            ),
            "promises 31 points and holds 62; are its decimal points",
        ),
    ],
)
def test_errors_are_one_line(put, text, complaint):
    refused(put(text), complaint)
