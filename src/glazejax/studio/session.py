"""What a page asks, and what it is answered: one `Session` a page, the same over a socket and in a
notebook.

A session keeps nothing that the page does not have: every question brings its stack, so that a page
that comes back after a lost connection has lost nothing. Answers are bytes as `messages.pack` makes
them. What is wrong with a question is one sentence, `{"type": "error", "about": ..., "words":
...}`.
"""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .. import colour
from ..cie import illuminants
from ..spectra import describe_grid
from ..stacks import Stack, all_paints, stack_from_dict, stack_to_dict
from . import canvas, python_lines, shelf, upload
from .engine import LADDER, SIZES, Engine, View
from .jobs import Jobs
from .messages import MOST_FILE, pack, unpack

Send = Callable[[bytes], None]
_MOST_LAMPS = 8


class Session:
    """Answers one page's messages.

    Args:
        engine: shared by all pages.
        jobs: searches that run beside, shared too.
        send: takes an answer; called from any thread.
    """

    def __init__(self, engine: Engine, jobs: Jobs, send: Send):
        self.engine: Engine = engine
        self.jobs: Jobs = jobs
        self._send = send
        self._easel = canvas.Easel(engine)
        # The page's own name, by which its searches find it again.
        self._page = str(id(self))
        self._lock = threading.Lock()

    def tell(self, header: Mapping[str, Any], arrays: Mapping[str, Any] | None = None) -> None:
        """Send an answer; one at a time."""
        with self._lock:
            self._send(pack(header, arrays))

    def handle(self, message: bytes | str) -> None:
        """Answer a message; what is wrong with it is told, never raised."""
        about = ""
        number = None
        try:
            header, arrays, rest = unpack(message)
            about = header["type"]
            number = header.get("number")
            answer = getattr(self, f"_on_{about}", None)
            if answer is None:
                raise ValueError(f"the studio does not know the message {about!r}; reload the page")
            answer(header, arrays, rest)
        except (ValueError, ModuleNotFoundError) as error:
            self.tell({"type": "error", "about": about, "number": number, "words": str(error)})
        except Exception as error:  # A page must hear of a fault, whatever it is.
            words = (
                f"the studio failed at this ({type(error).__name__}: {error}); what you made is "
                "kept"
            )
            self.tell({"type": "error", "about": about, "number": number, "words": words})

    def close(self) -> None:
        """The page is gone; it may come back."""
        self.jobs.leave(self._page)

    def _on_hello(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """What there is; the shelf's swatches follow when they are computed."""
        page = header.get("page")
        if isinstance(page, str) and 0 < len(page) <= 80 and " " not in page:
            self._page = page
        running, hand_over = self.jobs.come_back(self._page, self._teller)
        listed = [shelf.entry(name, paint) for name, paint in all_paints().items()]
        answer = {
            "type": "hello",
            "paints": listed,
            "lamps": list(illuminants()),
            "ladder": list(LADDER),
            "most": SIZES[-1],
            "most_file": MOST_FILE,
            "tasks": sorted(self.jobs.tasks),
            "running": [name.partition(" ")[2] for name in running],
        }
        self.tell(answer)
        hand_over()
        self._swatches(dict(all_paints()))

    def _swatches(self, paints: Mapping[str, Any]) -> None:
        """What paints look like, those of one grid after the other."""
        for group in shelf.by_grid(paints):
            try:
                found = shelf.swatches(self.engine, list(group.values()))
            except ValueError as error:  # Bands that give no colour.
                self.tell(
                    {"type": "error", "about": "shelf", "words": f"{', '.join(group)}: {error}"}
                )
                continue
            self.tell({"type": "shelf", "names": list(group)}, found)

    def _on_see(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """Spectra and colours of a stack."""
        began = time.perf_counter()
        stack = stack_from_dict(header.get("stack"))
        view = _view(header.get("view", {}))
        if words := self.engine.compiles(stack):
            self.tell({"type": "status", "words": words})
        seen = self.engine.see(stack, view)
        marks = shelf.doubts(stack)
        answer = {"type": "seen", "number": header.get("number"), "doubts": marks, **seen.words}
        self.tell(answer | {"ms": 1e3 * (time.perf_counter() - began)}, seen.arrays)

    def _on_check(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """A stack of a link or a file: as it is understood, or why not."""
        found = stack_to_dict(_stack(header))
        # Parts by weight stay as they were written: 5 to 1, not .8333 to .1667.
        for coat, given in zip(found["coats"], header["stack"]["coats"], strict=True):
            if len(coat["paint"]) == len(given["paint"]):
                coat["paint"] = dict(zip(coat["paint"], given["paint"].values(), strict=True))
        self.tell({"type": "checked", "number": header.get("number"), "stack": found})

    def _on_lamp(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """A lamp of one's own: whether it will do, for what the oils cover."""
        lamp = _lamp(header.get("lamp"))
        if isinstance(lamp, str):
            raise ValueError("the lamp is a name; one's own has wavelengths and power")
        colour.lamp_weights(next(iter(all_paints().values())).wavelengths, *lamp[1:])
        self.tell({"type": "lamp", "lamp": header["lamp"]})

    def _on_lines(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """The stack as Python."""
        self.tell({"type": "lines", "text": python_lines.of(_stack(header))})

    def _on_file(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """A dropped file: paints, films, or spectra."""
        name = str(header.get("name", "the file"))[:200]
        if len(rest) > MOST_FILE:
            raise ValueError(
                f"{name} has {len(rest) >> 20} MB; the studio takes files of {MOST_FILE >> 20} "
                "MB at most"
            )
        found = upload.read_upload(name, rest)
        answer: dict[str, Any] = {
            "type": "file",
            "name": name,
            "kind": found.kind,
            "notes": list(found.notes),
        }
        if found.kind == "paints":
            answer["pigments"] = found.content
            answer["entries"] = [shelf.entry(paint.name, paint) for paint in found.paints.values()]
            self.tell(answer)
            self._swatches(found.paints)
            return
        table = found.table
        assert table is not None
        grid = np.asarray(table.wavelengths, float)
        answer |= {
            "names": list(table.names),
            "words": describe_grid(grid),
            "films": found.kind == "films",
        }
        arrays = {"wavelengths": grid, "reflectance": np.asarray(table.reflectance, float)}
        try:
            weights = colour.colour_weights(grid)
            white = weights.sum(axis=0)
            xyz = arrays["reflectance"] @ weights
            arrays["rgb"] = np.round(255 * np.asarray(colour.xyz_to_srgb(xyz, white), float))
            arrays["lab"] = np.asarray(colour.xyz_to_lab(xyz, white), float)
        except ValueError as error:
            answer["notes"].append(str(error))
        self.tell(answer, arrays)

    def _on_canvas(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """Pixels of thickness maps."""
        began = time.perf_counter()
        stack = _stack(header)
        lamp = _view(header.get("view", {})).lamps[0]
        painted = self._easel.paint(
            stack,
            header.get("coats", []),
            arrays,
            lamp,
            lambda words: self.tell({"type": "status", "words": words}),
        )
        words = {
            "type": "painted",
            "number": header.get("number"),
            "box": header.get("box"),
            **painted.words,
        }
        self.tell(words | {"ms": 1e3 * (time.perf_counter() - began)}, {"rgba": painted.pixels})

    def _on_start(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """A search: recipes for a colour, what is in a film, paints from films."""
        if not isinstance(header.get("options", {}), dict):
            raise ValueError("the options of a search must be an object")
        task = str(header.get("task"))
        name = str(header.get("name"))[:80]
        stack = _stack(header)
        given = {"stack": stack_to_dict(stack), "options": header.get("options", {})}
        given |= {key: array.tolist() for key, array in arrays.items()}

        self.jobs.start(f"{self._page} {name}", task, given, self._teller(f"{self._page} {name}"))

    def _teller(self, name: str) -> Callable[[dict[str, Any]], None]:
        """Tells the page of its search."""
        return lambda message: self.tell({"type": "job", "name": name.partition(" ")[2], **message})

    def _on_stop(self, header: dict[str, Any], arrays: Any, rest: bytes) -> None:
        """End a search."""
        name = str(header.get("name"))[:80]
        self.jobs.stop(f"{self._page} {name}")
        self.tell({"type": "job", "name": name, "stopped": True})


def _stack(header: Mapping[str, Any]) -> Stack:
    return stack_from_dict(header.get("stack"))


def _view(given: Any) -> View:
    """How the page looks at its stack, checked.

    Raises:
        ValueError: a lamp or an angle that there is not.
    """
    if not isinstance(given, dict):
        raise ValueError("the view must be an object")
    lamps = given.get("lamps", ["D65"])
    if not isinstance(lamps, list) or not 1 <= len(lamps) <= _MOST_LAMPS:
        raise ValueError(f"the lamps must be a list of 1 to {_MOST_LAMPS}")
    angles = [given.get("light", 45.0), given.get("view", 60.0)]
    for angle in angles:
        if not isinstance(angle, int | float) or not 0 <= angle <= 85:
            raise ValueError(
                f"an angle is {angle!r}; light and view lie between 0 and 85 degrees from the "
                "normal"
            )
    pinned = given.get("pinned")
    if pinned is not None:
        match pinned:
            case [int() | float() as lightness, int() | float() as a, int() | float() as b]:
                pinned = float(lightness), float(a), float(b)
            case _:
                raise ValueError("the pinned colour must be three numbers, L*, a*, b*")
        if not all(abs(value) < 1000 for value in pinned):
            raise ValueError(f"the pinned colour is {pinned}, which no surface has")
    repeated = given.get("repeated", 0)
    repeated = repeated if isinstance(repeated, int) and repeated >= 0 else 0
    return View(
        lamps=tuple(map(_lamp, lamps)),
        light=float(angles[0]),
        view=float(angles[1]),
        repeated=repeated,
        pinned=pinned,
    )


def _lamp(given: Any) -> Any:
    if isinstance(given, str):
        return colour.find_illuminant(given)
    match given:
        case {"name": str(name), "wavelengths": [*grid], "power": [*power]} if len(
            grid
        ) <= 2000 and all(isinstance(value, int | float) for value in (*grid, *power)):
            return name, np.array(grid, float), np.array(power, float)
    raise ValueError("a lamp is a name such as D65, or has a name, wavelengths and power")
