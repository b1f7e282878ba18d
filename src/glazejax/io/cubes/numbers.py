"""Lists of numbers that a user gives: as a sequence, a text file or a .npy file."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from ..quantity import nanometres
from ..source import explain_errors, naming, open_source, refusal
from ..words import read_number


def read_numbers(given: tuple[float, ...] | Path, unit: str = "") -> Float[np.ndarray, "stored"]:
    """Wavelengths in nm, in their own order.

    Args:
        given: numbers, or a file of them.
        unit: what they are in, if that is said.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not numbers, none, or not wavelengths.
    """
    if isinstance(given, Path):
        values = column(given)
        name = given
    else:
        values = np.asarray(given, np.float64)
        name = Path("wavelengths")
    wrong = np.flatnonzero(~np.isfinite(values))
    if not values.size or wrong.size:
        which = (
            f"number {int(wrong[0]) + 1} is {values[wrong[0]]:g}"
            if wrong.size
            else "there are none"
        )
        raise refusal(name, f"wavelengths must be finite numbers: {which}")
    with naming(name):
        return nanometres(values, unit)[0]


def column(path: Path) -> Float[np.ndarray, "rows"]:
    """Numbers of a .npy file of one axis, or of a text file: separated by blanks, commas or lines;
    # begins a comment.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not numbers.
    """
    if path.suffix.lower() == ".npy":
        with explain_errors(path):
            try:
                values = np.load(path, allow_pickle=False)
            except ValueError as error:
                raise refusal(path, f"not a whole .npy file: {error}") from None
        if values.dtype.kind not in "fiu" or values.size != max(values.shape, default=0):
            raise refusal(
                path,
                f"an array of shape {values.shape} and type {values.dtype}, not a row of numbers",
            )
        return values.astype(np.float64).ravel()
    with open_source(path) as source:
        text = source.text()
    words = [
        word
        for line in text.splitlines()
        for word in line.partition("#")[0].replace(",", " ").split()
    ]
    try:
        return np.array([read_number(word) for word in words], np.float64)
    except ValueError as error:
        raise refusal(path, f"not a list of numbers: {error}") from None
