"""The vocabulary of the commands: each shared option once, with one help text and one reader.

Options are annotations, `instrument: Annotated[str | None, instrument_option("d:8")] = None`;
readers turn what was typed into what the library takes, and name the option in their errors.
"""

import csv
import functools
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from .. import catalogue
from ..geometry_words import split_geometry
from ..paint.describe import (
    ALL_NAMES,
    MAX_THICKNESS,
    UNITS,
    find_name,
    parse_coats,
    same_name,
)

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    from ..geometry import Geometry
    from ..io.quantity import Stated
    from ..paint.media import Pigment
    from ..stacks import Spectrum

option: Callable[..., Any] = functools.partial(typer.Option, show_default=False)
"""An option whose default is none, or stands in its help."""


def checked(look: Callable[[Any], object]) -> Callable[[Any], Any]:
    """A callback of typer: a value that was given is looked at as it is read, before the command
    imports what it computes with.

    Args:
        look: raises a ValueError or an OSError for a wrong value.
    """

    def callback(value: Any) -> Any:
        for entry in value if isinstance(value, list) else [value]:
            if entry not in (None, ""):
                look(entry)
        return value

    return callback


def between(low: float, high: float = math.inf) -> Callable[..., Any]:
    """A callback of typer for a number from `low` to `high`; whole ones say so by being whole."""

    def callback(_: Any, param: Any, value: float | None) -> float | None:
        if value is not None and not low <= value <= high:
            bounds = f"{low:g} or more" if high == math.inf else f"from {low:g} to {high:.7g}"
            kind = "a whole number " if isinstance(value, int) else ""
            raise ValueError(f"{param.opts[0]} is {value:g}; it must be {kind}{bounds}")
        return value

    return callback


def among(*words: str) -> Callable[..., Any]:
    """A callback of typer for one of some words."""

    def callback(_: Any, param: Any, value: str | None) -> str | None:
        if value not in (None, *words):
            raise ValueError(f"{param.opts[0]} is {value!r}; it must be one of {', '.join(words)}")
        return value

    return callback


def existing(path: Path, missing: str = "") -> None:
    """Refuse a FILE, or FILE:PART, that is not there.

    Raises:
        FileNotFoundError: in the words of `missing`, or in those of all readers.
    """
    from ..io.source import show_path

    text = str(path)
    while ":" in text and not os.path.exists(text):
        text = text.rpartition(":")[0]
    try:
        os.stat(text)
    except (FileNotFoundError, NotADirectoryError):
        raise FileNotFoundError(missing or f"{show_path(path)}: there is no such file") from None


def check_illuminant(name: str) -> None:
    """Refuse the name of no CIE illuminant."""
    from ..cie import find_illuminant

    find_illuminant(name)


def _observer(name: str) -> None:
    from ..cie import find_observer

    find_observer(name)


def _quantity(name: str) -> None:
    from ..io.quantity import check_reflectance

    check_reflectance("", {"quantity": name})


def _unit(words: str) -> None:
    from ..io.quantity import read_units

    read_units({"unit": words})


there: Callable[[Any], Any] = checked(existing)
file_option: Callable[..., Any] = functools.partial(option, metavar="FILE", callback=there)
"""An option for a file that is read."""
RefractiveIndex = Annotated[
    float,
    typer.Option(
        callback=between(1.0, 2.5),
        help="Refractive index of the paint, 1 to 2.5 (oil and acrylic: 1.5).",
    ),
]
RefractiveIndexOfStack = Annotated[
    float | None,
    option(
        callback=between(1.0, 2.5),
        help="Refractive index of the paint, 1 to 2.5. Default: that of the stack's file, or 1.5.",
    ),
]
Thickness = Annotated[
    str,
    typer.Option(
        metavar="LENGTH",
        callback=checked(lambda text: read_length(text)),
        help="Typical thickness of a film, if not measured: 25um, 0.1mm. A bare number is "
        "micrometres.",
    ),
]
Noise = Annotated[
    float,
    typer.Option(
        callback=between(0.0),
        help="Noise of the instrument near black: standard deviation of a reflectance.",
    ),
]
NoiseShare = Annotated[
    float,
    typer.Option(
        callback=between(0.0),
        help="Noise proportional to the reading, added to --noise per unit of reflectance.",
    ),
]
ModelError = Annotated[
    float | None,
    option(
        callback=between(0.0, 1.0),
        help="Standard deviation of the model's error at a reflectance of 0; a hundredth of the "
        "reflectance is added. Default: 0.001.",
    ),
]
Pigments = Annotated[
    Path | None,
    file_option(
        help="Your own paints instead of the catalogue's, or with --catalogue added to them: a "
        "pigments.csv of `glazejax recover`. Yours have precedence where names are equal.",
    ),
]
OILS = "oils"
PIGMENTS = catalogue.PIGMENTS


