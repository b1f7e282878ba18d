"""What reports on the screen share: tables without lines, and patches of a colour."""

from collections.abc import Collection
from typing import Any

from rich.table import Table
from rich.text import Text


def plain_table(
    *columns: str, title: str | None = None, words: Collection[int] = (0,), **style: Any
) -> Table:
    """Table without lines.

    Args:
        columns: their titles; figures stand to the right and are never broken.
        title: of the table.
        words: numbers of the columns that hold words: they stand to the left, and long ones go on
            in the next line.
        style: further arguments of `rich.table.Table`.
    """
    table = Table(title=title, title_justify="left", box=None, **style)
    for number, name in enumerate(columns):
        if number in words:
            table.add_column(name, overflow="fold")
        else:
            table.add_column(name, justify="right", no_wrap=True)
    return table


def swatch(shade: str, width: int = 2) -> Text:
    """A patch of a colour, #rrggbb, for terminals that show colours."""
    return Text(" " * width, style=f"on {shade}")
