"""Counts of answers that came true on paint by others, by the probability that they stated: counts
of `python -m benchmarks.paintbench --stated`, pure paints of known families, each source unknown to
the search.
"""

import functools
from pathlib import Path

import numpy as np
from jaxtyping import Float

from glazejax.spectra import Bands

FILE = Path(__file__).with_name("in_tests.csv")
"""The counts."""
# Bands from here on count as near infrared, nm.
_INFRARED = 900.0
# The tests read a band each 10 nm. With eight over the visible as many answers came true, with five
# fewer of those that were the surest.
_FEWEST = 8


def were_tested(wavelengths: Bands) -> bool:
    """True if a reading has so many bands that it is like those of the tests."""
    return len(wavelengths) >= _FEWEST


def has_infrared(wavelengths: Bands) -> bool:
    """True if a reading holds enough of the near infrared to be counted with it."""
    return float(wavelengths[-1]) >= _INFRARED


def came_true(probability: float, infrared: bool) -> tuple[int, int]:
    """Right answers among those that stated about as much, and how many these are.

    Args:
        probability: that was stated.
        infrared: whether the near infrared was read (`has_infrared`).
    """
    counts = _counts()
    matching = (counts[:, 0] == infrared) & (counts[:, 1] <= probability)
    answers, correct = counts[matching][-1, 3:]
    return int(correct), int(answers)


@functools.cache
def _counts() -> Float[np.ndarray, "rows 5"]:
    return np.loadtxt(FILE, delimiter=",", skiprows=1, ndmin=2)