def catalogue_option(default: str) -> Any:
    """``--catalogue``, with the catalogue that is taken where neither it nor own paints are named.

    Args:
        default: name of that catalogue.
    """
    return option(
        "--catalogue",
        metavar="NAME",
        callback=checked(catalogue.paint_families),
        help="Catalogue of paints: pigments (families, by many makers), or paints of one maker: "
        f"oils or acrylics (Golden heavy body). Default: {default}.",
    )


CatalogueName = Annotated[str | None, catalogue_option(OILS)]
REFERENCES = file_option(
    "--references",
    help="Your own reference paints, added to the catalogue's pigments: a table of reflectance, "
    "with a Colour Index number or a family in the names (PB29, ultramarine), or a column "
    "`family`. NAME_ob and NAME_ow are over cards, 'PB29 1:10 PW6' is a tint, others are "
    "opaque.",
)
Only = Annotated[
    str,
    option(
        metavar="NAMES",
        help="Only these paints, such as ZincWhite,Eosin, from another catalogue "
        "acrylics:TitaniumWhite, or families of pigments, such as 'azurite,smalt,ultramarine'.",
    ),
]
Without = Annotated[
    str,
    option(
        metavar="NAMES",
        help="All paints but these, such as LeadWhite,Minium.",
    ),
]
Quantity = Annotated[
    str | None,
    option(
        metavar="NAME",
        callback=checked(_quantity),
        help="reflectance: what the values are, whatever the file calls them.",
    ),
]
Unit = Annotated[
    str | None,
    option(
        metavar="UNIT",
        callback=checked(_unit),
        help="Unit, overriding the file: nm, um, 1/cm of wavelengths, percent or fraction of "
        "values, or one of each, 'um percent'.",
    ),
]
Scale = Annotated[
    float | None,
    option(
        metavar="NUMBER",
        callback=checked(lambda scale: stated(None, None, scale)),
        help="Number of a reflectance of 1, such as 100 or 10000, overriding the file.",
    ),
]
Samples = Annotated[
    str,
    option(
        metavar="NAMES",
        help="Only these samples of the file, such as 07A,11A.",
    ),
]
Illuminant = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=checked(check_illuminant),
        help="CIE illuminant of the colours: D65, D50, A, FL2, LED-B3, ...",
    ),
]
Observer = Annotated[
    str,
    typer.Option(
        metavar="DEGREES",
        callback=checked(_observer),
        help="CIE standard observer of the colours: 2 or 10 degrees.",
    ),
]
Tolerance = Annotated[
    float,
    typer.Option(callback=between(1e-12, 1.0), help="Largest error of a reflectance."),
]
Picture = Annotated[
    Path,
    typer.Option("--out", "-o", metavar="FILE", help="Picture to write: .png, .pdf, .svg or .jpg."),
]
PictureIfNamed = Annotated[
    Path | None,
    option(
        "--out",
        "-o",
        metavar="FILE",
        help="Also draw a picture: .png, .pdf, .svg or .jpg.",
    ),
]
Folder = Annotated[
    Path | None,
    option(
        "--out",
        "-o",
        metavar="FOLDER",
        help="Folder for the results, created if missing.",
    ),
]
Csv = Annotated[
    Path | None, option("--csv", metavar="FILE", help="Also write a table of the results.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")]
Seed = Annotated[
    int,
    typer.Option(
        callback=between(0),
        help="Seed of the random numbers. The same seed gives the same result.",
    ),
]


def instrument_option(default: str) -> Any:
    """``--instrument``, with what a command takes if it is left out."""
    return option(
        "--instrument",
        metavar="GEOMETRY",
        callback=checked(lambda words: split_geometry(words, "--instrument")),
        help="Instrument: d:8 or di:8 (integrating sphere, mirror reflection of the surface "
        "included), de:8 (excluded), 45:0, 0:45, or another ANGLE:ANGLE of light and view in "
        f"degrees (30:30:specular sees the mirror reflection). Default: {default}.",
    )


