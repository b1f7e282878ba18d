"""Lists of numbers that a user gives: as a sequence, a text file or a .npy file."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..quantity import nanometres
from ..source import explain_errors, naming, open_source, refusal
from ..spectra_table import Stored
from ..words import read_number


def read_numbers(given: Sequence[float] | np.ndarray | str | Path, unit: str) -> Stored:
    """Wavelengths in nm, in their own order.

    Args:
        given: numbers, or a file of them.
        unit: what they are in; empty if that is not said.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not numbers, none, or not wavelengths.
    """
    listed = not isinstance(given, str | Path)
    name = Path("wavelengths") if listed else Path(given)
    values = np.ravel(np.asarray(given, float)) if listed else column(name)
    said = "wavelengths must be finite numbers: "
    if not values.size:
        raise refusal(name, f"{said}there are none")
    for i in np.flatnonzero(~np.isfinite(values))[:1]:
        raise refusal(name, f"{said}number {i + 1} is {values[i]:g}")
    with naming(name):
        return nanometres(values, unit)[0]


def load_npy(path: Path) -> np.ndarray:
    """Array of a .npy file, mapped into memory.

    Raises:
        ValueError: it is none, or was cut short.
    """
    with explain_errors(path):
        try:
            return np.load(path, mmap_mode="r", allow_pickle=False)
        except ValueError as error:
            raise refusal(path, f"not a whole .npy file: {error}") from None


def column(path: Path) -> Stored:
    """Numbers of a .npy file of one axis, or of a text file: separated by blanks, commas or lines;
    # begins a comment.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not numbers.
    """
    if path.suffix.lower() == ".npy":
        values = load_npy(path)
        if values.dtype.kind not in "fiu" or values.size != max(values.shape, default=0):
            raise refusal(
                path,
                f"an array of shape {values.shape} and type {values.dtype}, not a row of numbers",
            )
        return values.astype(float).ravel()
    with open_source(path) as source:
        text = source.text()
    words = re.sub(r"#[^\r\n]*|,", " ", text).split()
    try:
        return np.array([read_number(word) for word in words], float)
    except ValueError as error:
        raise refusal(path, f"not a list of numbers: {error}") from None
