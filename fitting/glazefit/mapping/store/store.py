"""The store of a map: a zarr 3 folder that fills window by window, and goes on after a kill where
it stopped.

A window's mark, a file in the folder ``.glazejax``, is written last: with sums over the window's
sets it holds a checksum of each file of the window. A window without a mark is not finished,
whatever a killed run left in the arrays: `open_map` shows fill values in its place, and a run that
goes on does it again. A window whose files do not meet their checksums is damaged: `open_map`
refuses to read it, and a run that goes on does it again, too.
"""

import json
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax.extras import require

from .atomic_files import KeyedResults, explain_full_disk, sync, write_whole
from .chunk import ChunkMaps, Members, SetSum, Unexplained, add_sets, add_tallies, pack, unpack
from .create import lay_out, plain
from .identity import WORK, damaged_files, is_map, read_identity
from .layout import BY_NAME, VARIABLES, Status, Variable
from .lock import hold
from .marks import Marks
from .windows import Window, windows

if TYPE_CHECKING:
    import xarray
    import zarr


class DamagedWindow(UserWarning):
    """A window that was not as it had been written, and is mapped anew."""


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
        self._identity = read_identity(self.path)
        self.shape: tuple[int, int] = self._identity.shape
        self.chunk: tuple[int, int] = self._identity.chunk
        self.paints: tuple[str, ...] = self._identity.paints
        self.options: dict[str, Any] = self._identity.options
        self._marks = Marks(self.path, self._identity)
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
            ValueError: the map that is there was begun with other options or is damaged beyond its
                windows, or another run is writing it.
            FileExistsError: what is there is no map of glazejax.
            FileNotFoundError: the parent folder does not exist.
            OSError: the disk is full.
        """
        require("zarr")
        path = Path(path)
        whole = {**options, "shape": list(shape), "paints": list(paints)}
        wanted = plain(whole)
        check_map(path, overwrite=overwrite)
        lay = partial(
            lay_out,
            shape=shape,
            paints=paints,
            options=wanted,
            attrs=attrs or {},
            coords=coords or {},
        )
        with hold(path):
            if path.exists() and any(path.iterdir()) and not overwrite:
                existing = cls(path)
                if differences := _differences(existing.options, wanted):
                    raise ValueError(
                        f"{path} was begun with other options ({differences}); name another map, "
                        "or replace it with overwrite=True (--overwrite)"
                    )
                existing._mend_files(partial(lay, chunk=existing.chunk))
                return existing
            old = path.with_name(f".{path.name}.old")
            shutil.rmtree(old, ignore_errors=True)
            with (
                explain_full_disk(path, lambda: "nothing of the map was begun"),
                _laid_out(path, partial(lay, chunk=chunk)) as new,
            ):
                if path.exists():
                    path.replace(old)
                new.replace(path)
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
        return self._marks.done()

    def put(self, window: Window, maps: ChunkMaps) -> None:
        """Write a window: its arrays, the status of its pixels last of them, then its mark.

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
            # Programs that know no marks go by the status.
            for variable in sorted(VARIABLES, key=lambda variable: variable.name == "status"):
                self._write(variable, window, maps)
            for variable in VARIABLES:
                sync(self._marks.file(variable, window))
            sync(self._marks.file(BY_NAME["status"], window).parent)
            self._marks.put(window, pack(maps))

    def check_files(self) -> None:
        """See that metadata and coordinates are as they were written.

        Raises:
            ValueError: they are not.
        """
        if damaged := damaged_files(self.path, self._identity):
            raise ValueError(
                f"{self.path} is damaged ({damaged[0]} is missing or not as it was written); run "
                "the same `glazejax map` again, which writes it anew"
            )

    def sums(self) -> tuple[dict[str, float], dict[Members, SetSum]]:
        """Counts and sums of sets over all finished windows, in the order of the windows whatever
        their order of work.

        Raises:
            ValueError: a window's mark is damaged.
        """
        tallies: dict[str, float] = {}
        sets: dict[Members, SetSum] = {}
        for window in sorted(self.done()):
            kept = unpack(self._marks.get(window))
            add_tallies(tallies, kept.tallies)
            add_sets(sets, kept.sets)
        return tallies, sets

    def unexplained(self) -> Unexplained:
        """Spectra of all finished windows that no paints explain.

        Raises:
            ValueError: a mark is damaged.
        """
        return Unexplained.join(
            [unpack(self._marks.get(w)).unexplained for w in sorted(self.done())]
        )

    def note(self, **attrs: Any) -> None:
        """Add attributes to the map, such as what a check of it found."""
        import zarr

        with explain_full_disk(self.path, lambda: "all finished windows are kept"):
            zarr.open_group(self.path, mode="r+").update_attributes(plain(attrs))

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Hold the map, so that no second run writes or replaces it; take away what a killed run
        left half-written, and the marks of damaged windows, of which each is warned.

        Raises:
            ValueError: another run holds it, or has replaced it.
        """
        if self._held:
            yield
            return
        with hold(self.path):
            if read_identity(self.path).run != self._identity.run:
                raise ValueError(
                    f"another run has replaced {self.path} since this one began; name another map, "
                    "or run the same again"
                )
            work = self.path / WORK
            work.mkdir(exist_ok=True)
            for left in (*self.path.rglob("*.partial"), *work.rglob("*.part")):
                left.unlink(missing_ok=True)
            for damage in self._marks.remove_damaged():
                warnings.warn(damage, DamagedWindow, stacklevel=4)
                self.note(complete=False)
            self._held = True
            try:
                yield
            finally:
                self._held = False

    def _mend_files(self, lay: Callable[[Path], None]) -> None:
        """Write damaged files of metadata and coordinates anew.

        Args:
            lay: lays out an empty map like this one in a folder.

        Raises:
            ValueError: they come out otherwise than they were.
        """
        damaged = damaged_files(self.path, self._identity)
        if not damaged:
            return
        with _laid_out(self.path, lay) as new:
            for name in damaged:
                (self.path / name).parent.mkdir(parents=True, exist_ok=True)
                write_whole(self.path / name, (new / name).read_bytes())
        if damaged_files(self.path, self._identity):
            raise ValueError(
                f"{self.path} is damaged ({damaged[0]} is missing or not as it was written): make "
                "the map again with overwrite=True (--overwrite)"
            )

    def _writable(self) -> "zarr.Group":
        import zarr

        if self._group is None:
            # The metadata beside each array have checksums; those that are consolidated have none.
            self._group = zarr.open_group(self.path, mode="r+", use_consolidated=False)
        return self._group

    def _write(self, variable: Variable, window: Window, maps: ChunkMaps) -> None:
        """Write a window of one array."""
        fill = np.asarray(variable.fill)
        rows, columns = window.slices
        array: Any = self._writable()[variable.name]
        array[rows, columns] = maps.arrays.get(variable.name, fill).astype(variable.dtype)


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
        ValueError: there is no map of glazejax, or its metadata or coordinates are damaged; later,
            when a damaged window is read.
        ModuleNotFoundError: xarray or zarr is not installed.
    """
    require("xarray", "zarr")
    import xarray
    from zarr.storage import LocalStore

    from .partial_store import FinishedWindows

    store = MapStore.open(path)
    store.check_files()
    shown = FinishedWindows(LocalStore(store.path, read_only=True), store._marks)
    found = xarray.open_zarr(shown, consolidated=False, chunks=None)
    # zarr lists arrays as they come, and reads them side by side.
    ordered = {name: found[name] for name in sorted(map(str, found.data_vars))}
    return xarray.Dataset(ordered, coords=found.coords, attrs=found.attrs)


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
    if not is_map(path):
        words = ", and is not replaced" if overwrite else ""
        raise FileExistsError(
            f"{path} exists and is no map of glazejax{words}; choose another name"
        )
    return True


@contextmanager
def _laid_out(path: Path, lay: Callable[[Path], None]) -> Iterator[Path]:
    """A new folder beside another, as `lay` fills it; taken away if it is still there in the
    end.
    """
    new = path.with_name(f".{path.name}.new")
    shutil.rmtree(new, ignore_errors=True)
    try:
        lay(new)
        yield new
    finally:
        shutil.rmtree(new, ignore_errors=True)


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
