"""The tables of lamps, eyes and colour charts in `glazejax.cie`, from colour-science.

    python -m benchmarks.make.cie_tables [--out FOLDER]

A curve a row: its names, its first wavelength and its step in nm, and its values, digit by digit.
"""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import glazejax
from benchmarks.results import help_parser
from glazejax.cie import OBSERVERS, SHORT_CHARTS
from glazejax.colour import colour_science

FOLDER = Path(glazejax.__file__).parent / "cie"


def _numbers(wavelengths: Any, values: Any) -> list[str]:
    """First wavelength, step, values; refuses an uneven table."""
    grid = np.asarray(wavelengths, float)
    steps = np.diff(grid)
    if not np.allclose(steps, steps[0]):
        raise SystemExit(f"{grid} is not even")
    return [f"{grid[0]:g}", f"{steps[0]:g}", *(repr(float(value)) for value in values)]


def rows() -> dict[str, Iterator[list[str]]]:
    """Rows of each file."""
    science = colour_science()

    def lamps() -> Iterator[list[str]]:
        for name, curve in science.SDS_ILLUMINANTS.items():
            yield [str(name), *_numbers(curve.wavelengths, curve.values)]

    def eyes() -> Iterator[list[str]]:
        for name in OBSERVERS:
            curves = science.MSDS_CMFS[name]
            for letter, values in zip("xyz", curves.values.T, strict=True):
                yield [name, letter, *_numbers(curves.wavelengths, values)]

    def patches() -> Iterator[list[str]]:
        for chart, curves in science.SDS_COLOURCHECKERS.items():
            if chart in SHORT_CHARTS:
                continue
            for name, curve in curves.items():
                yield [str(chart), str(name), *_numbers(curve.wavelengths, curve.values)]

    return {"illuminants.csv": lamps(), "observers.csv": eyes(), "charts.csv": patches()}


def main() -> None:
    options = help_parser(__doc__, FOLDER).parse_args()
    for name, lines in rows().items():
        with (options.out / name).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(lines)
        print(f"written: {options.out / name}")


if __name__ == "__main__":
    main()
