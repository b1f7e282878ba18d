"""Results as data sets of xarray and tables of pandas."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeAlias

from glazejax.extras import require

WAVELENGTH = "wavelength"
Variables: TypeAlias = tuple[Mapping[str, tuple[tuple[str, ...], Any]], Mapping[str, Any]]
"""Arrays by name: names of axes, and values without a unit; then the coordinates of axes by name,
wavelengths in nm.
"""


def as_frame(titles: Any, rows: Iterable[Sequence[object]]) -> Any:
    """A pandas.DataFrame of rows."""
    require("pandas")
    import pandas

    return pandas.DataFrame(list(rows), columns=titles)


class Tabulated:
    """A result that xarray and pandas take."""

    def arrays_and_axes(self) -> Variables:
        """Its arrays and their axes."""
        raise NotImplementedError

    def to_xarray(self) -> Any:
        """An xarray.Dataset; the attribute ``units`` of each variable says its unit, 1 for none.

        Raises:
            ModuleNotFoundError: xarray is not installed.
        """
        require("xarray")
        import xarray

        data = xarray.Dataset(*self.arrays_and_axes())
        for name, values in data.variables.items():
            values.attrs["units"] = "nm" if name == WAVELENGTH else "1"
        return data

    def to_dataframe(self) -> Any:
        """A pandas.DataFrame with a row for each place of `to_xarray`'s axes, wavelengths in the
        column ``wavelength_nm``; all else has no unit.

        Raises:
            ModuleNotFoundError: xarray, which brings pandas, is not installed.
        """
        frame = self.to_xarray().to_dataframe().reset_index()
        return frame.rename(columns={WAVELENGTH: "wavelength_nm"})
