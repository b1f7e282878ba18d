"""Files of every kind that a user may name, ways to damage them, and what a reader may then do."""

import io
import json
import logging
import math
import random
import re
import signal
import struct
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from functools import partial
from importlib import import_module
from logging.handlers import BufferingHandler
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from glazefit.film.readers import read_films, read_recipes
from glazejax.appearance.scene.file import read_scene
from glazejax.appearance.scene.file_materials import read_grey
from glazejax.appearance.scene.lights import measured_lamp
from glazejax.io import SpectraTable, read_spectra
from glazejax.paint.pigment_table import read_pigments

from .samples import (
    ASD_WHITE,
    CGATS,
    CXF,
    ENVI,
    GRID,
    asd_body,
    asd_header,
    envi_header,
    jcamp_block,
    lines,
    old_workbook,
    spectra,
)

_PLAIN = """
0 -1 1 2 3 65536 2147483648 4294967297 9223372036854775808 400000000 1e308 1e999 -1e999 nan inf
0x10 1_0 1,5 1e-320 J9 s999999 name true null END &lt; &a; ## $$
"""
WORDS = (
    *_PLAIN.split(),
    *("9" * count for count in (40, 1000, 5000)),
    *('{}[<>=#,;é%-+."' + "\t\n\r\0 \ud7ff\ufeff\u2028'"),
    *("", "[" * 3000, "<!DOCTYPE a>"),
)
# Words of Python and NumPy that are no answer to a user.
_RIDDLES = re.compile(
    r"out of range|axes don't|NoneType|to unpack|broadcast|object is not|codec can't|invalid "
    r"literal|zero-size array"
    r"|has no attribute|must be real number|Exceeds the limit|cannot reshape|division by "
    r"zero|shapes? .* not aligned|too large for this machine's memory"
)
SECONDS = 10.0
"""Of processor time for one file."""
MEMORY = 200 << 20
"""Bytes that a reader may take above the file's size."""
_ADDRESSES = 4 << 30
"""Bytes that a reader may reserve: what asks for more gets none. XLA crashes where it gets none, and
a scene compiles programs, so there is room for these.
"""


@dataclass
class Subject:
    """A sample file and its reader.

    Attributes:
        name: name of the file that is damaged.
        content: what it holds before; text becomes bytes.
        read: the reader.
        beside: files that belong to it.
        counts: what is wrong with a result by the counts that the content declares, or nothing.
    """

    name: str
    content: Any
    read: Callable[[Path], Any] = read_spectra
    beside: dict[str, bytes] = field(default_factory=dict)
    counts: Callable[[bytes, Any], str] = lambda content, found: ""

    def __post_init__(self) -> None:
        self.content = self.content.encode() if isinstance(self.content, str) else self.content

    def put(self, folder: Path, content: bytes | None = None) -> Path:
        """Write the file, or what was made of it, and what belongs to it."""
        path = folder / self.name
        for name, text in (
            self.beside | {self.name: self.content if content is None else content}
        ).items():
            (folder / name).write_bytes(text)
        return path


class Fault(Exception):
    """A reader did what no reader may."""


@st.composite
def damaged_files(draw: st.DrawFn, subjects: dict[str, Subject]) -> tuple[str, bytes]:
    """The kind of a sample file, and its content after one to three damages."""
    kind = draw(st.sampled_from(list(subjects)))
    # Hypothesis' own draws are simpler than chance, and find fewer faults.
    chance = draw(st.randoms(use_true_random=True))
    content = subjects[kind].content
    damages = (*_DAMAGES, partial(_splice, [subject.content for subject in subjects.values()]))
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        content = chance.choice(damages)(content, chance)
    return kind, content


class _Late(BaseException):
    """A reader has used up its time; no reader catches it."""


