"""Settings that the user of `glazejax recover` gives of the films, and where the results go."""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from glazejax.commands import options

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax.io.quantity import Stated


class Destination(NamedTuple):
    """Destination of results: the folder, the films' thickness in m, whether pictures are drawn,
    and the screen.
    """

    out: Path | None
    thickness: float
    plots: bool
    overwrite: bool
    console: "Console"

    def make_folder(self) -> Path:
        """The folder, which is there from now on."""
        assert self.out is not None
        self.out.mkdir(parents=True, exist_ok=True)
        return self.out


class PriorKnowledge(NamedTuple):
    """Knowledge that the user states in addition to the films: own paints, the white, thicknesses,
    readings without the specular part, the catalogue that the white is searched in, and what files
    hold.
    """

    into: Path | None
    white: str
    wet_film: str
    excluded: Path | None = None
    catalogue: str = options.OILS
    stated: "Stated | None" = None

    @property
    def any(self) -> bool:
        """True if the user states any."""
        return (
            self.into is not None or self.excluded is not None or bool(self.white or self.wet_film)
        )
