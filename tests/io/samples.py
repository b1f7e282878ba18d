"""Spectra that tests write and read, files of every format, and strategies that make them."""

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.testing import assert_allclose

from glazejax.io import SpectraTable, read_spectra

from ..refusals import refusal

GRID = np.arange(400.0, 701.0, 10.0)


def spectra(rows=3, grid=GRID):
    """Smooth, different, legal fractions."""
    centres = np.linspace(420, 680, rows)[:, None]
    return 0.05 + 0.8 / (1 + np.exp((centres - grid) / 15))


TABLE = SpectraTable(GRID, ("a", "b", "c"), spectra())


def same(table, grid, values, names, atol=0.0):
    """Assert that a table holds this."""
    assert table.names == tuple(names)
    assert_allclose(table.wavelengths, grid, rtol=0, atol=1e-9)
    assert_allclose(table.reflectance, values, rtol=0, atol=atol)


def refused(path, complaint, read=read_spectra, error: type[Exception] = ValueError, **how):
    """Assert that a reader refuses a file in one line that names it."""
    with refusal(complaint, error) as caught:
        read(path, **how)
    message = str(caught.value)
    assert Path(path).stem in message
    return message


# Letters of all kinds, but no blanks at the ends or in a row and no control characters: those are
# changed on purpose.
NAMES = st.text(
    st.characters(
        exclude_categories=("Cs", "Cc", "Cn", "Zs", "Zl", "Zp"), exclude_characters="\ufeff"
    ),
    min_size=1,
)


@st.composite
def tables(draw, wavelengths=None, names=NAMES):
    """Tables of a few spectra with any legal fractions."""
    labels = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    if wavelengths is None:
        grid = draw(st.lists(st.floats(200, 3000), min_size=1, max_size=9, unique=True).map(sorted))
    else:
        grid = draw(wavelengths)
    values = draw(arrays.arrays(float, (len(labels), len(grid)), elements=st.floats(0, 3)))
    return SpectraTable(np.array(grid, float), tuple(labels), values)


CGATS = """CGATS.17
ORIGINATOR	"a house"
# a comment
NUMBER_OF_FIELDS	6
BEGIN_DATA_FORMAT
SAMPLE_ID	SAMPLE_NAME	LAB_L	SPECTRAL_NM400	SPECTRAL_NM410	SPECTRAL_NM420
END_DATA_FORMAT
NUMBER_OF_SETS	2
BEGIN_DATA
1	"red, light"	50.5	0.10	0.20	0.30
2	blue	20.1	0.40	0.50	0.60
END_DATA
"""

CXF = """<?xml version="1.0" encoding="UTF-8"?>
<cc:CxF xmlns:cc="http://colorexchangeformat.com/CxF3-core">
<cc:Resources><cc:ObjectCollection>
<cc:Object ObjectType="Target" Name="red" Id="1"><cc:CreationDate>2007-06-14T00:00:00-08:00</cc:CreationDate>
<cc:ColorValues>
<cc:ColorCIELab ColorSpecification="M0"><cc:L>17</cc:L><cc:A>1</cc:A><cc:B>0</cc:B></cc:ColorCIELab>
<cc:ReflectanceSpectrum StartWL="380" ColorSpecification="M0">0.1 0.2 0.3</cc:ReflectanceSpectrum>
</cc:ColorValues></cc:Object>
<cc:Object ObjectType="Target" Name="red" Id="2"><cc:CreationDate>2007-06-14T00:00:00-08:00</cc:CreationDate>
<cc:ColorValues>
<cc:ReflectanceSpectrum ColorSpecification="M0">0.4 0.5 0.6</cc:ReflectanceSpectrum>
</cc:ColorValues></cc:Object>
</cc:ObjectCollection>
<cc:ColorSpecificationCollection><cc:ColorSpecification Id="M0"><cc:MeasurementSpec>
<cc:MeasurementType>Spectrum_Reflectance</cc:MeasurementType>
<cc:GeometryChoice><cc:SphereGeometry>Specular_Included</cc:SphereGeometry></cc:GeometryChoice>
<cc:WavelengthRange StartWL="380" Increment="10"/>
</cc:MeasurementSpec></cc:ColorSpecification></cc:ColorSpecificationCollection>
</cc:Resources></cc:CxF>
"""


def lines(rows, by=","):
    """Rows of cells as a file has them."""
    return "".join(by.join(map(str, row)) + "\n" for row in rows)


def rows(*columns, by=",", grid: Any = GRID):
    """Rows of a table whose first column is the wavelength."""
    return lines(zip(grid, *columns, strict=True), by)


def comma_rows(*columns):
    """The same between tabs, with decimal commas."""
    return rows(*columns, by="\t").replace(".", ",")


