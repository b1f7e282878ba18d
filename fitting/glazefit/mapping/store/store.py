"""The store of a map: a zarr 3 folder that fills window by window, and goes on after a kill where
it stopped.

zarr puts each chunk in place whole, with a checksum (CRC-32C). A window's status is written last,
after its other arrays and sums over its sets. A window without status is not finished, whatever a
killed run left in the arrays: `open_map` shows fill values in its place, and a run that goes on
does it again. A finished window of which a chunk is missing or does not meet its checksum is
damaged: `open_map` refuses to read it, and a run that goes on does it again, too.
"""

import json
import reprlib
import shutil
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from glazejax.extras import require

from .atomic_files import KeyedResults, explain_full_disk
from .chunk import ChunkMaps, Members, SetSum, Unexplained, pack, unpack
from .layout import BY_NAME, PLACES, STATUS_WORDS, VARIABLES, Variable, Way
from .lock import hold
from .windows import Window, windows

if TYPE_CHECKING:
    import xarray

FORMAT = 5
"""Version of the format, in the attribute `glazejax` of a map."""

WORK = ".glazejax"
"""Folder within a map that holds what a run needs to go on."""

# End of an error of a damaged window.
_FIX = "; run the same `glazejax map` again, which maps the window once more"
# A list or text that differs is shown by so much of it.
_short = reprlib.Repr()
_short.maxlist = 4
_short.maxstring = 60


class DamagedWindow(UserWarning):
    """A window that was not as it had been written, and is mapped again."""