@contextmanager
def limits(size: int) -> Iterator[None]:
    """Limits of processor time and memory while a file of `size` bytes is read, where Linux keeps
    them.

    Raises:
        Fault: the reader takes more.
    """
    if sys.platform != "linux":
        yield
        return
    import resource

    def stop(*_: object) -> None:
        raise _Late

    # The kernel forgets the largest size so far.
    Path("/proc/self/clear_refs").write_text("5")
    before = _bytes_of("VmRSS")
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    room = _bytes_of("VmSize") + _ADDRESSES
    former = signal.signal(signal.SIGPROF, stop)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (room, most))
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        yield
    except _Late:
        raise Fault(f"more than {SECONDS:g} s") from None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        signal.signal(signal.SIGPROF, former)
    if (above := _bytes_of("VmHWM") - before) > MEMORY + size:
        raise Fault(f"{above >> 20} MB for a file of {size} bytes")


def _bytes_of(title: str) -> int:
    """A size of this process as the kernel counts it."""
    (line,) = re.findall(rf"{title}:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(line) << 10


def outcome(subject: Subject, folder: Path, content: bytes) -> bool:
    """Whether the reader accepts this content of the subject's file.

    Raises:
        Fault: it raises what it may not, says what is no answer, or gives another number of things
            than declared.
    """
    path = subject.put(folder, content)
    try:
        with warnings.catch_warnings(), _no_log():
            # Users see them as lines of Python's.
            warnings.simplefilter("error")
            found = subject.read(path)
    except (ValueError, OSError) as error:
        words = str(error)
        if len(words.splitlines()) != 1 or len(words) > 2000:
            raise Fault(
                f"{type(error).__name__} of {len(words.splitlines())} lines: {words[:300]!r}"
            ) from error
        if path.stem not in words:
            raise Fault(f"does not name the file: {type(error).__name__}: {words[:300]}") from error
        if (riddle := _RIDDLES.search(words)) is not None:
            raise Fault(f"a riddle, {riddle[0]!r}: {words[:300]}") from error
        return False
    except Fault:
        raise
    except Exception as error:
        raise Fault(f"{type(error).__name__}: {str(error)[:300]}") from error
    if isinstance(found, SpectraTable):
        _check_table(found)
    if any(np.isnan(numbers).any() for numbers in _numbers(found)):
        raise Fault("numbers that are none")
    if wrong := subject.counts(content, found):
        raise Fault(f"silently wrong: {wrong}")
    return True


@contextmanager
def _no_log() -> Iterator[None]:
    """What a library logs as a warning is a line that users see, and a fault here."""
    handler = BufferingHandler(sys.maxsize)
    handler.setLevel(logging.WARNING)
    logging.getLogger().addHandler(handler)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(handler)
        for record in handler.buffer:
            raise Fault(f"log of {record.name}: {record.getMessage()}")


def _numbers(found: Any) -> Iterator[np.ndarray]:
    """Every floating-point number of a result, however deep."""
    if isinstance(found, float | np.floating | np.ndarray):
        numbers = np.asarray(found)
        if numbers.dtype.kind == "f":
            yield numbers
    elif isinstance(found, dict):
        yield from _numbers(list(found.values()))
    elif isinstance(found, list | tuple):
        for part in found:
            yield from _numbers(part)
    elif is_dataclass(found):
        yield from _numbers([getattr(found, part.name) for part in fields(found)])


def _check_table(table: SpectraTable) -> None:
    values = table.reflectance
    if values.shape != (len(table.names), table.wavelengths.size) or len(set(table.names)) != len(
        table.names
    ):
        raise Fault(
            f"{len(table.names)} names, {table.wavelengths.size} bands and values of shape "
            f"{values.shape}"
        )
    if not (np.isfinite(values).all() and (np.diff(table.wavelengths) > 0).all()):
        raise Fault("values that are not finite or wavelengths that do not ascend")
    if any(not text.isprintable() for note in table.notes for text in note.split("\n")):
        raise Fault(f"notes that cannot be printed: {table.notes!r}")


def _flip(content: bytes, chance: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 8))):
        if changed:
            at = chance.randrange(len(changed))
            changed[at] = (
                changed[at] ^ (1 << chance.randrange(8))
                if chance.random() < 0.5
                else chance.randrange(256)
            )
    return bytes(changed)


