"""Settings that the user of `glazejax recover` gives of the films, and where the results go."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from glazejax.commands import progress

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment
    from glazejax.io.quantity import Stated

    from .show.report import Table


class Destination(NamedTuple):
    """Destination of results: the folder, the films' thickness in m, whether pictures are drawn,
    and the screen.
    """

    out: Path | None
    thickness: float
    plots: bool
    overwrite: bool
    console: "Console"

    def write(
        self,
        pigments: "Iterable[Pigment]",
        tables: "Mapping[str, Table]",
        names: Sequence[str],
        draw: Callable[[int, Path], object],
    ) -> None:
        """Write paints, tables and pictures into the folder, which need not exist, and say so.

        Args:
            pigments: that go into `pigments.csv`.
            tables: by the names of their files.
            names: of what the pictures show; files differ also where the file system takes capitals
                for small letters.
            draw: draws one of them, by number, to a path.
        """
        from glazejax.io import write_table
        from glazejax.paint.pigment_table import write_pigments

        out = self.out
        assert out is not None
        out.mkdir(parents=True, exist_ok=True)
        write_pigments(out / "pigments.csv", pigments, digits=6, overwrite=self.overwrite)
        for file, table in tables.items():
            write_table(out / file, *table, overwrite=self.overwrite)
        written = ["pigments.csv", *tables]
        if self.plots:
            stems: set[str] = set()
            with progress.follow("drawing", len(names)) as note:
                for number, name in enumerate(names):
                    stem = slug(name)
                    while stem.lower() in stems:
                        stem += "_"
                    stems.add(stem.lower())
                    draw(number, out / f"{stem}.png")
                    note(number + 1, len(names), "drawing")
            written.append(f"{len(names)} pictures")
        self.console.print(f"Wrote {', '.join(written[:-1])} and {written[-1]} to {out}")


def slug(name: str) -> str:
    """A name that any file system takes."""
    return re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("_.") or "paint"


class PriorKnowledge(NamedTuple):
    """Knowledge that the user states in addition to the films: own paints, the white, thicknesses,
    readings without the specular part, the catalogue that the white is searched in, and what files
    hold.
    """

    into: Path | None
    white: str
    wet_film: str
    excluded: Path | None
    catalogue: str
    stated: "Stated"

    @property
    def any(self) -> bool:
        """True if the user states any."""
        return bool(self.into or self.white or self.wet_film or self.excluded)
