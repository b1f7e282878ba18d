"""Tables on the screen."""

import io

import pytest
from rich.console import Console

from glazejax.report import leave_out, plain_table


@pytest.mark.parametrize(
    ("width", "missing"), [(60, []), (44, ["change"]), (36, ["change", "parts"])]
)
def test_a_table_leaves_out_what_may_be_missing_until_it_fits(width, missing):
    """No name and no figure is cut."""
    table = plain_table("paint", "um", "parts", "change", pad_edge=False)
    table.add_row("ChromeYellowPoppyseed", "48.0", "392 : 107 : 1", "1.84")
    page = io.StringIO()
    console = Console(width=width, file=page)
    fitted, gone = leave_out(table, console, ("change", "parts"))
    console.print(fitted)
    assert gone == missing
    _, row = page.getvalue().splitlines()
    cells = {"parts": "392 : 107 : 1", "change": "1.84"}
    shown = ["ChromeYellowPoppyseed", "48.0"]
    shown += [cell for title, cell in cells.items() if title not in missing]
    assert all(cell in row for cell in shown)
    assert not any(cells[title] in row for title in missing)
