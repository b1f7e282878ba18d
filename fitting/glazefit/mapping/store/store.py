"""The store of a map: a zarr 3 folder that fills window by window, and goes on after a kill where
it stopped.

The array ``status`` is written last of a window: where it says that pixels are not done, they are
not, whatever a killed run left in other arrays. `open_map` shows fill values in their place, and a
run that goes on does the window again. Sums over a window's sets lie in the folder ``.glazejax``.
"""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax.extras import require

from .atomic_files import KeyedResults, explain_full_disk, sync
from .chunk import ChunkMaps, Members, SetSum, add_sets, add_tallies, pack, unpack
from .create import FORMAT, KIND, WORK, lay_out, plain
from .layout import BY_NAME, VARIABLES, Status, Variable
from .windows import Window, windows

if TYPE_CHECKING:
    import xarray
    import zarr


class MapStore:
    """A map on disk; make or open it with `create` or `open`.

    Attributes:
        path: its folder.
        shape: rows and columns of the image.
        chunk: rows and columns of a window.
        paints: names of the paints, in the order of their numbers.
        options: what the map depends on, as plain JSON.
        work: where a run keeps what it found before the windows.
    """

    def __init__(self, path: str | Path):
        require("zarr")
        self.path = Path(path)
        attrs = _attributes(self.path)
        if attrs is None:
            raise ValueError(
                f"{self.path} is no map of glazejax; name the folder that `glazejax map` wrote "
                "with --out"
            )
        identity = attrs["glazejax"]
        if identity["format"] != FORMAT:
            raise ValueError(
                f"{self.path} is a map of format {identity['format']}, written by another "
                f"glazejax; this one reads format {FORMAT}: make the map again (--overwrite)"
            )
        self.shape: tuple[int, int] = (identity["shape"][0], identity["shape"][1])
        self.chunk: tuple[int, int] = (identity["chunk"][0], identity["chunk"][1])
        self.paints: tuple[str, ...] = tuple(attrs["paints"])
        self.options: dict[str, Any] = attrs["options"]
        self._group: zarr.Group | None = None
        self._held = False

    @classmethod
    def create(
        cls,
        path: str | Path,
        shape: Sequence[int],
        chunk: Sequence[int],
        paints: Sequence[str],
        *,
        options: Mapping[str, Any],
        attrs: Mapping[str, Any] | None = None,
        coords: Mapping[str, tuple[np.ndarray, Mapping[str, Any]]] | None = None,
        overwrite: bool = False,
    ) -> "MapStore":
        """A new map, or the one that is there if it was begun with the same options.

        Args:
            path: folder; its parent must exist.
            shape: rows and columns of the image.
            chunk: rows and columns of a window.
            paints: names of the paints, different ones.
            options: all that the map depends on; a map that is there goes on if its own are the
                same.
            attrs: what else is to be known of the map.
            coords: numbers along ``y`` and ``x`` and their attributes; pixel centres if left out.
            overwrite: replace a map that is there.

        Raises:
            ValueError: the map that is there was begun with other options.
            FileExistsError: what is there is no map of glazejax.
            FileNotFoundError: the parent folder does not exist.
            OSError: the disk is full.
        """
        require("zarr")
        path = Path(path)
        whole = {**options, "shape": list(shape), "paints": list(paints)}
        wanted = plain(whole)
        check_map(path, overwrite=overwrite)
        if path.exists() and any(path.iterdir()) and not overwrite:
            existing = cls(path)
            if differences := _differences(existing.options, wanted):
                raise ValueError(
                    f"{path} was begun with other options ({differences}); name another map, or "
                    "replace it with overwrite=True (--overwrite)"
                )
            return existing
        new = path.with_name(f".{path.name}.new")
        old = path.with_name(f".{path.name}.old")
        for left in (new, old):
            shutil.rmtree(left, ignore_errors=True)
        with explain_full_disk(path, lambda: "nothing of the map was begun"):
            try:
                lay_out(
                    new,
                    shape=shape,
                    chunk=chunk,
                    paints=paints,
                    options=wanted,
                    attrs=attrs or {},
                    coords=coords or {},
                )
                if path.exists():
                    path.replace(old)
                new.replace(path)
            except BaseException:
                shutil.rmtree(new, ignore_errors=True)
                raise
        shutil.rmtree(old, ignore_errors=True)
        return cls(path)

    @classmethod
    def open(cls, path: str | Path) -> "MapStore":
        """The map in a folder.

        Raises:
            ValueError: there is none.
        """
        return cls(path)

    @property
    def work(self) -> KeyedResults:
        """Results that a run keeps before and between windows."""
        return KeyedResults(self.path / WORK / "work")

    def windows(self) -> list[Window]:
        """All windows, row by row."""
        return windows(self.shape, self.chunk)

    def done(self) -> set[Window]:
        """The windows that are finished."""
        # zarr writes no chunk that is all fill, and that of `status` is `UNDONE`.
        status = BY_NAME["status"]
        return {window for window in self.windows() if self._file(status, window).exists()}

    def put(self, window: Window, maps: ChunkMaps) -> None:
        """Write a window, the status of its pixels last.

        Raises:
            ValueError: no window of this map, arrays that do not fit it, or pixels without a
                status.
            OSError: the disk is full; other windows are kept.
        """
        if window != Window.at(window.y0, window.x0, self.shape, self.chunk):
            raise ValueError(
                f"{window!r} is no window of {self.path}, whose windows are {self.chunk[0]} x "
                f"{self.chunk[1]}"
            )
        for name, array in maps.arrays.items():
            variable = BY_NAME.get(name)
            if variable is None:
                raise ValueError(f"a map has no array {name!r}; it has {', '.join(BY_NAME)}")
            expected = (*window.shape, *variable.further_sizes(len(self.paints)))
            if array.shape != expected:
                raise ValueError(
                    f"{name} of window {window} has shape {array.shape}; it must be {expected}"
                )
        if (maps.arrays.get("status", np.uint8(Status.UNDONE)) == Status.UNDONE).any():
            raise ValueError(f"some pixels of window {window} have no status")
        with explain_full_disk(
            self.path,
            lambda: (
                f"{len(self.done())} of {len(self.windows())} windows are finished and kept: "
                "make room, then run the same again and it goes on"
            ),
        ):
            *others, status = sorted(VARIABLES, key=lambda variable: variable.name == "status")
            for variable in others:
                self._write(variable, window, maps)
            for variable in others:
                sync(self._file(variable, window))
            self._sums.put(str(window), pack(maps.tallies, maps.sets))
            self._write(status, window, maps)
            sync(self._file(status, window))
            sync(self._file(status, window).parent)

    def sums(self) -> tuple[dict[str, float], dict[Members, SetSum]]:
        """Counts and sums of sets over all finished windows, in the order of the windows whatever
        their order of work.

        Raises:
            ValueError: those of a window cannot be read.
        """
        tallies: dict[str, float] = {}
        sets: dict[Members, SetSum] = {}
        for window in sorted(self.done()):
            more, further = unpack(self._sums.get(str(window)))
            add_tallies(tallies, more)
            add_sets(sets, further)
        return tallies, sets

    def note(self, **attrs: Any) -> None:
        """Add attributes to the map, such as what a check of it found."""
        with explain_full_disk(self.path, lambda: "all finished windows are kept"):
            self._writable().update_attributes(plain(attrs))

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Hold the map, so that no second run writes it; take away what a killed run left
        half-written.

        Raises:
            ValueError: another run holds it.
        """
        if self._held:
            yield
            return
        work = self.path / WORK
        work.mkdir(exist_ok=True)
        with (work / "lock").open("w") as file:
            if not _lock(file.fileno()):
                raise ValueError(
                    f"another run is writing {self.path}; wait for it, or name another map"
                )
            for left in (*self.path.rglob("*.partial"), *work.rglob("*.part")):
                left.unlink(missing_ok=True)
            self._held = True
            try:
                yield
            finally:
                self._held = False

    @property
    def _sums(self) -> KeyedResults:
        return KeyedResults(self.path / WORK / "sums")

    def _writable(self) -> "zarr.Group":
        import zarr

        if self._group is None:
            self._group = zarr.open_group(self.path, mode="r+")
        return self._group

    def _write(self, variable: Variable, window: Window, maps: ChunkMaps) -> None:
        """Write a window of one array."""
        fill = np.asarray(variable.fill)
        rows, columns = window.slices
        array: Any = self._writable()[variable.name]
        array[rows, columns] = maps.arrays.get(variable.name, fill).astype(variable.dtype)

    def _file(self, variable: Variable, window: Window) -> Path:
        """File of an array's window; there is none where the array is all fill."""
        row = window.y0 // self.chunk[0]
        column = window.x0 // self.chunk[1]
        further = ["0"] * len(variable.further)
        return self.path.joinpath(variable.name, "c", str(row), str(column), *further)


