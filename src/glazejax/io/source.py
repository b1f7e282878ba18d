"""A user's file, opened once and read once: in pieces, with a bound for all that a file could make
us take.

Every reader of users' files takes a `Source`. So a pipe (``/dev/stdin``, ``<(...)``) reads as a
file does, a device is refused before it is opened, a pipe that nobody writes into is given up, and
whatever the system says of a file (a name that is too long, a failing disk) is one sentence that
names it.
"""

import codecs
import os
import re
import select
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TypeAlias

from ..progress import Progress

NumberedLine: TypeAlias = tuple[int, str]
"""A line of a file, after its number from 1 on."""

HEAD = 1 << 16
_PIECE = 1 << 20
# A line of more is no line of a table; its cells alone would take 60 bytes each.
MAX_LINE = 1 << 22
# What is read as a whole, and into how many words it may be cut: together they stay below 200 MB.
MAX_TEXT = 1 << 24
MAX_WORDS = 1_500_000
_ENVI = ("img", "dat", "sli", "hyspex", "raw", "bil", "bip", "bsq", "lib", "slb", "cube")
DATA_ENDINGS = ("", *(f".{ending}" for word in _ENVI for ending in (word, word.upper())))
"""Endings of the binary half of an ENVI pair, next to its .hdr; the usual first."""
_PAIR_ENDINGS = (*DATA_ENDINGS, ".hdr", ".HDR")
WORKBOOKS: tuple[str, ...] = (".xlsx", ".xlsm", ".xls", ".ods")
"""Endings of workbooks, of which FILE:SHEET names a sheet."""
# Seconds until a pipe is given up: into which nobody writes, or whose writer says nothing.
NOBODY = 3.0
SILENCE = 60.0
_LONGEST = 600

_BREAKS = "\r\n\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"
# What no text of one byte a letter holds: all control characters but tab and line breaks, and
# Windows-1252's gaps.
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f\x81\x8d\x8f\x90\x9d]")
_WORDS = (b" ", b",", b"\t", b"\n", b"[", b"{", b"<", b";")