def ground_option(default: str = "") -> Any:
    """``--ground``, with what a command takes if it is left out."""
    return option(
        "--ground",
        metavar="GROUND",
        callback=checked(ground_level),
        help="Ground below the paint: its reflectance from inside the paint, 0 to 1, or a "
        f"file of spectra, FILE or FILE:SAMPLE.{f' Default: {default}.' if default else ''}",
    )


def stated(quantity: str | None, unit: str | None, scale: float | None) -> "Stated":
    """Values of ``--quantity``, ``--unit`` and ``--scale``, for readers of spectra.

    Raises:
        ValueError: a scale that is not positive or not finite.
    """
    if scale is not None and not 0 < scale < math.inf:
        raise ValueError(
            f"--scale is {scale:g}; it must be positive and finite, such as 100 for percent"
        )
    return {"quantity": quantity, "unit": unit, "scale": scale}


def split_names(text: str) -> list[str]:
    """Names of a list with commas."""
    return [name.strip() for name in text.split(",") if name.strip()]


def read_geometry(text: str | None, default: str) -> "Geometry":
    """The geometry of ``--instrument``.

    Args:
        text: of ``--instrument``; None if it was not given.
        default: what is taken then.

    Raises:
        ValueError: words that `glazejax.geometry.parse_geometry` refuses.
    """
    from ..geometry import parse_geometry

    return parse_geometry(default if text is None else text, argument="--instrument")


_LENGTH = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*([a-zµμ]*)"


def read_length(text: str, argument: str = "--thickness") -> float:
    """Metres of a length such as ``25um``, above 0 and at most 10 mm; a bare number is micrometres.

    Raises:
        ValueError: no length, a unit that is not known, or a length out of range.
    """
    match = re.fullmatch(_LENGTH, text.strip(), re.IGNORECASE)
    if match is None:
        raise ValueError(
            f"{argument} is {text!r}; write a number and a unit, such as 25um (or mm, nm, m)"
        )
    metres = float(match[1]) / _per_metre(match[2], argument, text)
    if not 0 < metres <= MAX_THICKNESS:
        raise ValueError(
            f"{argument} is {text}; it must be above 0 and at most 10 mm, such as 25um"
        )
    return metres


def read_lengths(text: str, argument: str, *, from_zero: bool = False) -> tuple[float, float]:
    """Metres of a range such as ``1-50um``; one length alone is both ends, and bare numbers are
    micrometres.

    Args:
        text: what was typed.
        argument: the option it was given as.
        from_zero: whether the range may begin at 0.

    Raises:
        ValueError: no range of lengths, a unit that is not known, or lengths out of range or order.
    """
    match = re.fullmatch(rf"{_LENGTH}(?:\s*-\s*{_LENGTH})?", text.strip(), re.IGNORECASE)
    if match is None:
        raise ValueError(
            f"{argument} is {text!r}; write the thinnest and the thickest, such as 1-50um"
        )
    low, low_unit, high, unit = match.groups()
    last = _per_metre(unit or low_unit, argument, text)
    first = _per_metre(low_unit, argument, text) if low_unit else last
    thinnest = float(low) / first
    thickest = float(high or low) / last
    legal = thinnest >= 0 if from_zero else thinnest > 0
    if not (legal and thickest > 0 and thinnest <= thickest <= MAX_THICKNESS):
        begin = "0" if from_zero else "above 0"
        raise ValueError(
            f"{argument} is {text}; it must ascend from {begin} to 10 mm at most, such as 1-50um"
        )
    return thinnest, thickest


def _per_metre(text: str, argument: str, length: str) -> int:
    """Number of units in a metre: a whole number, so that 25um is 25e-6 to the last digit."""
    scale = UNITS.get(text or "um", UNITS.get(text.lower()))
    if scale is None:
        raise ValueError(
            f"{argument} is {length!r}; the unit {text!r} is unknown: use um (or µm), mm, nm or m"
        )
    return round(1.0 / scale)