def old_workbook(sheets):
    """Content of an .xls file of rows by sheet."""
    import xlwt

    book = xlwt.Workbook()
    for name, rows in sheets.items():
        sheet = book.add_sheet(name)
        for y, row in enumerate(rows):
            for x, cell in enumerate(row):
                sheet.write(y, x, cell if isinstance(cell, str) else float(cell))
    file = io.BytesIO()
    book.save(file)
    return file.getvalue()


def envi_list(values):
    """A list as a header of ENVI has it."""
    return "{" + ", ".join(map(str, values)) + "}"


def envi_header(fields):
    """Header of ENVI, without the fields that are None."""
    return "ENVI\n" + lines((item for item in fields.items() if item[1] is not None), " = ")


ENVI = {
    "samples": 31,
    "lines": 3,
    "bands": 1,
    "file type": "ENVI Spectral Library",
    "data type": 4,
    "interleave": "bsq",
    "byte order": 0,
    "wavelength": envi_list(f"{w:g}" for w in GRID),
    "wavelength units": "nm",
    "spectra names": "{red, green, blue}",
}


def jcamp_block(
    name="red",
    values=None,
    *,
    grid=GRID,
    xunits="NANOMETERS",
    yunits="REFLECTANCE",
    form="XYPOINTS",
):
    """One block of text: pairs, or rows of three values with a factor."""
    values = spectra(1, grid)[0] if values is None else values
    head = (
        f"##TITLE={name}\n##JCAMP-DX=4.24\n##DATA TYPE=UV/VIS "
        f"SPECTRUM\n##XUNITS={xunits}\n##YUNITS={yunits}\n"
    )
    head += f"##FIRSTX={grid[0]}\n##LASTX={grid[-1]}\n##NPOINTS={len(grid)}\n"
    if form == "XYPOINTS":
        rows = "".join(f"{x:.9g} {y:.9g}\n" for x, y in zip(grid, values, strict=True))
        return f"{head}##XYPOINTS=(XY..XY)\n{rows}##END=\n"
    factor = 1e-6
    numbers = [round(y / factor) for y in values]
    rows = ""
    if form == "DIFDUP":
        for i in range(0, len(numbers) - 1, 10):
            # A line of differences repeats the last ordinate of the line above.
            rows += f"{grid[i]:g}{_packed(numbers[i], '@ABCDEFGHI', 'abcdefghi')}"
            rows += _differences(np.diff(numbers[i : i + 11]).tolist()) + "\n"
    else:
        for i in range(0, len(grid), 3):
            rows += lines([[f"{grid[i]:g}", *numbers[i : i + 3]]], " ")
    return f"{head}##XFACTOR=1\n##YFACTOR={factor}\n##XYDATA=(X++(Y..Y))\n{rows}##END=\n"


def _packed(number: int, plus: str, minus: str) -> str:
    """Number of which the first digit is a letter that tells its sign."""
    first, rest = int(str(abs(number))[0]), str(abs(number))[1:]
    return (plus[first] if number >= 0 else minus[first - 1]) + rest


def _differences(numbers: list[int]) -> str:
    """Differences, with repetitions counted."""
    text, repeated = "", 1
    for i, number in enumerate(numbers):
        if i + 1 < len(numbers) and numbers[i + 1] == number:
            repeated += 1
            continue
        text += _packed(number, "%JKLMNOPQR", "jklmnopqr")
        text += _packed(repeated, " STUVWXYZs", "") if repeated > 1 else ""
        repeated = 1
    return text


ASD_GRID = np.arange(350.0, 2501.0)
ASD_WHITE = 20_000 * (1 + 0.5 * np.sin(ASD_GRID / 300))


def asd_header(*, magic=b"as5", kind=1, comment=b"ochre"):
    """First 484 bytes, as far as they are used, as in ASD's document 600545 (version 8)."""
    content = bytearray(484)
    struct.pack_into("<3s157s9h", content, 0, magic, comment, 0, 0, 12, 1, 0, 124, 1, 1, 0)
    content[186] = kind
    # Doubles, as 2 states.
    struct.pack_into("<ffb4xH", content, 191, 350.0, 1.0, 2, ASD_GRID.size)
    return bytes(content)


def asd_body(values, white: np.ndarray | None = ASD_WHITE):
    """Counts of the sample and, after the reference's own header, of the white."""
    content = np.asarray(values, "<f8").tobytes()
    if white is not None:
        content += (
            b"\xff\xff" + struct.pack("<dd", 45000.0, 45000.0) + struct.pack("<h", 5) + b"white"
        )
        content += np.asarray(white, "<f8").tobytes()
    return content