class Source:
    """An open file of a user. Made by `open_source`; its content can be taken once.

    Attributes:
        path: its name, for errors and for files next to it.
        size: bytes, or None for a pipe.
        head: its first 65536 bytes, or all if there are fewer; they are still part of the content.
        is_cut: whether there are more.
        notes: what was noticed while its lines were read.
    """

    def __init__(
        self, path: Path, descriptor: int, size: int | None, progress: Progress | None = None
    ):
        self.path = path
        self.size = size
        self._descriptor = descriptor
        self._progress = progress
        self._got = 0
        self._taken = False
        head = bytearray()
        while len(head) < HEAD and (piece := self._read(HEAD - len(head))):
            head += piece
        self.is_cut: bool = len(head) == HEAD
        self._recode: Callable[[bytes], bytes] = _from_utf16(bytes(head))
        self.head: bytes = self._recode(bytes(head))
        self.notes: list[str] = []

    def pieces(self) -> Iterator[bytes]:
        """The content, piece by piece."""
        if self._taken:
            raise RuntimeError(f"{self.path} was read twice")
        self._taken = True
        piece = self.head
        while piece:
            yield piece
            piece = self._recode(self._read(_PIECE))

    def content(self, most: int = MAX_TEXT) -> bytes:
        """The whole content.

        Raises:
            ValueError: there are more bytes than ``most``.
        """
        content = bytearray()
        if self.size is None or self.size <= most:
            for piece in self.pieces():
                content += piece
                if len(content) > most:
                    break
            else:
                return bytes(content)
        raise self.error(
            f"larger than the {most >> 20} MB that are read of such a file; split it, or export "
            "spectra as CSV, which may be larger"
        )

    def text(self, *, most: int = MAX_TEXT, fallback: str | None = "latin-1") -> str:
        """The whole content as text: UTF-8, else Latin-1, which old instruments write.

        Args:
            most: bytes.
            fallback: encoding of what is not UTF-8; None refuses it.

        Raises:
            ValueError: it is larger, of more than 1.5 million words, or not text.
        """
        content = self.content(most)
        words = sum(content.count(word) for word in _WORDS)
        if words > MAX_WORDS:
            raise self.error(f"more than {MAX_WORDS} words; split it, or export the spectra as CSV")
        try:
            return content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            if fallback is None:
                raise self._not_text(error.start) from None
            return content.decode(fallback)

    def lines(self, *, above: int = 0) -> Iterator[NumberedLine]:
        """Lines and their numbers, from 1 on, without line breaks; read while they are asked for.

        A text whose head is not UTF-8 and that has no control characters is Windows-1252, as
        spreadsheets of Western Europe save it; `notes` says so.

        Args:
            above: on how many lines NULs may stand, with which instruments fill names.

        Raises:
            ValueError: not UTF-8 text, or a line of more than 4 MB.
        """
        decoder = codecs.getincrementaldecoder("utf-8")()
        if self._is_old_text():
            decoder = codecs.getincrementaldecoder("cp1252")("replace")
            self.notes.append("not UTF-8: read as Windows-1252 (Latin-1), as spreadsheets save it")
        number = 0
        rest = ""
        done = 0
        for piece in chain(self.pieces(), [b""]):
            if done == 0:
                piece = piece.removeprefix(codecs.BOM_UTF8)
            waiting = len(decoder.getstate()[0])
            try:
                text = decoder.decode(piece, final=not piece)
            except UnicodeDecodeError as error:
                raise self._not_text(done - waiting + error.start) from None
            done += len(piece)
            # The last line may go on, or its break be half of one.
            text = rest + text
            padded = "\0" in text
            lines = text.splitlines(keepends=True)
            rest = lines.pop() if piece and lines else ""
            for line in lines:
                number += 1
                if padded and number > above and "\0" in line:
                    raise self.error("not a text file; export the table as UTF-8 CSV")
                yield number, line.rstrip(_BREAKS)
            if len(rest) > MAX_LINE:
                raise self.error(
                    f"longer than {MAX_LINE >> 20} MB: is this a table of spectra?", number + 1
                )

    @property
    def first_lines(self) -> list[str]:
        """Lines of the head as `lines` gives them, up to the last that is whole."""
        encoding = "cp1252" if self._is_old_text() else "utf-8-sig"
        lines = self.head.decode(encoding, errors="replace").splitlines()
        return lines[:-1] if self.is_cut else lines

    def error(self, complaint: object, line: int | None = None) -> ValueError:
        """Error that says what is wrong with the file, and on which line."""
        return refusal(self.path, complaint, line)

    def _is_old_text(self) -> bool:
        """Return whether the head is text of one byte a letter, and not UTF-8."""
        try:
            # A letter of several bytes may be cut at the end.
            codecs.getincrementaldecoder("utf-8")().decode(self.head)
        except UnicodeDecodeError:
            return not _CONTROL.search(self.head.replace(b"\0", b""))
        return False

    def _not_text(self, byte: int) -> ValueError:
        return self.error(f"not UTF-8 text (byte {byte}); export the table as UTF-8 CSV")

    def _read(self, count: int) -> bytes:
        """Next bytes; none at the end. Waits for the writer of a pipe, but not for ever."""
        start = time.monotonic()
        while True:
            waited = time.monotonic() - start
            try:
                piece = os.read(self._descriptor, count)
            except BlockingIOError:
                if waited > SILENCE:
                    raise self.error(
                        f"nothing came through this pipe for {SILENCE:g} s; write to a file "
                        "first and name that"
                    ) from None
                select.select([self._descriptor], [], [], 1.0)
                continue
            if piece or self._got or self.size is not None:
                break
            if waited > NOBODY:
                raise self.error("nobody writes into this pipe; is the command before it right?")
            time.sleep(0.02)
        self._got += len(piece)
        if self._progress is not None:
            self._progress(self._got, self.size, "reading")
        return piece


