"""Common parts of reports on the screen: tables without lines, and patches of a colour."""

from collections.abc import Collection, Iterable
from copy import copy
from typing import Any

from rich.console import Console
from rich.measure import Measurement
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


def leave_out(table: Table, console: Console, spare: Iterable[str]) -> tuple[Table, list[str]]:
    """A table that fits the screen, as far as columns that may be missing allow.

    Args:
        table: with all of its rows.
        console: to print to.
        spare: titles of columns that may be missing, the least important first.

    Returns:
        The table with what fits, and the titles of what was left out.
    """
    # As wide as it would like to be.
    unlimited = console.options.update(max_width=10_000)
    gone: list[str] = []
    for title in spare:
        if Measurement.get(console, unlimited, table).maximum <= console.width:
            break
        table = copy(table)
        # A column holds its cells.
        table.columns = [column for column in table.columns if column.header != title]
        gone.append(title)
    return table, gone


def swatch(shade: str) -> Text:
    """A patch of a colour, #rrggbb, for terminals that show colours."""
    return Text(" " * 4, style=f"on {shade}")