class Ground(NamedTuple):
    """A ground below paint.

    Attributes:
        level: internal reflectance in [0, 1], a number or a spectrum.
        words: what the ground is, for people.
        notes: sentences of the reader.
        file: that it was read from, for errors.
    """

    level: "float | Spectrum"
    words: str
    notes: tuple[str, ...] = ()
    file: str = ""

    def on(self, grid: "Float[np.ndarray, 'other']") -> "float | Float[np.ndarray, 'other']":
        """Reflectance on other wavelengths (nm), which the ground's must cover.

        Raises:
            ValueError: they do not; the message names the ground's file.
        """
        if isinstance(self.level, int | float):
            return self.level
        with self.blame():
            return self.level.on(grid)

    @contextmanager
    def blame(self) -> Iterator[None]:
        """Name the ground's file in the errors of what is refused inside, if it has one."""
        from ..io.source import refusal

        try:
            yield
        except ValueError as error:
            if not self.file:
                raise
            raise refusal(self.file, f"the ground: {error}") from None


def ground_level(text: str) -> float | None:
    """The number from 0 to 1 that stands for a ground, or None for a file of its spectrum.

    Raises:
        FileNotFoundError, ValueError: as `read_ground`.
    """
    try:
        reflectance = float(text)
    except ValueError:
        missing = f"--ground {text!r} is neither a number from 0 to 1, such as 0.9, nor a file"
        existing(Path(text), missing)
        return None
    if not 0 <= reflectance <= 1:
        hint = (
            f" ({reflectance:g} looks like percent: write {reflectance / 100:g})"
            if 2 <= reflectance <= 100
            else ""
        )
        raise ValueError(f"--ground is {text}; reflectance lies between 0 and 1{hint}")
    return reflectance


def read_ground(text: str, *, bare: bool = False) -> Ground:
    """Read a ground: a number from 0 to 1, or a spectrum FILE or FILE:SAMPLE.

    Args:
        text: what was typed.
        bare: the values are readings of the bare ground in air, which a bright one may bring above
            1.

    Raises:
        FileNotFoundError: neither a number nor a file.
        ValueError: a number or a spectrum out of range, or what `glazejax.io.read_sample` refuses.
    """
    reflectance = ground_level(text)
    if reflectance is not None:
        return Ground(reflectance, f"reflectance {reflectance:g}")
    from ..io import read_sample
    from ..io.files.sample import split_sample
    from ..stacks import Spectrum

    path, _ = split_sample(text)
    table = read_sample(text, argument="--ground")
    sample = table.names[0]
    spectrum = table.reflectance[0]
    notes = [f"{path}: {note}" for note in table.notes]
    if not bare:
        if spectrum.max() > 1:
            brightest = int(spectrum.argmax())
            raise ValueError(
                f"{path}: {sample!r} reflects {spectrum[brightest]:.3g} at "
                f"{table.wavelengths[brightest]:g} nm; a ground reflects 1 at most: scale the "
                "spectrum"
            )
        notes.append(
            "the ground's spectrum is taken as its reflectance seen from inside the paint, not "
            "from air"
        )
    return Ground(
        Spectrum(table.wavelengths, spectrum),
        f"{sample} ({path.name}, mean {spectrum.mean():.2f})",
        tuple(notes),
        str(path),
    )


def read_shelf(path: Path | None, name: str | None = None) -> "dict[str, Pigment]":
    """Paints of ``--pigments``, of the catalogue that ``--catalogue`` names, or of both.

    Where both have a name, the own paint is taken, and that is said.

    Args:
        path: of own paints, or None.
        name: of a catalogue; None is the oils, or with own paints no catalogue.

    Raises:
        ValueError: there is no catalogue of that name, or the file is no table of paints.
    """
    from ..paint.pigment_table import read_pigments

    shelf = {} if path is not None and name is None else dict(catalogue.load(name or OILS))
    own_paints = {} if path is None else dict(read_pigments(path))
    if names_twice := [paint for paint in own_paints if paint in shelf]:
        typer.echo(
            f"note: {', '.join(names_twice)}: that of {path} is taken, not of {name}", err=True
        )
    return shelf | own_paints


def say_asked(
    paints: "Sequence[Pigment]", name: str | None, own_file: Path | None, *, by_family: bool
) -> str:
    """Print which catalogue an answer is from, and what the other kind is for: the last line of an
    answer.

    Args:
        paints: of the search.
        name: of the catalogue; None with own paints alone.
        own_file: file of these.
        by_family: whether families of pigments were searched.
    """
    shelves = " and ".join(str(shelf) for shelf in (own_file, name) if shelf is not None)
    if by_family:
        families = len({paint.family for paint in paints})
        sources = len({paint.source for paint in paints})
        return (
            f"Asked: {shelves}, {families} families in paints of {sources} sources, for paint by "
            f"anybody. --catalogue {OILS} asks for films (amounts, thickness) of one painter's 20 "
            "oils."
        )
    other = f"--catalogue {PIGMENTS}" if name != PIGMENTS else "A search without --own-films"
    return (
        f"Asked: {shelves}, {len(paints)} paints, for films by their maker alone. {other} asks "
        "which pigments are in paint by anybody."
    )


