"""Where a benchmark's output goes: lines to the screen and to NAME.txt, a picture to NAME.png, in one folder."""

import argparse
import datetime
import re
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = Path(__file__).parent / "results"


def add_option(parser: argparse.ArgumentParser) -> None:
    """`--out FOLDER`, by default the repository's benchmarks/results."""
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder for the results (default: %(default)s)")


BEFORE_STAMPS = "0.1.0"
"""Version that wrote the results without a last line that names one."""
_STAMP = re.compile(r"^written \d{4}-\d\d-\d\d by glazejax (\S+?)\.?$", re.MULTILINE)


def version_of(text: str) -> str:
    """Version of glazejax that wrote a result, by its last stamp."""
    return (_STAMP.findall(text) or [BEFORE_STAMPS])[-1]


class Results:
    """Prints what a benchmark says and keeps it; `save` writes it to the folder.

    results = Results("frontier", options.out)
    results("a line")
    results.save(figure)
    """

    def __init__(self, name: str, folder: Path = FOLDER):
        self._stem = Path(folder) / name
        self._lines: list[str] = []

    def __call__(self, line: str = "") -> None:
        """Print a line, at once, and keep it."""
        print(line, flush=True)
        self._lines.append(line.rstrip())

    def _stamp(self) -> list[str]:
        from .timing import environment

        told = any("; Python 3" in line for line in self._lines)
        written = f"written {datetime.date.today()} by glazejax {version('glazejax')}"
        return [written] if told else [environment(), written]

    def save(self, figure: "Figure | None" = None) -> None:
        """Write NAME.txt and, with a figure, NAME.png; the folder is made if it is not there.

        Date and version come last, and the machine before them if no line has told it.
        """
        self._stem.parent.mkdir(parents=True, exist_ok=True)
        text = self._stem.with_name(self._stem.name + ".txt")
        text.write_text("\n".join([*self._lines, "", *self._stamp()]) + "\n")
        written = [text.name]
        if figure is not None:
            picture = text.with_suffix(".png")
            figure.savefig(picture, dpi=160, bbox_inches="tight")
            written.append(picture.name)
        print(f"written to {self._stem.parent}: {', '.join(written)}")
