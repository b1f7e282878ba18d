"""Tables of lamps, eyes and colour charts, and the CIE's formula for colour differences: NumPy,
read in milliseconds.

The tables are those of colour-science (BSD-3-Clause; `SOURCE.md` says which, `LICENSE` is its
licence), written by `python -m benchmarks.make.cie_tables`. They are here because `import colour`
takes longer than rendering a glaze: it brings matplotlib, pandas and much of SciPy.
"""

import csv
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..names import nearest_names

CIE_1931 = "CIE 1931 2 Degree Standard Observer"
OBSERVERS = (
    CIE_1931,
    "CIE 1964 10 Degree Standard Observer",
    "CIE 2015 2 Degree Standard Observer",
    "CIE 2015 10 Degree Standard Observer",
)
"""Full names of the standard observers."""
_SHORT_OBSERVERS = {
    "2": OBSERVERS[0],
    "1931": OBSERVERS[0],
    "cie_2_1931": OBSERVERS[0],
    "10": OBSERVERS[1],
    "1964": OBSERVERS[1],
    "cie_10_1964": OBSERVERS[1],
}
SHORT_CHARTS = {"babel_average": "BabelColor Average", "cc_ohta": "ColorChecker N Ohta"}
"""Short names of charts."""


class Curve(NamedTuple):
    """A tabulated spectrum.

    Attributes:
        wavelengths: (bands,), nm, even.
        values: (bands,), in the unit of its table.
    """

    wavelengths: Float[np.ndarray, "bands"]
    values: Float[np.ndarray, "bands"]


@cache
def illuminants() -> dict[str, Curve]:
    """Relative power of the CIE's and ISO's illuminants by full name, such as D65; linear between
    its bands.
    """
    return {name: curve for (name,), curve in _rows("illuminants.csv", 1).items()}


@cache
def observers() -> dict[str, tuple[Curve, Curve, Curve]]:
    """Colour matching functions x, y, z of the standard observers by full name, at every
    nanometre.
    """
    rows = _rows("observers.csv", 2)
    return {name: (rows[name, "x"], rows[name, "y"], rows[name, "z"]) for name in OBSERVERS}


@cache
def charts() -> dict[str, dict[str, Curve]]:
    """Measured reflectance of colour charts, as fractions: chart, then patch."""
    by_chart: dict[str, dict[str, Curve]] = {}
    for (chart, patch), curve in _rows("charts.csv", 2).items():
        by_chart.setdefault(chart, {})[patch] = curve
    return by_chart


def _rows(file: str, names: int) -> dict[tuple[str, ...], Curve]:
    """Curves of a table: so many names, the first wavelength, the step, and the values in a row
    each.
    """
    curves = {}
    for row in csv.reader(
        files("glazejax.cie").joinpath(file).read_text(encoding="utf-8").splitlines()
    ):
        numbers = np.array(row[names:], dtype=np.float64)
        start = numbers[0]
        step = numbers[1]
        values = numbers[2:]
        grid = start + step * np.arange(values.size)
        for array in (grid, values):
            array.setflags(write=False)
        curves[tuple(row[:names])] = Curve(grid, values)
    return curves


def find_illuminant(name: str) -> str:
    """Full name of a CIE illuminant; the case does not matter, and F2 is FL2.

    Raises:
        ValueError: there is no such illuminant; the message lists the nearest names.
    """
    full_names = {key.lower(): key for key in illuminants()}
    lamps = {
        key.replace("fl", "f", 1): full for key, full in full_names.items() if key.startswith("fl")
    }
    return _find("illuminant", name, full_names | lamps)


def find_observer(name: str | int) -> str:
    """Full name of a standard observer; 2, 10, 1931 and 1964 will do, as number or text.

    Raises:
        ValueError: no such observer; the message lists the nearest names.
    """
    return _find(
        "observer", str(name), {full.lower(): full for full in OBSERVERS} | _SHORT_OBSERVERS
    )


def _find(what: str, asked: str, full_names: dict[str, str]) -> str:
    """Entry of `full_names`, whose keys are lower case, for a name in any case."""
    key = " ".join(str(asked).split()).lower()
    if key in full_names:
        return full_names[key]
    near = [full_names[k] for k in nearest_names(key, full_names, cutoff=0.3, shortest=1)]
    choices = dict.fromkeys(near or list(full_names.values())[:8])
    raise ValueError(
        f"unknown {what} {asked!r}; {'the nearest' if near else 'some'} are {', '.join(choices)}"
    )