def choose_paints(
    shelf: "Mapping[str, Pigment]", only: str = "", without: str = ""
) -> "list[Pigment]":
    """Paints of a shelf that ``--only`` names, or all, but those that ``--without`` names.

    Raises:
        ValueError: a name that neither the shelf nor a catalogue has, or no paint is left.
    """
    chosen = find_paints(split_names(only), shelf) or shelf
    left_out = find_paints(split_names(without), shelf)
    remaining = [paint for name, paint in chosen.items() if name not in left_out]
    if not remaining:
        raise ValueError("--only and --without leave no paint: name fewer in --without")
    return remaining


def find_paints(names: Iterable[str], shelf: "Mapping[str, Pigment]") -> "dict[str, Pigment]":
    """Paints that are meant, by their full names: of a shelf, or of any catalogue with one of its
    own grid, such as ``acrylics:TitaniumWhite``; or by a family, all of the shelf's paints of it.

    Raises:
        ValueError: a name that none of them has; the message names the nearest.
    """
    shelves = all_named(shelf)
    matches = []
    for name in names:
        of_family = [paint for paint in shelf.values() if same_name(paint.family, name)]
        matches += of_family or [shelves[_full_name(name, shelves)]]
    from_elsewhere = any(paint.name not in shelf for paint in matches)
    if from_elsewhere and len(set(filter(None, map(catalogue.assumed_scale, matches)))) > 1:
        typer.echo(
            "note: each catalogue assumes its own scale of length, so amounts of its paints "
            "relative to another's may have a common factor",
            err=True,
        )
    return {paint.name: paint for paint in matches}


def check_names(names: Iterable[str], pigments: Path | None, shelf: str | None) -> None:
    """Refuse the name of a paint that `find_paints` would not find on the shelf of `--pigments` and
    `--catalogue`, before a paint is read.

    Raises:
        ValueError: as `find_paints`.
    """
    known: list[str] = []
    families: dict[str, str] = {}
    if shelf is not None or pigments is None:
        families = catalogue.paint_families(shelf or OILS)
        known += families
    if pigments is not None:
        # What comes through a pipe can be read once only, and by whom reads it whole.
        if not pigments.is_file():
            return
        try:
            known += _names_in(pigments)
        except (KeyError, csv.Error):
            # What is wrong with the table is said where it is read whole.
            return
    for other in catalogue.names():
        known += [f"{other}:{name}" for name in catalogue.paint_families(other)]
    known += filter(None, families.values())
    for name in names:
        _full_name(name, known)


def _names_in(pigments: Path) -> list[str]:
    """Names in a table of paints, without the modules that `read_pigments` needs.

    Raises:
        KeyError: there is no column of names.
        csv.Error, OSError, ValueError: it cannot be read, or is not text.
    """
    from ..io.source import open_source
    from ..io.words import unshield_name

    with open_source(pigments) as source:
        lines = (line for _, line in source.lines() if line.strip() and not line.startswith("#"))
        rows = csv.reader(lines)
        titles = [title.strip() for title in next(rows, [])]
        if "pigment" not in titles:
            raise KeyError("pigment")
        column = titles.index("pigment")
        cells = (row[column].strip() for row in rows if len(row) > column)
        return list(dict.fromkeys(map(unshield_name, cells)))


def check_coats(text: str, pigments: Path | None, shelf: str | None = None) -> None:
    """Refuse coats that cannot be read, or of paints that there are not: own ones lie before a
    catalogue's here.

    Raises:
        ValueError: see `glazejax.paint.describe.parse_coats` and `find_paints`.
    """
    named = [name for coat in parse_coats(text) for _, name in coat.parts]
    check_names(named, pigments, shelf or OILS)


def _full_name(name: str, all_names: Iterable[str]) -> str:
    """The one of the known names that is meant.

    Raises:
        ValueError: none of them, but perhaps a family of pigments.
    """
    try:
        return find_name(name, all_names)
    except ValueError as error:
        if ALL_NAMES in str(error):
            for family in catalogue.families():
                if same_name(family, name):
                    raise ValueError(
                        f"there is no pigment {name!r} here: {family} is a family of --catalogue "
                        f"{PIGMENTS}"
                    ) from None
        raise