def open_map(path: str | Path) -> "xarray.Dataset":
    """A map that `map_cube` or `glazejax map` wrote, finished or not.

    Nothing is read before it is asked for. Windows that are not finished have status 0 and fill
    values.

    Args:
        path: folder of the map.

    Returns:
        Arrays by the names of `glazefit.mapping.store.layout.VARIABLES`, with coordinates y, x and
        paint; how the map was made stands in the attributes.

    Raises:
        ValueError: there is no map of glazejax.
        ModuleNotFoundError: xarray or zarr is not installed.
    """
    require("xarray", "zarr")
    import xarray
    from zarr.storage import LocalStore

    from .partial_store import hide_unfinished

    store = MapStore.open(path)
    done = {(window.y0 // store.chunk[0], window.x0 // store.chunk[1]) for window in store.done()}
    files = LocalStore(store.path, read_only=True)
    shown = files if len(done) == len(store.windows()) else hide_unfinished(files, done)
    return xarray.open_zarr(shown, consolidated=True, chunks=None)


def check_map(path: str | Path, *, overwrite: bool = False) -> bool:
    """Whether a map can be made at a path, or goes on there: asked before anything is computed.

    Returns:
        Whether a map is there.

    Raises:
        FileExistsError: what is there is no map of glazejax, which is never replaced.
        FileNotFoundError: the parent folder does not exist.
    """
    path = Path(path)
    if not path.absolute().parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.absolute().parent} does not exist")
    if not path.exists() or (path.is_dir() and not any(path.iterdir())):
        return False
    if _attributes(path) is None:
        words = ", and is not replaced" if overwrite else ""
        raise FileExistsError(
            f"{path} exists and is no map of glazejax{words}; choose another name"
        )
    return True


def _attributes(path: Path) -> dict[str, Any] | None:
    """Attributes of the map in a folder; None if it holds none."""
    try:
        attrs = json.loads((path / "zarr.json").read_text(encoding="utf-8"))["attributes"]
        return attrs if attrs["glazejax"]["kind"] == KIND else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _differences(existing: Mapping[str, Any], wanted: Mapping[str, Any], limit: int = 3) -> str:
    """In words, how options differ; empty if they do not."""
    names = [
        name
        for name in dict.fromkeys([*existing, *wanted])
        if existing.get(name) != wanted.get(name)
    ]
    words = [_difference(name, existing.get(name), wanted.get(name)) for name in names[:limit]]
    return "; ".join([*words, *([f"{len(names) - limit} more"] if len(names) > limit else [])])


def _difference(name: str, existing: Any, wanted: Any) -> str:
    """How one option differs: both values if they are short, or the parts in which they do."""
    if isinstance(existing, Mapping) and isinstance(wanted, Mapping):
        parts = [
            part
            for part in dict.fromkeys([*existing, *wanted])
            if existing.get(part) != wanted.get(part)
        ]
        words = [
            f"{part} is "
            f"{'new' if part not in existing else 'gone' if part not in wanted else 'another'}"
            for part in parts[:3]
        ]
        return (
            f"{name}: "
            f"{', '.join([*words, *([f'{len(parts) - 3} more'] if len(parts) > 3 else [])])}"
        )
    if any(isinstance(value, list) and len(value) > 4 for value in (existing, wanted)):
        return f"{name}: {_size(existing)} there, {_size(wanted)} now"
    return f"{name}: {_short(existing)} there, {_short(wanted)} now"


def _size(value: Any) -> str:
    """A long list by its ends."""
    if isinstance(value, list) and len(value) > 4:
        return f"{_short(value[0])} to {_short(value[-1])} ({len(value)})"
    return _short(value)


def _short(value: Any) -> str:
    text = "nothing" if value is None else value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _lock(number: int) -> bool:
    """Lock an open file for this process; the system lets go when the process ends, however it
    ends.
    """
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock
    except ImportError:  # Windows
        return True
    try:
        flock(number, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a network drive without locks
        return True
    return True