def _cut(content: bytes, chance: random.Random) -> bytes:
    start, end = sorted(chance.randrange(len(content) + 1) for _ in range(2))
    return chance.choice((content[:end], content[start:], content[:start] + content[end:]))


def _insert(content: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(content) + 1)
    start, end = sorted(chance.randrange(len(content) + 1) for _ in range(2))
    piece = chance.choice(
        (content[start:end], chance.randbytes(chance.randrange(20)), _word(chance))
    )
    return content[:at] + piece + content[at:]


def _word(chance: random.Random) -> bytes:
    return chance.choice(WORDS).encode()


def _swap(content: bytes, chance: random.Random) -> bytes:
    """Two fields, or two lines, change places."""
    parts = re.split(chance.choice((rb"(\n)", rb"([,;\t ]+)", rb"(\W+)")), content)
    if len(parts) > 2:
        i, j = (2 * chance.randrange((len(parts) + 1) // 2) for _ in range(2))
        parts[i], parts[j] = parts[j], parts[i]
    return b"".join(parts)


def _number(content: bytes, chance: random.Random) -> bytes:
    """A number, of the header more often than not, becomes another."""
    found = list(re.finditer(rb"-?\d+(?:\.\d+)?", content))
    if not found:
        return content
    match = chance.choice(found[:20] if chance.random() < 0.6 else found)
    near = str(int(float(match[0][:15])) + chance.choice((-1, 1, 10, 1000))).encode()
    word = chance.choice((_word(chance), near, match[0] * 2, b"%d" % chance.randrange(1 << 34)))
    return content[: match.start()] + word + content[match.end() :]


def _field(content: bytes, chance: random.Random) -> bytes:
    """Bytes that may be a binary number become another."""
    kind = chance.choice(("<b", "<h", "<H", "<i", "<f", "<d", ">i", ">d"))
    numbers = (0, 1, -1, 127, 255, 32767, 65535, 2**31 - 1, np.nan, np.inf, 1e30, -1e30)
    value = chance.choice(numbers)
    try:
        packed = struct.pack(kind, value if kind[1] in "fd" else int(value))
    except (struct.error, ValueError, OverflowError):
        packed = b"\xff\xff\xff\x7f"
    at = chance.randrange(min(len(content), 600) + 1)
    return content[:at] + packed + content[at + len(packed) :]


def _splice(others: list[bytes], content: bytes, chance: random.Random) -> bytes:
    """The beginning of one file and the end of another."""
    other = chance.choice(others)
    return content[: chance.randrange(len(content) + 1)] + other[chance.randrange(len(other) + 1) :]


def _repeat(content: bytes, chance: random.Random) -> bytes:
    """A piece many times over, up to a megabyte."""
    if chance.random() < 0.8 or not content:
        return _number(content, chance)
    start = chance.randrange(len(content))
    piece = content[start : start + chance.choice((1, 3, 30, 1000))]
    return content[:start] + piece * (chance.randrange(1 << 20) // len(piece)) + content[start:]


_DAMAGES = (_flip, _flip, _cut, _insert, _swap, _swap, _number, _number, _field, _repeat)


def subjects() -> dict[str, Subject]:
    """One of each kind, by what the kind is called."""
    values = spectra().round(4).tolist()
    names = ["red", '"green, light"', "blue"]
    rows = [[name, *row] for name, row in zip(names, values, strict=True)]
    wide = lines([["Name", *GRID], *rows])
    columns = "# µ spectrometer\n" + lines(zip(GRID, *values, strict=True), " ")
    long = columns.replace(" ", ";").replace(".", ",").partition("\n")[2]
    long = f"# unit: fraction\nwavelength (nm);red;green;blue\n{long}"
    triples = [[row[0], *pair] for row in rows for pair in zip(GRID, row[1:], strict=True)]
    triples = lines([["sample", "wavelength", "reflectance"], *triples], "\t")
    entries: list[dict[str, Any]] = [{"type": "wavelengths", "values": GRID.tolist()}]
    for name, *row in rows:
        percent = [100 * value for value in row]
        entries.append({"name": name.strip('"'), "reflectance": percent, "grams": 2})
    library = envi_header(ENVI).encode()
    image = envi_header(
        ENVI
        | {
            "samples": 4,
            "bands": 31,
            "file type": "ENVI Standard",
            "data type": 12,
            "interleave": "bil",
            "reflectance scale factor": 10000,
            "spectra names": None,
            "header offset": 0,
        }
    ).encode()
    pixels = np.round(1e4 * spectra(12).reshape(3, 4, 31).transpose(0, 2, 1))
    pixels = pixels.astype("<u2").tobytes()
    numbers = spectra().astype("<f4").tobytes()
    films = [["name", 400, 500, 600]]
    pigments = []
    for name in "AB":
        films += [[f"{name}_{end}", 0.1, i / 10, 0.5] for i, end in enumerate(READINGS, 2)]
        pigments += [[name, w, 10 + w, 20.5, 1, "inf", "true"] for w in (400, 500, 600, 700)]
    array = io.BytesIO()
    np.save(array, np.linspace(0, 1, 12).reshape(3, 4))
    asd = asd_header() + asd_body(0.5 * ASD_WHITE)
    steps = jcamp_block(form="XYDATA")
    flat = np.repeat(np.round(spectra(1)[0, ::2], 3), 2)[:-1]
    packed = jcamp_block(values=flat, form="DIFDUP")
    return {
        "CSV, a sample a row": Subject("wide.csv", wide, counts=_lines),
        "CSV, a sample a column": Subject("long.csv", long, counts=_lines),
        "TSV, a value a row": Subject("longest.tsv", triples, counts=_lines),
        "columns without a header": Subject("columns.txt", columns, counts=_lines),
        "SpectraMagic": Subject("both.csv", _spectramagic()),
        "Ocean Optics": Subject(
            "ocean.txt", f"Date: x\nScans: 3\n>>>>>Begin Spectral Data<<<<<\n{columns}"
        ),
        "SVC": Subject(
            "panel.sig",
            "/*** Spectra Vista SIG Data ***/\ncomm= red\ndata= \n"
            + lines(([w, 2.0, 1.0, w // 10 + 0.5] for w in GRID), "  "),
        ),
        **_workbooks(),
        "CGATS": Subject("chart.txt", CGATS, counts=_cgats),
        "CxF3": Subject("chart.cxf", CXF, counts=_cxf),
        "JCAMP-DX pairs": Subject("pairs.dx", jcamp_block(), counts=_jcamp),
        "JCAMP-DX steps": Subject("steps.dx", steps + steps, counts=_jcamp),
        "JCAMP-DX packed": Subject("packed.dx", packed, counts=_jcamp),
        "ASD": Subject("ochre.asd", asd, counts=_asd),
        "JSON": Subject("paints.json", json.dumps(entries), counts=_json),
        "ENVI library, header": Subject(
            "lib.hdr", library, beside={"lib.sli": numbers}, counts=_envi_counts
        ),
        "ENVI library, data": Subject(
            "lib.sli", numbers, beside={"lib.hdr": library}, counts=_fixed(3)
        ),
        "ENVI image, header": Subject(
            "cube.hdr", image, beside={"cube.img": pixels}, counts=_envi_counts
        ),
        "ENVI image, data": Subject(
            "cube.img", pixels, beside={"cube.hdr": image}, counts=_fixed(12)
        ),
        "pigments": Subject(
            "pigments.csv", PIGMENTS + lines(pigments), read_pigments, counts=_pigments
        ),
        "films": Subject("films.tsv", lines(films, "\t"), read_films),
        "names of films": Subject(
            "mixtures.tsv", "# paints\n01\tRed-White|100-0\n02\tBlue|100\n", read_recipes
        ),
        "scene": Subject(
            "scene.toml",
            SCENE,
            read_scene,
            {"map.npy": array.getvalue(), "wide.csv": wide.encode()},
        ),
        "thickness map": Subject("map.npy", array.getvalue(), read_grey),
        "picture of thickness": Subject("map.png", _png(), read_grey),
        "lamp": Subject(
            "lamp.csv",
            "nm,one\n" + lines([w, w - 299.5] for w in range(380, 781, 10)),
            lambda path: measured_lamp(path, GRID),
        ),
    }


READINGS = ("b", "w", "ob", "ow")
PIGMENTS = (
    "# fitted\n"
    "pigment,wavelength_nm,absorption,scattering,absorption_sd,scattering_sd,identifiable\n"
)


SCENE = """[picture]
width = 12
height = 8
wavelengths = "400:700:20"
background = 0.2
[camera]
position = [0, -4, 2]
[lights.sun]
illuminant = "D65"
direction = [0, 1, -1]
[materials.grey]
kind = "lambert"
reflectance = "wide.csv:red"
[materials.paint]
kind = "glaze"
coats = "ZincWhite:20um"
thickness_map = "map.npy"
thickness_range = ["0um", "20um"]
[objects.ball]
shape = "sphere"
material = "grey"
centre = [0, 0, 1]
radius = 1.0
"""


def _spectramagic() -> str:
    bands = [f"{word}_{w:g}nm" for word in ("SCI", "SCE") for w in GRID]
    rows = [["Instrument", "CM-700d"], [], ["Data Name", "L*(D65)", *bands]]
    rows += [[f"red {i}", 50.5, *row, *row] for i, row in enumerate(spectra(2))]
    return lines(rows)


def _workbooks() -> dict[str, Subject]:
    """Workbooks of both kinds."""
    rows = [["Name", *map(float, GRID)], ["red", *spectra(1)[0].tolist()]]
    book = import_module("openpyxl").Workbook()
    for row in rows:
        book.active.append(row)
    file = io.BytesIO()
    book.save(file)
    return {
        "workbook": Subject("films.xlsx", file.getvalue()),
        "old workbook": Subject("films.xls", old_workbook({"Films": rows})),
    }


def _png() -> bytes:
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(np.arange(240, dtype=np.uint8).reshape(12, 20)).save(file, "png")
    return file.getvalue()


def _fixed(rows: int) -> Callable[[bytes, Any], str]:
    """Data beside a header that was not damaged; pixels without data may be left out."""

    def counts(content: bytes, found: Any) -> str:
        right = "ENVI" not in found.format or found.reflectance.shape == (rows, GRID.size)
        if right or _leaves_out(found):
            return ""
        return f"{found!r} where the header declares {rows} of 31 bands"

    return counts


def _note_numbers(found: Any, words: str) -> list[int]:
    """Numbers of the notes that begin with these words."""
    matches = [re.match(words, note) for note in found.notes]
    return [int(match[1]) for match in matches if match]


def _leaves_out(found: Any) -> bool:
    """Whether notes say that something is left out."""
    return "left out" in str(found.notes)


def _lines(content: bytes, found: Any) -> str:
    text = content.decode("utf-8-sig", "replace")
    above = next(iter(_note_numbers(found, r"(?:line )?(\d+) .*not read")), 0)
    ends = _note_numbers(found, r"the table ends above line (\d+)")
    below = ends[0] - 1 if ends else None
    # Which bands are left out where detectors overlap, or data are missing, other tests say.
    if any(note.startswith(("detectors overlap", "values below")) for note in found.notes):
        return ""
    rows_of_text = [
        line
        for line in text.splitlines()[above:below]
        if line.strip(" \t,;") and not line.lstrip().startswith("#")
    ]
    rows, bands = len(found), found.wavelengths.size
    wanted = {"row": rows, "column": bands}.get(found.format.rpartition(" ")[2], bands)
    if "a value a row" in found.format:
        wanted = rows * bands
    # Readings with and without the specular component may stand on one line.
    kinds = next((note for note in found.notes if note.startswith("each line gives a")), "")
    wanted /= max(kinds.count("NAME "), 1)
    # A spectrometer's noise at the ends is left out, as a note says.
    wanted += sum(_note_numbers(found, r"(\d+) bands at the ends are left out"))
    titled = " table, " in found.format
    # A damage may have made it a file of another format.
    counted = titled or "columns of numbers" in found.format
    below = len(rows_of_text) - titled
    return f"{below} lines, {found!r}" if counted and below != wanted else ""


def _cgats(content: bytes, found: Any) -> str:
    promised = re.findall(rb"^NUMBER_OF_SETS[ \t]+(\d+)[ \t]*$", content, re.MULTILINE)
    wrong = "CGATS" in found.format and len(promised) == 1 and int(promised[0][:18]) != len(found)
    return (
        f"{promised} sets, {found!r}" if wrong and content.count(b"BEGIN_DATA_FORMAT") == 1 else ""
    )


def _cxf(content: bytes, found: Any) -> str:
    spectra = len(re.findall(rb"<cc:ReflectanceSpectrum\b", content))
    # A damage may have made it a file of another format.
    wrong = "CxF" in found.format and b"<!" not in content and spectra != len(found)
    return f"{spectra} spectra, {found!r}" if wrong else ""


def _jcamp(content: bytes, found: Any) -> str:
    promised = {word.strip() for word in re.findall(rb"^##NPOINTS=(.*)$", content, re.MULTILINE)}
    wrong = not _leaves_out(found) and promised and b"%d" % found.wavelengths.size not in promised
    wrong = wrong and "JCAMP" in found.format
    try:
        same = {float(word) for word in promised} == {found.wavelengths.size}
    except ValueError:
        same = False
    return f"{promised} points, {found!r}" if wrong and not same else ""


def _asd(content: bytes, found: Any) -> str:
    if "ASD" not in found.format:
        return ""
    (channels,) = struct.unpack_from("<H", content, 204)
    wrong = channels != found.wavelengths.size and not _leaves_out(found)
    return f"{channels} channels, {found!r}" if wrong else ""


def _json(content: bytes, found: Any) -> str:
    if "JSON" not in found.format:
        return ""
    entries = json.loads(content.decode("utf-8-sig", "replace"))
    count = sum("reflectance" in entry for entry in entries)
    return f"{count} spectra, {found!r}" if count != len(found) else ""


def _envi_counts(content: bytes, found: Any) -> str:
    text = content.decode("utf-8", "replace").lower()
    sizes = {}
    for title in ("samples", "lines", "bands"):
        numbers = re.findall(rf"^[ \t]*{title}[ \t]*=[ \t]*(\d+)[ \t\r]*$", text, re.MULTILINE)
        if len(numbers) != 1:
            return ""
        sizes[title] = int(numbers[0])
    if _leaves_out(found) or "ENVI" not in found.format:
        return ""
    right = found.reflectance.size == math.prod(sizes.values())
    return "" if right else f"{sizes}, {found!r}"


def _pigments(content: bytes, found: Any) -> str:
    lines = content.decode("utf-8-sig", "replace").splitlines()
    below = sum(bool(line.strip()) and not line.startswith("#") for line in lines) - 1
    held = sum(np.size(pigment.wavelengths) for pigment in found.values())
    return "" if below == held else f"{below} lines, {held} wavelengths"