def all_named(shelf: "Mapping[str, Pigment]") -> "dict[str, Pigment]":
    """A shelf, and behind it each paint of each catalogue as ``CATALOGUE:NAME``."""
    shelves = dict(shelf)
    for name_of_catalogue in catalogue.names():
        for name, paint in catalogue.load(name_of_catalogue).items():
            full = f"{name_of_catalogue}:{name}"
            same = name in shelf and shelf[name].provenance == paint.provenance
            shelves[full] = shelf[name] if same else paint.renamed(full)
    return shelves


def choose_rows(file: Path, names: Sequence[str], asked: Sequence[str]) -> list[int]:
    """Rows of the spectra of a file that ``--samples`` names, or all.

    Raises:
        ValueError: the file has no spectrum of that name.
    """
    from ..io.spectra_table import row_of

    rows = [row_of(names, name, f"--samples: {file}") for name in asked]
    return rows or list(range(len(names)))


def check_outputs(
    files: Mapping[str, Path | None],
    overwrite: bool,
    *,
    pictures: Sequence[str] = ("--out",),
    inputs: Sequence[Path | None] = (),
) -> None:
    """Refuse what could not be written in the end, before anything is computed.

    Args:
        files: option -> file; None where none is written.
        overwrite: whether files that exist may be replaced.
        pictures: options that name pictures.
        inputs: files that are read, which no result may replace.

    Raises:
        ValueError: a picture's ending, two options that name the same file, or a file that is read.
        FileExistsError, FileNotFoundError, IsADirectoryError: see
        `glazejax.io.outputs.check_output`. ModuleNotFoundError: a picture is wanted, and matplotlib
        is not installed.
    """
    from ..extras import require
    from ..io.outputs import check_output
    from ..io.source import split_sheet
    from ..plots import check_ending

    option_of: dict[Path, str] = {}
    # A sheet is of a file, too.
    read = {split_sheet(path)[0].resolve() for path in inputs if path is not None}
    for option, path in files.items():
        if path is None:
            continue
        same = option_of.setdefault(path.resolve(), option)
        if same != option:
            raise ValueError(
                f"{option} and {same} are both {path}, the same file: give them different names"
            )
        if path.resolve() in read:
            raise ValueError(
                f"{option} is {path}, a file that is read: give the result another name"
            )
        if option in pictures:
            require("matplotlib")
            check_ending(path, argument=option)
    # A refusal above leaves no folder behind.
    for option, path in files.items():
        if path is None:
            continue
        # What cannot be made is said below.
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
        check_output(path, overwrite=overwrite, argument=option)


# Of single files, which a user may expect in place of a folder.
_FILE_ENDINGS = (".csv", ".html", ".json", ".nc", ".pdf", ".png", ".svg", ".tsv")


def check_folder(
    out: Path | None,
    overwrite: bool,
    *,
    instead: str = "",
    argument: str = "--out",
    inputs: Sequence[Path | None] = (),
) -> Path:
    """The folder for the results, if they may be written there.

    Args:
        out: the folder.
        overwrite: whether it may hold something.
        instead: what else is possible.
        argument: what the folder was given as.
        inputs: files that are read, which no result may replace.

    Raises:
        ValueError: no folder was named, a name that ends as a file's does, or a file that is read
            lies there.
        FileExistsError: it is a file, or a folder that is not empty.
    """
    if out is None:
        raise ValueError(f"say where the results go: {argument} FOLDER")
    if out.exists() and not out.is_dir():
        raise FileExistsError(f"{argument} {out} is a file; name a folder")
    if not out.exists() and out.suffix.lower() in _FILE_ENDINGS:
        raise ValueError(
            f"{argument} {out}: several files are written; name a folder for them, such as "
            f"{out.with_suffix('')}"
        )
    if out.is_dir() and any(out.iterdir()) and not overwrite:
        raise FileExistsError(
            f"the folder {out} exists and is not empty; choose another{instead}, or add --overwrite"
        )
    for path in inputs:
        if path is not None and path.resolve().parent == out.resolve():
            raise ValueError(
                f"{argument} {out} holds {path.name}, a file that is read and that a result might "
                "replace: name another folder"
            )
    return out
