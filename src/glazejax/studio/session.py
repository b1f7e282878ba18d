"""Questions of a page, and answers to it: one `Session` a page, the same over a socket and in a
notebook.

The page sees by itself; it asks for what needs Python: searches, and files that people drop. A
session keeps nothing that the page does not have, so that a page that comes back after a lost
connection has lost nothing. Answers are bytes as `messages.pack` makes them. What is wrong with a
question is one sentence, `{"type": "error", "about": ..., "words": ...}`.
"""

import tempfile
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .. import colour
from ..io import SpectraTable, read_spectra
from ..io.source import shorten
from ..spectra import describe_grid
from ..stacks import stack_from_dict, stack_to_dict
from .jobs import Jobs
from .messages import MOST_FILE, JsonObject, pack, unpack
from .page_data import page_data

Send = Callable[[bytes], None]


class Session:
    """Answers one page's messages.

    Args:
        jobs: searches that run in parallel, shared by all pages.
        send: takes an answer; called from any thread.
        data: what the page knows, see `page_data`; the catalogues if left out.
    """

    def __init__(self, jobs: Jobs, send: Send, data: Mapping[str, Any] | None = None):
        self.jobs: Jobs = jobs
        self._data = page_data() if data is None else data
        self._send = send
        # The page's own name, by which its searches find it again.
        self._page = str(id(self))
        self._lock = threading.Lock()

    def tell(self, header: Mapping[str, Any], arrays: Mapping[str, Any] | None = None) -> None:
        """Send an answer; one at a time."""
        with self._lock:
            self._send(pack(header, arrays))

    def handle(self, message: bytes | str) -> None:
        """Answer a message; its errors are answered, never raised."""
        about = ""
        try:
            header, arrays, body = unpack(message)
            about = header["type"]
            answer = getattr(self, f"_on_{about}", None)
            if answer is None:
                raise ValueError(
                    f"the studio does not know the message {about!r:.60}; reload the page"
                )
            answer(header, arrays, body)
        except (ValueError, ModuleNotFoundError) as error:
            self.tell({"type": "error", "about": about, "words": shorten(str(error))})
        except Exception as error:  # A page must hear of a fault, whatever it is.
            fault = (
                f"the studio failed at this ({type(error).__name__}: {error}); what you made is "
                "kept"
            )
            self.tell({"type": "error", "about": about, "words": fault})

    def close(self) -> None:
        """The page is gone; it may come back."""
        self.jobs.leave(self._inform)

    def _on_hello(self, header: JsonObject, arrays: Any, body: bytes) -> None:
        """Answer with what there is."""
        page = header.get("page")
        # A blank separates the page's name from that of a search.
        if isinstance(page, str) and 0 < len(page) <= 80 and " " not in page:
            self._page = page
        answer = {
            "type": "hello",
            "data": self._data,
            "most_file": MOST_FILE,
            "tasks": sorted(self.jobs.tasks),
            "running": [name.partition(" ")[2] for name in self.jobs.names(self._page)],
        }
        self.tell(answer)
        self.jobs.come_back(self._page, self._inform)

    def _on_file(self, header: JsonObject, arrays: Any, body: bytes) -> None:
        """A dropped file: films, or spectra."""
        name = str(header.get("name", "the file"))[:200]
        table = _read_upload(name, body)
        grid = table.wavelengths
        answer: JsonObject = {
            "type": "file",
            "name": name,
            "notes": list(table.notes),
            "names": table.names,
            "words": describe_grid(grid),
            "films": _are_films(table.names),
        }
        arrays = {"wavelengths": grid, "reflectance": table.reflectance}
        # Spectra of which no colour can be made are shown without one.
        try:
            shades = np.asarray(colour.srgb(grid, arrays["reflectance"]), float)
            arrays["rgb"] = np.round(255 * shades)
            arrays["lab"] = np.asarray(colour.lab(grid, arrays["reflectance"]), float)
        except ValueError as error:
            answer["notes"].append(str(error))
        self.tell(answer, arrays)

    def _on_start(self, header: JsonObject, arrays: Any, body: bytes) -> None:
        """A search: recipes for a colour, what is in a film, paints from films."""
        choices = header.get("options", {})
        if not isinstance(choices, dict):
            raise ValueError("the options of a search must be an object")
        task = str(header.get("task"))
        name = str(header.get("name"))[:80]
        stack = stack_from_dict(header.get("stack"))
        request = {"stack": stack_to_dict(stack), "options": choices}
        request |= {key: array.tolist() for key, array in arrays.items()}

        self.jobs.start(f"{self._page} {name}", task, request, self._inform)

    def _inform(self, name: str, message: JsonObject) -> None:
        """Tell the page of its search."""
        self.tell({"type": "job", "name": name.partition(" ")[2], **message})

    def _on_stop(self, header: JsonObject, arrays: Any, body: bytes) -> None:
        """End a search."""
        name = str(header.get("name"))[:80]
        self.jobs.stop(f"{self._page} {name}")
        self.tell({"type": "job", "name": name, "stopped": True})


def _read_upload(name: str, content: bytes) -> SpectraTable:
    """Spectra of a dropped file, by its content.

    Raises:
        ValueError: it holds none, or too many; the message is one line.
    """
    if len(content) > MOST_FILE:
        raise ValueError(
            f"{name} has {len(content) >> 20} MB; the studio takes files of {MOST_FILE >> 20} "
            "MB at most"
        )
    if not content.strip():
        raise ValueError(f"{name} is empty")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dropped"
        path.write_bytes(content)
        try:
            table = read_spectra(path)
        except (ValueError, OSError) as error:
            raise ValueError(str(error).replace(str(path), name)) from None
    most = 200
    if len(table) > most:
        raise ValueError(f"{name} holds {len(table)} spectra; the studio takes {most} at once")
    return table


def _are_films(titles: Iterable[str]) -> bool:
    """Test whether spectra are films over a black and a white card, four rows each."""
    rows: dict[str, set[str]] = {}
    for title in titles:
        film, _, ending = title.rpartition("_")
        rows.setdefault(film, set()).add(ending)
    return all(film and ends == {"b", "w", "ob", "ow"} for film, ends in rows.items())
