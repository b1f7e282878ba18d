"""Results as tables of pandas and data sets of xarray."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from glazejax.extras import require

WAVELENGTH = "wavelength"
_UNITS = {WAVELENGTH: "nm"}


class Grid(NamedTuple):
    """Arrays on axes that all of them share or leave out."""

    axes: Mapping[str, Any]
    """Coordinates by name, in the order of the arrays' dimensions; wavelengths in nm."""
    arrays: Mapping[str, tuple[tuple[str, ...], Any]]
    """By name: axes, and values without a unit."""

    def columns(self) -> Iterator[tuple[str, np.ndarray]]:
        """Titles and columns of a long table: a row for each place of the grid."""
        shape = tuple(map(len, self.axes.values()))
        each = {name: ((name,), values) for name, values in self.axes.items()}
        for name, (axes, values) in {**each, **self.arrays}.items():
            sizes = [n if axis in axes else 1 for axis, n in zip(self.axes, shape, strict=True)]
            title = f"{name}_{_UNITS[name]}" if name in _UNITS else name
            yield title, np.broadcast_to(np.reshape(values, sizes), shape).ravel()


def as_frame(titles: Iterable[str], rows: Iterable[Sequence[object]]) -> Any:
    """A pandas.DataFrame of rows."""
    require("pandas")
    import pandas

    return pandas.DataFrame(list(rows), columns=list(titles))


class Tabulated:
    """A result that pandas and xarray take."""

    def grid(self) -> Grid:
        """Its arrays by axes."""
        raise NotImplementedError

    def to_dataframe(self) -> Any:
        """A pandas.DataFrame with a row for each place of the grid; a title ends in its unit where
        there is one: ``wavelength_nm``.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        titles, columns = zip(*self.grid().columns(), strict=True)
        return as_frame(titles, zip(*columns, strict=True))

    def to_xarray(self) -> Any:
        """An xarray.Dataset; the attribute ``units`` of each variable says its unit, 1 for none.

        Raises:
            ModuleNotFoundError: xarray is not installed.
        """
        require("xarray")
        import xarray

        data = xarray.Dataset(*reversed(self.grid()))
        for name, values in data.variables.items():
            values.attrs["units"] = _UNITS.get(str(name), "1")
        return data