def _from_utf16(head: bytes) -> Callable[[bytes], bytes]:
    """Converter of a file's bytes into UTF-8: those of UTF-16, as spreadsheets save Unicode text,
    by the mark they begin with; all others stay.
    """
    if head[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        text = head.decode("utf-16", "replace").encode("ascii", "replace")
        if not _CONTROL.search(text):
            decoder = codecs.getincrementaldecoder("utf-16")("replace")
            return lambda piece: decoder.decode(piece).encode(errors="replace")
    return bytes


@contextmanager
def open_source(
    path: str | Path, *, progress: Progress | None = None, missing: str = ""
) -> Iterator[Source]:
    """A file or pipe, open for reading; all that the system complains of meanwhile names it.

    Args:
        path: of the file.
        progress: called as it is read, with bytes; a pipe has no total.
        missing: what to say if there is no such file.

    Raises:
        FileNotFoundError: no such file.
        OSError: the system cannot open or read it.
        ValueError: it is a folder or a device, a pipe that nobody writes into, or too large for the
            memory.
    """
    path = Path(path)
    with explain_errors(path, missing):
        mode = os.stat(path).st_mode
        if stat.S_ISDIR(mode):
            raise ValueError(f"{show_path(path)}: this is a folder, not a file; name a file in it")
        if not (stat.S_ISREG(mode) or stat.S_ISFIFO(mode)):
            raise ValueError(
                f"{show_path(path)}: this is a device, not a file; name a file or a pipe"
            )
        descriptor = os.open(
            path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        )
        try:
            size = os.fstat(descriptor).st_size if stat.S_ISREG(mode) else None
            yield Source(path, descriptor, size, progress)
        finally:
            os.close(descriptor)


@contextmanager
def explain_errors(path: Path, missing: str = "") -> Iterator[None]:
    """Say what goes wrong with a file in one sentence that names it, whatever the system or Python
    calls it.

    Args:
        path: of the file.
        missing: what to say if there is no such file.
    """
    name = show_path(path)
    try:
        yield
    except OSError as error:
        if error.strerror is None:
            raise
        if isinstance(error, FileNotFoundError):
            raise FileNotFoundError(missing or f"{name}: there is no such file") from None
        raise type(error)(f"{name}: cannot be read: {error.strerror}") from None
    except MemoryError:
        raise ValueError(f"{name}: too large for this machine's memory; split it") from None
    except RecursionError:
        raise ValueError(f"{name}: nested too deeply to be a file of spectra") from None
    except ValueError as error:
        if "embedded null" in str(error):
            raise ValueError(f"{name}: a file's name cannot hold the character NUL") from None
        raise


@contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Has the errors of what knows no file name this one."""
    try:
        yield
    except ValueError as error:
        raise refusal(path, error) from None


def is_there(path: str | Path) -> bool:
    """Return whether there is a file, pipe or device of this name, and no folder; False for a name
    that cannot be.
    """
    try:
        return not stat.S_ISDIR(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def with_its_pair(path: Path) -> list[Path]:
    """A file and, where it is half of an ENVI pair, the other half."""
    if path.suffix.lower() not in _PAIR_ENDINGS or path.is_dir():
        return [path]
    candidates = {path.with_suffix(ending) for ending in _PAIR_ENDINGS}
    # The header of cube.img may be cube.img.hdr, too.
    candidates |= {path.with_name(f"{path.name}{end}") for end in (".hdr", ".HDR")}
    companions = [
        companion for companion in candidates if companion != path and companion.is_file()
    ]
    pair = [path, *sorted(companions)]
    return pair if any(file.suffix.lower() == ".hdr" for file in pair) else [path]


def split_sheet(path: Path) -> tuple[Path, str]:
    """File and sheet of ``FILE.xlsx:SHEET``; the sheet is empty where none is named."""
    file, colon, sheet = str(path).rpartition(":")
    if colon and Path(file).suffix.lower() in WORKBOOKS and not is_there(path) and is_there(file):
        return Path(file), sheet
    return path, ""


def refusal(path: str | Path, complaint: object, line: int | None = None) -> ValueError:
    """Error that says what is wrong with a file, on which line, in one line of bearable length
    whatever the file holds.
    """
    where = show_path(path) if line is None else f"{show_path(path)}, line {line}"
    return ValueError(f"{shorten(where)}: {shorten(str(complaint))}")


def shorten(text: str) -> str:
    """Text on one line, without its middle if it is long."""
    if not text.isprintable():
        text = "".join(letter if letter.isprintable() else " " for letter in text)
    return (
        text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    )


def show_path(path: str | Path) -> str:
    """Path as errors show it, on one line."""
    text = str(path)
    return text if text.isprintable() else repr(text)
