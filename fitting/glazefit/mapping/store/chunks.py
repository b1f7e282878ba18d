"""The chunks of a map's windows on disk: which windows are finished, and whether they are whole."""

from dataclasses import dataclass
from pathlib import Path

from .layout import BY_NAME, Variable
from .windows import Window

FIX = "; run the same `glazejax map` again, which maps the window once more"
"""End of an error of a damaged window."""


@dataclass(frozen=True)
class Chunks:
    """Chunks of a map, as zarr keeps them.

    Attributes:
        path: folder of the map.
        shape: rows and columns of the image.
        size: rows and columns of a window.
        complete: every window is finished, and one that lacks its status damaged.
    """

    path: Path
    shape: tuple[int, int]
    size: tuple[int, int]
    complete: bool

    def key(self, variable: Variable, window: Window) -> str:
        """Of a window's chunk of an array."""
        index = (window.y0 // self.size[0], window.x0 // self.size[1])
        return "/".join(map(str, (variable.name, "c", *index, *(0 for _ in variable.further))))

    def window(self, key: str) -> Window | None:
        """Whose chunk a key names; None if it is that of no chunk of an array."""
        name, _, index = key.partition("/c/")
        if not index or name not in BY_NAME:
            return None
        y, x = (int(at) * size for at, size in zip(index.split("/"), self.size, strict=False))
        return Window.at(y, x, self.shape, self.size)

    def is_done(self, window: Window) -> bool:
        """True for a finished window: it has its status, which is written last."""
        return (self.path / self.key(BY_NAME["status"], window)).exists()

    def check(self, window: Window, key: str, content: bytes | None) -> None:
        """See that a chunk of a finished window is as it was written.

        Args:
            window: whose chunk it is.
            key: of the chunk.
            content: as it is stored; None if it is not there.

        Raises:
            ValueError: it is missing, or does not meet its checksum.
        """
        from numcodecs.checksum32 import CRC32C

        if content is None:
            raise self.damage(window, f"{key} is missing")
        try:
            CRC32C(location="end").decode(content)
        except (ValueError, RuntimeError):
            raise self.damage(window, f"{key} is not as it was written") from None

    def damage(self, window: Window, reason: str) -> ValueError:
        """An error that names a window, what is damaged in it, and the remedy."""
        return ValueError(f"window {window} of {self.path} is damaged ({reason}){FIX}")
