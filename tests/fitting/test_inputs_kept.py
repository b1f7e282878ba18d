"""No command writes a result over a file that it reads."""

import pytest

from ..commands import invoke


@pytest.mark.parametrize(
    "words",
    [
        "recipe --spectrum read.csv --csv read.csv",
        "recipe --lab 50,0,0 --ground read.csv:white --csv read.csv",
        "predict LeadWhite --reading read.csv --csv read.csv",
        "render --coats LeadWhite:1um --ground read.csv --csv read.csv",
        "map read.hdr --ground read.csv --out new.zarr --csv read.csv",
        "recover read.csv --out .",
        "posterior read.csv --sample a --paints LeadWhite --out .",
    ],
)
def test_a_file_that_is_read_is_no_result(words, here):
    for name in ("read.csv", "read.hdr"):
        (here / name).write_text("measured\n")
    result = invoke(*words.split(), "--overwrite")
    assert isinstance(result.exception, ValueError)
    assert "a file that is read" in str(result.exception)
    assert (here / "read.csv").read_text() == "measured\n"