class MapStore:
    """A map on disk, that is there, or is made by `create`.

    Attributes:
        path: its folder.
        shape: rows and columns of the image.
        chunk: rows and columns of a window.
        paints: names of the paints, in the order of their numbers.
        options: what the map depends on, as plain JSON.
        run: distinguishes the map from any that it replaced.
        complete: every window is finished, and one that lacks its status damaged.
        work: where a run keeps what it found before the windows.

    Raises:
        ValueError: there is no map in the folder, or a damaged one.
    """

    def __init__(self, path: str | Path):
        require("zarr", "filelock")
        self.path = Path(path)
        if not is_map(self.path):
            raise ValueError(
                f"{path} is no map of glazejax; name the folder that `glazejax map` wrote with "
                "--out"
            )
        try:
            attrs = json.loads((self.path / "zarr.json").read_bytes())["attributes"]
            about = attrs["glazejax"]
            written = about["format"]
            self.run: str = about["run"]
            self.shape: tuple[int, int] = (about["shape"][0], about["shape"][1])
            self.chunk: tuple[int, int] = (about["chunk"][0], about["chunk"][1])
            self.paints: tuple[str, ...] = tuple(attrs["paints"])
            self.options: dict[str, Any] = attrs["options"]
            self.complete: bool = attrs.get("complete", False)
        except (ValueError, KeyError, TypeError):
            raise _damaged(self.path, "zarr.json is not as it was written") from None
        if written != FORMAT:
            raise ValueError(
                f"{path} is a map of format {written}, written by another glazejax; this one reads "
                f"format {FORMAT}: make the map again (--overwrite), or read it by xarray.open_zarr"
            )
        self.work = KeyedResults(self.path / WORK / "work")
        self._sums = KeyedResults(self.path / WORK / "sums")

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
        import zarr

        path = Path(path)
        requested = plain({**options, "shape": shape, "paints": paints})
        check_map(path, overwrite=overwrite)
        with hold(path):
            if path.exists() and any(path.iterdir()) and not overwrite:
                existing = cls(path)
                others = _others(existing.options, requested)
                if others:
                    differences = [_difference(n, existing.options, requested) for n in others]
                    raise ValueError(
                        f"{path} was begun with other options ({_few('; ', differences)}); name "
                        "another map, or replace it with overwrite=True (--overwrite)"
                    )
                return existing
            # Made next to the map, so that a map is there whole or as it was before.
            new, old = (path.with_name(f".{path.name}.{state}") for state in ("new", "old"))
            try:
                for leftover in (new, old):
                    shutil.rmtree(leftover, ignore_errors=True)
                with explain_full_disk(path, lambda: "nothing of the map was begun"):
                    about = {"format": FORMAT, "run": uuid4().hex, "shape": shape, "chunk": chunk}
                    attributes = {
                        "Conventions": "CF-1.11",
                        **(attrs or {}),
                        "paints": paints,
                        "options": requested,
                        "glazejax": about,
                    }
                    zarr.create_group(new, attributes=plain(attributes))
                    (new / WORK).mkdir()
                    cls(new)._lay_out(coords or {})
                    if path.exists():
                        path.replace(old)
                    new.replace(path)
            finally:
                for leftover in (new, old):
                    shutil.rmtree(leftover, ignore_errors=True)
        return cls(path)

    def _lay_out(self, coords: Mapping[str, tuple[np.ndarray, Mapping[str, Any]]]) -> None:
        """Write the arrays of a new map, all fill, and its coordinates; see `create`."""
        import zarr
        from zarr.codecs import BloscCodec, Crc32cCodec

        group = zarr.open_group(self.path, mode="r+")
        packed = [BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"), Crc32cCodec()]
        sizes = {"paint": len(self.paints), "place": PLACES, "rgb": 3}
        for variable in VARIABLES:
            further = [sizes[name] for name in variable.further]
            group.create_array(
                variable.name,
                shape=(*self.shape, *further),
                chunks=(*self.chunk, *further),
                dtype=variable.dtype,
                fill_value=variable.fill,
                compressors=packed,
                dimension_names=["y", "x", *variable.further],
                attributes=_words(variable, self.paints),
            )
        for name, length in zip(("y", "x"), self.shape, strict=True):
            values, attributes = coords.get(name, (np.arange(length) + 0.5, {"units": "pixel"}))
            group.create_array(
                name,
                data=np.asarray(values),
                compressors=packed,
                dimension_names=[name],
                attributes=plain(attributes),
            )
        names = group.create_array(
            "paint",
            shape=(len(self.paints),),
            chunks=(max(len(self.paints), 1),),
            dtype=str,
            compressors=packed,
            dimension_names=["paint"],
        )
        names[:] = np.array([*self.paints], dtype=object)
        with warnings.catch_warnings():
            # zarr warns that others may not know this list of arrays; without it readers complain
            # of the folder that is no array.
            warnings.simplefilter("ignore")
            zarr.consolidate_metadata(group.store)

    def windows(self) -> list[Window]:
        """All windows, row by row."""
        return windows(self.shape, self.chunk)

    def done(self) -> set[Window]:
        """The windows that are finished."""
        return {window for window in self.windows() if self.is_done(window)}

    def is_done(self, window: Window) -> bool:
        """True for a finished window: it has its status, which is written last."""
        return (self.path / self._key(BY_NAME["status"], window)).exists()

    def lacks(self, key: str) -> bool:
        """True if a key of zarr's names a chunk of a window that is not finished."""
        window = self._window(key)
        return window is not None and not self.complete and not self.is_done(window)

    def check(self, key: str, content: bytes | None) -> None:
        """See that a chunk of a finished window is as it was written.

        Args:
            key: of zarr's; what is no chunk of an array is not checked.
            content: as it is stored; None if it is not there.

        Raises:
            ValueError: it is missing, or does not meet its checksum.
        """
        from numcodecs.checksum32 import CRC32C

        window = self._window(key)
        if window is None:
            return
        if content is None:
            raise self._damage(window, f"{key} is missing")
        try:
            CRC32C(location="end").decode(content)
        except (ValueError, RuntimeError):
            raise self._damage(window, f"{key} is not as it was written") from None

    def put(self, window: Window, maps: ChunkMaps) -> None:
        """Write a window: sums over its sets, its arrays, the status of its pixels last.

        Raises:
            ValueError: arrays that do not fit the window.
            OSError: the disk is full; other windows are kept.
        """
        import zarr

        with explain_full_disk(
            self.path,
            lambda: (
                f"{len(self.done())} of {len(self.windows())} windows are finished and kept: "
                "make room, then run the same again and it goes on"
            ),
        ):
            self._sums.put(str(window), pack(maps))
            # Chunks of nothing but fill are written too, so that one that is missing is noticed.
            with zarr.config.set({"array.write_empty_chunks": True}):
                group = zarr.open_group(self.path, mode="r+")
                arrays: dict[str, Any] = {name: group[name] for name in BY_NAME}
            for variable in sorted(VARIABLES, key=lambda variable: variable.name == "status"):
                values = maps.arrays.get(variable.name, np.asarray(variable.fill))
                arrays[variable.name][window.slices] = values.astype(variable.dtype)

    def sums(self) -> ChunkMaps:
        """All finished windows as one, without its arrays: counts, sums of sets, the largest set
        first, and spectra that no paints explain; in the order of the windows whatever their order
        of work.

        Raises:
            ValueError: a window's sums are damaged.
        """
        tallies: Counter[str] = Counter()
        sets: dict[Members, SetSum] = {}
        groups: list[Unexplained] = []
        for window in sorted(self.done()):
            maps = self._window_sums(window)
            tallies.update(maps.tallies)
            if len(maps.unexplained.pixels):
                groups.append(maps.unexplained)
            for members, total in maps.sets.items():
                sets[members] = sets[members] + total if members in sets else total
        by_area = sorted(sets.items(), key=lambda item: (-item[1].pixels, item[0]))
        return ChunkMaps(
            arrays={},
            tallies=tallies,
            sets=dict(by_area),
            unexplained=Unexplained.join(groups or [Unexplained.nothing()]),
        )

    def note(self, **attrs: Any) -> None:
        """Add attributes to the map, such as what a check of it found."""
        import zarr

        with explain_full_disk(self.path, lambda: "all finished windows are kept"):
            zarr.open_group(self.path, mode="r+").update_attributes(plain(attrs))

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Hold the map, so that no second run writes or replaces it; take away what a killed run
        left half-written, and the chunks of damaged windows, of which each is warned. A map of
        which nothing can be made is taken away, so that it is not in the way of the next run.

        Raises:
            ValueError: another run holds it, or has replaced it.
        """
        with hold(self.path):
            if type(self)(self.path).run != self.run:
                raise ValueError(
                    f"another run has replaced {self.path} since this one began; name another map, "
                    "or run the same again"
                )
            for leftover in self.path.rglob("*.part*"):
                leftover.unlink(missing_ok=True)
            for window in self.windows() if self.complete else sorted(self.done()):
                self._remove_damaged(window)
            begun = bool(self.work.done())
            try:
                yield
            except ValueError:
                if not (begun or self.done()):
                    shutil.rmtree(self.path)
                raise

    def _remove_damaged(self, window: Window) -> None:
        """Take a window away, and warn of it, if it is damaged."""
        files = {key: self.path / key for key in (self._key(v, window) for v in VARIABLES)}
        try:
            self._window_sums(window)
            for key, file in files.items():
                self.check(key, file.read_bytes() if file.exists() else None)
        except ValueError as damage:
            message = f"{str(damage).removesuffix(_FIX)}, and is mapped again"
            warnings.warn(message, DamagedWindow, stacklevel=5)
            for file in files.values():
                file.unlink(missing_ok=True)
            self.note(complete=False)

    def _window_sums(self, window: Window) -> ChunkMaps:
        """A finished window without its arrays."""
        try:
            return unpack(self._sums.get(str(window)))
        except (KeyError, ValueError):
            raise self._damage(window, "its sums cannot be read") from None

    def _key(self, variable: Variable, window: Window) -> str:
        """Of a window's chunk of an array, as zarr keeps it."""
        index = (window.y0 // self.chunk[0], window.x0 // self.chunk[1])
        return "/".join(map(str, (variable.name, "c", *index, *(0 for _ in variable.further))))

    def _window(self, key: str) -> Window | None:
        """Whose chunk a key names; None if it is that of no chunk of an array."""
        name, _, index = key.partition("/c/")
        if not index or name not in BY_NAME:
            return None
        y, x = (int(at) * size for at, size in zip(index.split("/"), self.chunk, strict=False))
        return Window.at(y, x, self.shape, self.chunk)

    def _damage(self, window: Window, reason: str) -> ValueError:
        """An error that names a window, what is damaged in it, and the remedy."""
        return ValueError(f"window {window} of {self.path} is damaged ({reason}){_FIX}")


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

    store = MapStore(path)
    finished = FinishedWindows(LocalStore(store.path, read_only=True), store.lacks, store.check)
    try:
        # zarr lists arrays as they come.
        return xarray.open_zarr(finished, chunks=None)[sorted(BY_NAME)]
    except ValueError:
        raise _damaged(store.path, "coordinates cannot be read") from None


def check_map(path: str | Path, *, overwrite: bool) -> None:
    """Check that a map can be made at a path, or goes on there, before anything is computed.

    Raises:
        FileExistsError: what is there is no map of glazejax, which is never replaced.
        FileNotFoundError: the parent folder does not exist.
    """
    path = Path(path)
    if not path.absolute().parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.absolute().parent} does not exist")
    empty = path.is_dir() and not any(path.iterdir())
    if path.exists() and not (empty or is_map(path)):
        refusal = ", and is not replaced" if overwrite else ""
        raise FileExistsError(
            f"{path} exists and is no map of glazejax{refusal}; choose another name"
        )


def is_map(path: Path) -> bool:
    """True for a folder that holds a map of glazejax, whole or damaged."""
    return (path / WORK).is_dir() and (path / "zarr.json").is_file()


def plain(value: Any) -> Any:
    """A value as JSON has it: paths as text, arrays and tuples as lists, what is not finite as
    text.

    Raises:
        TypeError: something that JSON has not.
    """
    return json.loads(json.dumps(value, default=_plainer), parse_constant=str)


def _plainer(value: Any) -> Any:
    """A value that JSON lacks, as one that it has."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{value!r} cannot be kept as an attribute")


def _words(variable: Variable, paints: Sequence[str]) -> dict[str, Any]:
    """Attributes of an array, by the conventions CF; numbers that stand for words have a legend."""
    # It loads JAX, which wrong options need not wait for.
    from ...identify.search.unstated_conditions import CONDITIONS

    attributes: dict[str, Any] = {"long_name": variable.meaning}
    if variable.unit:
        attributes["units"] = variable.unit
    legends: dict[str, dict[int, str]] = {
        "status": {int(flag): text for flag, text in STATUS_WORDS.items()},
        "way": {int(flag): flag.name.lower() for flag in Way},
        "members": {-1: "none", **dict(enumerate(paints))},
        "condition": {
            number: condition.words or "as stated" for number, condition in enumerate(CONDITIONS)
        },
    }
    if legend := legends.get(variable.name):
        attributes["flag_values"] = list(legend)
        attributes["flag_meanings"] = " ".join("_".join(text.split()) for text in legend.values())
    return attributes


def _damaged(path: Path, subject: str) -> ValueError:
    return ValueError(
        f"{path} is a damaged map, whose {subject}: make the map again with overwrite=True "
        "(--overwrite)"
    )


def _difference(name: str, existing: Mapping[str, Any], requested: Mapping[str, Any]) -> str:
    """Difference of one option: both values, or the parts in which they differ."""
    before, now = existing.get(name), requested.get(name)
    if not (isinstance(before, Mapping) and isinstance(now, Mapping)):
        return f"{name}: {_short.repr(before)} there, {_short.repr(now)} now"
    changes = [
        f"{key} is {'new' if key not in before else 'gone' if key not in now else 'another'}"
        for key in _others(before, now)
    ]
    return f"{name}: {_few(', ', changes)}"


def _others(existing: Mapping[str, Any], requested: Mapping[str, Any]) -> list[str]:
    """Names under which two mappings differ."""
    return [n for n in {**existing, **requested} if existing.get(n) != requested.get(n)]


def _few(between: str, items: list[str]) -> str:
    """The first three, and how many more there are."""
    return between.join([*items[:3], *([f"{len(items) - 3} more"] if len(items) > 3 else [])])
