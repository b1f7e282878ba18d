import logging
import struct
import subprocess
import sys

import numpy as np
import pytest

from glazejax.io import read_spectra

from .samples import complains, same, spectra

GRID = np.arange(350.0, 2501.0)
WHITE = 20_000 * (1 + 0.5 * np.sin(GRID / 300))


def header(*, magic=b"as5", kind=1, channels=GRID.size, start=350.0, comment=b"ochre"):
    """First 484 bytes, as in ASD's document 600545 (file format version 8)."""
    layout = "<3s157s18sBBbblblffbbbbbH128s56sLhhHHffffhb4bHHHbLHHHHff27s5b"
    when = struct.pack("<9h", 0, 0, 12, 1, 0, 124, 1, 1, 0)
    fields = [magic, comment, when, 0, 0, 1, 1, 0, kind, 0, start, 1.0, 2, 1, 1, 1, 1, channels, b"", b"", 17, 0, 0, 0]
    fields += [1, 0.0, 1.0, 350.0, 2500.0, 16, 0, 0, 0, 0, 0, 1, 1, 1, 4, 0, 1, 1, 0, 0, 1000.0, 1800.0, b"", *[0] * 5]
    content = struct.pack(layout, *fields)
    assert len(content) == 484
    return content


def body(values, white: np.ndarray | None = WHITE):
    """Counts of the sample and, after the reference's own header, of the white."""
    content = np.asarray(values, "<f8").tobytes()
    if white is not None:
        content += b"\xff\xff" + struct.pack("<dd", 45000.0, 45000.0) + struct.pack("<h", 5) + b"white"
        content += np.asarray(white, "<f8").tobytes()
    return content


def put(tmp_path, content, name="ochre.asd"):
    path = tmp_path / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("magic", [b"as2", b"as5", b"as8"])
def test_counts_over_white(tmp_path, magic):
    reflectance = spectra(1, GRID)
    table = read_spectra(put(tmp_path, header(magic=magic) + body(reflectance[0] * WHITE)))
    same(table, GRID, reflectance, ["ochre"], atol=1e-12)
    assert table.format == "ASD binary"


def test_stored_reflectance_of_the_first_version(tmp_path):
    content = header(magic=b"ASD", comment=b"") + body(spectra(1, GRID)[0], None)
    same(read_spectra(put(tmp_path, content, "red.000")), GRID, spectra(1, GRID), ["red"])


def test_bands_where_white_is_dark_are_left_out(tmp_path):
    white = np.where(GRID > 2400, 0, WHITE)
    table = read_spectra(put(tmp_path, header() + body(spectra(1, GRID)[0] * WHITE, white)))
    assert table.wavelengths[-1] == 2400
    assert "100 bands without data are left out" in table.notes


WHOLE = header() + body(WHITE / 2)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (WHOLE[:300], "cut short or is damaged"),
        (WHOLE[:5000], "cut short or is damaged"),
        (WHOLE[:20000], "without its white reference, or cut short"),
        (header(kind=2) + body(WHITE), "of type 'rad'; only reflectance"),
        (header(kind=0) + body(WHITE, None), "without its white reference"),
        (header(kind=99) + body(WHITE), "cut short or is damaged"),
        (header() + body(np.where(GRID == 400, np.nan, WHITE)), "is not finite at 400 nm: nan"),
        (header() + body(-WHITE), "negative"),
        (header() + body(50 * WHITE), "reaches 50 as a fraction"),
        (header(magic=b"as9") + body(WHITE), "not UTF-8 text|not a text file"),
    ],
)
def test_errors_are_one_line(tmp_path, content, complaint):
    path = put(tmp_path, content)
    with pytest.raises(ValueError, match=complaint) as caught:
        read_spectra(path)
    assert complains(caught, path)


def test_no_log_file_and_no_root_logger(tmp_path):
    # The package opens a log where it is imported; a process of its own has not imported it yet.
    path = put(tmp_path, WHOLE[:5000])
    code = (
        "import sys, logging; from glazejax.io import read_spectra\n"
        "try: read_spectra(sys.argv[1])\n"
        "except ValueError: pass\n"
        "assert not logging.getLogger().handlers"
    )
    done = subprocess.run([sys.executable, "-c", code, path], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
    assert [file.name for file in tmp_path.iterdir()] == ["ochre.asd"]
    assert logging.getLogger("pyASDReader").level in (logging.NOTSET, logging.CRITICAL + 1)
