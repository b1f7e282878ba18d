import os

import numpy as np
import pytest

from ..fresh import run_python
from .samples import ASD_GRID as GRID
from .samples import ASD_WHITE as WHITE
from .samples import asd_body as body
from .samples import asd_header as header
from .samples import refused, same, spectra

FILE = "ochre.asd"


@pytest.mark.parametrize("magic", [b"as2", b"as5", b"as8"])
def test_counts_over_white(read, magic):
    reflectance = spectra(1, GRID)
    table = read(header(magic=magic) + body(reflectance[0] * WHITE))
    same(table, GRID, reflectance, ["ochre"], atol=1e-12)
    assert table.format == "ASD binary"


def test_stored_reflectance_of_the_first_version(read):
    content = header(magic=b"ASD", comment=b"") + body(spectra(1, GRID)[0], None)
    same(read(content, "red.000"), GRID, spectra(1, GRID), ["red"])


def test_bands_where_white_is_dark_are_left_out(read):
    white = np.where(GRID > 2400, 0, WHITE)
    table = read(header() + body(spectra(1, GRID)[0] * WHITE, white))
    assert table.wavelengths[-1] == 2400
    assert "100 bands without data are left out" in table.notes


WHOLE = header() + body(WHITE / 2)
# Numbers of four bytes, of which the first is a NaN that NumPy warns of where it is cast.
SIGNALLING = bytearray(header() + np.full(GRID.size, 0x7F800001, "<u4").tobytes())
SIGNALLING[199] = 0


# A warning of NumPy would be a line more.
@pytest.mark.filterwarnings("error")
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
        (header() + body(WHITE, np.where(GRID == 400, np.inf, WHITE)), "white .* at 400 nm: inf"),
        (header() + body(WHITE, np.where(GRID == 400, np.nan, WHITE)), "white .* at 400 nm: nan"),
        (SIGNALLING, "spectrum is not finite at 350 nm: nan"),
        (header() + body(-WHITE), "negative"),
        (header() + body(50 * WHITE), "reaches 50 as a fraction"),
        (header(magic=b"as9") + body(WHITE), "not UTF-8 text|not a text file"),
    ],
)
def test_errors_are_one_line(put, content, complaint):
    refused(put(content), complaint)


def test_no_log_file_and_no_root_logger(put, tmp_path):
    # A process of its own, as other tests may have set up a log.
    path = put(WHOLE[:5000])
    code = (
        "import sys, logging; from glazejax.io import read_spectra\n"
        "try: read_spectra(sys.argv[1])\n"
        "except ValueError: pass\n"
        "assert not logging.getLogger().handlers"
    )
    done = run_python(code, path, cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("", "")
    assert os.listdir(tmp_path) == ["ochre.asd"]
