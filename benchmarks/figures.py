"""Figures of the result files by name, as texts show them: the one place that says where each stands.

python -m benchmarks.figures      prints all of them

`docs` takes them from here when the site is built (the role `{result}`), so that a page cannot say another number than
the result that it links. A figure is the groups that a pattern finds in its file, and how they are written.
"""

import re
from collections.abc import Callable
from typing import NamedTuple

from .results import FOLDER


class Figure(NamedTuple):
    """Where a figure stands and how it is written.

    Attributes:
        file: the result file's name without its ending.
        pattern: a regular expression whose groups are the numbers, in the order in which they are found.
        write: from the numbers to the text.
    """

    file: str
    pattern: str
    write: Callable[..., str]

    def text(self) -> str:
        """The figure as text.

        Raises:
            ValueError: the result has nothing like the pattern.
        """
        found = [part for match in re.finditer(self.pattern, self.read()) for part in match.groups()]
        if not found:
            raise ValueError(f"benchmarks/results/{self.file}.txt has nothing like {self.pattern!r}")
        return self.write(*(float(part.replace(",", "")) for part in found))

    def read(self) -> str:
        """The result file's text."""
        return (FOLDER / f"{self.file}.txt").read_text(encoding="utf-8")


def _digits(digits: int) -> Callable[..., str]:
    return lambda value: f"{value:.{digits}f}"


FIGURES = {
    "cdisort_over_glazejax": Figure(
        "frontier", r"CDISORT without surface +at 1e-08 +([\d.]+)", lambda ratio: f"{1 / ratio:.0f}"
    ),
    "gradient_over_value": Figure("frontier", r"value and gradient / value +tol. 1e-06 +([\d.]+)", _digits(1)),
    "million_stacks": Figure("scaling", r"\n1000000 +(\d+)", lambda milliseconds: f"{milliseconds / 1e3:.1f} s"),
    "million_stacks_memory": Figure(
        "scaling", r"\n1000000 +\d+[\d.]* +(\d+)", lambda mebibytes: f"{mebibytes / 1024:.1f} GiB"
    ),
    "million_stacks_slopes": Figure(
        "scaling", r"\n1000000 +[\d.]+ +\d+ +([\d.]+)", lambda milliseconds: f"{milliseconds / 1e3:.1f} s"
    ),
    "power_of_layers": Figure("scaling", r"exponent from 2 to 40: glazejax ([\d.]+)", _digits(2)),
    "power_of_wavelengths": Figure("scaling", r"exponent from 251 to 4001: glazejax ([\d.]+)", _digits(2)),
    "power_of_stacks": Figure("scaling", r"exponent from 10000 to 1000000: glazejax ([\d.]+)", _digits(2)),
    "power_of_pixels": Figure("scaling", r"exponent from 65536 to 1048576: glazejax ([\d.]+)", _digits(2)),
    "render_cold": Figure("cold_start", r"\nrender +([\d.]+)", _digits(1)),
    "render_warm": Figure("cold_start", r"\nrender +[\d.]+ +([\d.]+)", _digits(1)),
    "identify_cold": Figure("cold_start", r"\nidentify +([\d.]+)", _digits(1)),
    "identify_warm": Figure("cold_start", r"\nidentify +[\d.]+ +([\d.]+)", _digits(1)),
    "microseconds_of_a_call": Figure("profile_solver", r"\n +41 +1e-03 +\d+ +(\d+) +\d+ +[\d.]+", _digits(0)),
    "pigments_first": Figure("truth", r"\nglazejax +\d+% +\d+/55 +(\d+)% +\d+/39", lambda share: f"{share:.0f} %"),
    "prediction_median": Figure("prediction", r"median, all +\S+ +(\S+)", _digits(1)),
    "chart_patches": Figure(
        "colourchecker_recipes",
        r"\n +3 +2 +([\d.]+) +[\d.]+ +(\d+) +[\d.]+",
        lambda median, below: f"{below:.0f} of 24 within ΔE00 1, {median:.2f} in the median",
    ),
}
"""Name -> figure."""


def main() -> None:
    for name, figure in FIGURES.items():
        print(f"{name:26} {figure.text():44} {figure.file}.txt")


if __name__ == "__main__":
    main()
