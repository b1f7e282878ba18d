"""JCAMP-DX (4.24 and 5): one or many spectra as text.

After McDonald and Wilks, Applied Spectroscopy 42, 151 (1988): ordinates as plain numbers (AFFN,
PAC) or squeezed (SQZ), as differences (DIF) and with repetitions counted (DUP). What the file says
of itself is held against its data: the number of points, the abscissa that begins each line, and
the ordinate that a line of differences repeats.
"""

import re
from array import array
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ..finish import RawSpectra
from ..quantity import meaning
from ..source import Source
from ..words import read_number

_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_PACKED = re.compile(r"\s*([@A-Ia-i%J-Rj-rS-Zs+-]?)(\d*\.?\d*)")
_FIRST = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+))")
_SQUEEZED = {letter: f"+{i}" for i, letter in enumerate("@ABCDEFGHI")} | {
    letter: f"-{i}" for i, letter in enumerate("abcdefghi", start=1)
}
_DIFFERENCE = {letter: f"{i}" for i, letter in enumerate("%JKLMNOPQR")} | {
    letter: f"-{i}" for i, letter in enumerate("jklmnopqr", start=1)
}
_REPEATED = {letter: f"{i}" for i, letter in enumerate("STUVWXYZs", start=1)}
# E and e may be exponents; any other letter of these is a squeezed digit.
_PACKING = frozenset({*_SQUEEZED, *_DIFFERENCE, *_REPEATED} - {"E", "e"})
# Repetitions cost a file nothing; a spectrometer has thousands of points.
_MAX_POINTS = 1_000_000


@dataclass
class _Block:
    """Labels of a block, in capitals without blanks, and its lines of data with their numbers."""

    labels: dict[str, str] = field(default_factory=dict)
    data: list[tuple[int, str]] = field(default_factory=list)
    form: str = ""


def read_jcamp(source: Source) -> RawSpectra:
    """Read the reflectance spectra of a JCAMP-DX file; blocks, linked or merely one after another,
    are rows.

    X may be in nanometres, micrometres or 1/cm. Y must be reflectance, as a fraction or percent.

    Raises:
        ValueError: a block without ##END= (a file cut short), without data, damaged, with another
            number of points than it promises, or in other units or on other wavelengths than the
            first.
    """
    blocks = _blocks(source)
    if not blocks:
        raise source.error("JCAMP-DX without data: no ##XYDATA= or ##XYPOINTS=")
    found = [_spectrum(source, number, block) for number, block in enumerate(blocks, start=1)]
    names, grids, values = zip(*found, strict=True)
    units = [block.labels.get("YUNITS", "") or "no YUNITS" for block in blocks]
    other = next((unit for unit in units if meaning(unit) != meaning(units[0])), units[0])
    if other != units[0]:
        raise source.error(
            f"some blocks are in {units[0]!r} and some in {other!r}; bring all to one unit"
        )
    for name, grid in zip(names, grids, strict=True):
        if grid.shape != grids[0].shape or not np.allclose(grid, grids[0], rtol=1e-9):
            raise source.error(
                f"block {name!r} is on other wavelengths than {names[0]!r}; a table has one "
                "grid: split it"
            )
    return RawSpectra(
        wavelengths=grids[0],
        names=names,
        values=np.array(values),
        format="JCAMP-DX",
        wavelength_unit=blocks[0].labels.get("XUNITS", ""),
        quantity=units[0],
    )


def _blocks(source: Source) -> list[_Block]:
    """Blocks that have data; wrappers that only link blocks are passed over."""
    blocks: list[_Block] = []
    block = None
    inside = False
    for number, line in enumerate(source.text().splitlines(), start=1):
        text = line.partition("$$")[0].strip()
        if not text.startswith("##"):
            if block is not None and inside and text:
                block.data.append((number, text))
            continue
        label, equals, value = text[2:].partition("=")
        label = re.sub(r"[\s/_-]", "", label).upper()
        value = value.strip()
        if label == "TITLE":
            if block is not None and block.form:
                raise source.error("a block begins before the one above has its ##END=", number)
            block = _Block()
        if block is None:
            continue
        # Labels of a maker's own begin with $, and need no value.
        if not equals and not label.startswith("$"):
            raise source.error(f"the block is damaged: {text[:40]!r} has no =", number)
        inside = label in ("XYDATA", "XYPOINTS")
        if inside:
            if block.form:
                raise source.error("a second table of data in one block; split the file", number)
            block.form = value.replace(" ", "").upper()
        elif label == "END":
            if block.form:
                blocks.append(block)
            block = None
        elif label in block.labels and block.labels[label] != value and label in _COUNTED:
            raise source.error(
                f"##{label}= stands there twice and differs; the block is damaged", number
            )
        else:
            block.labels[label] = value
    if block is not None and block.form:
        raise source.error("the last block has no ##END=; the file was cut short")
    return blocks


_COUNTED = ("FIRSTX", "LASTX", "NPOINTS", "XFACTOR", "YFACTOR", "XUNITS", "YUNITS")


def _spectrum(
    source: Source, number: int, block: _Block
) -> tuple[str, Float[np.ndarray, "bands"], Float[np.ndarray, "bands"]]:
    """Name, abscissas and values of a block."""
    name = block.labels.get("TITLE", "") or f"block {number}"
    if block.form == "(XY..XY)":
        x, y = _pairs(source, name, block)
    elif block.form == "(X++(Y..Y))":
        x, y = _steps(source, name, block)
    else:
        raise source.error(
            f"{name!r} is damaged: its data are {block.form!r}, not (XY..XY) or (X++(Y..Y))"
        )
    if x.size == 0:
        raise source.error(f"{name!r} holds no points")
    return name, x, y * _factor(source, name, block, "YFACTOR")


def _label(source: Source, name: str, block: _Block, label: str) -> float | None:
    """Number of a label; a decimal comma is understood."""
    text = block.labels.get(label)
    if text is None:
        return None
    try:
        value = read_number(text.replace(",", ".", 1))
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise source.error(f"{name!r} is damaged: ##{label}={text[:30]} is not a finite number")
    return value


def _factor(source: Source, name: str, block: _Block, label: str) -> float:
    value = _label(source, name, block, label)
    return 1.0 if value is None else value


def _check_count(source: Source, name: str, promised: float | None, count: int) -> None:
    """Refuse a file that was cut short."""
    if promised is not None and promised != count:
        raise source.error(
            f"{name!r} promises {promised:.10g} points and holds {count}; the file was cut short"
        )


def _pairs(
    source: Source, name: str, block: _Block
) -> tuple[Float[np.ndarray, "points"], Float[np.ndarray, "points"]]:
    """Points that are written with both coordinates."""
    numbers = array("d")
    for line, text in block.data:
        words = [word for word in re.split(r"[,;\s]", text) if word]
        try:
            numbers.extend(array("d", map(read_number, words)))
        except ValueError:
            raise source.error(
                f"{name!r} is damaged: {text[:40]!r} are not pairs of numbers", line
            ) from None
        if len(words) % 2:
            raise source.error(f"{name!r} is damaged: {text[:40]!r} are not pairs of numbers", line)
    x, y = np.frombuffer(numbers).reshape(-1, 2).T if numbers else (np.empty(0), np.empty(0))
    _check_count(source, name, _label(source, name, block, "NPOINTS"), x.size)
    return x * _factor(source, name, block, "XFACTOR"), y


def _steps(
    source: Source, name: str, block: _Block
) -> tuple[Float[np.ndarray, "points"], Float[np.ndarray, "points"]]:
    """Ordinates at equal steps; the abscissa that begins each line only checks them."""
    first, last, promised = (
        _label(source, name, block, label) for label in ("FIRSTX", "LASTX", "NPOINTS")
    )
    if first is None or last is None or promised is None:
        raise source.error(f"{name!r} is damaged: it lacks ##FIRSTX=, ##LASTX= or ##NPOINTS=")
    factor = _factor(source, name, block, "XFACTOR")
    step = (last - first) / (promised - 1) if promised > 1 else 0.0
    packed = any(_PACKING.intersection(text) for _, text in block.data)
    values = array("d")
    wrong = None
    # whether the line above ended in a difference, and its last ordinate begins the next line
    differs = False
    for line, text in block.data:
        x, digits, row, ends_so = _unpack(text) if packed else _plain(text)
        if row is None:
            raise source.error(
                f"{name!r} is damaged: {text[:40]!r} are not an abscissa and ordinates", line
            )
        at = len(values)
        if differs and values:
            at -= 1
            if row[:1] != values[-1:]:
                raise source.error(
                    f"{name!r} is damaged: the line does not begin with {values[-1]:g}", line
                )
            row = row[1:]
        # Abscissas may be rounded or cut to the digits they have.
        if abs(x * factor - (first + at * step)) > 0.5 * abs(step) + 10.0**-digits * abs(factor):
            wrong = wrong or (
                f"{name!r} is damaged: the line begins at {x:g}, not {first + at * step:g}",
                line,
            )
        values.extend(row)
        differs = ends_so
        if len(values) > min(promised, _MAX_POINTS):
            break
    _check_count(source, name, promised, len(values))
    if wrong:
        raise source.error(*wrong)
    return np.linspace(first, last, len(values)), np.frombuffer(values)


def _plain(text: str) -> tuple[float, int, array | None, bool]:
    """Abscissa, its decimals, and ordinates of a line of plain numbers, which a sign may part; None
    if damaged.
    """
    words = _PLAIN.findall(text)
    if not words or re.sub(r"[\s,;]", "", _PLAIN.sub("", text)):
        return 0.0, 0, None, False
    return float(words[0]), _decimals(words[0]), array("d", map(float, words[1:])), False


def _unpack(text: str) -> tuple[float, int, array | None, bool]:
    """The same of a line of packed numbers, and whether it ends in a difference."""
    begin = _FIRST.match(text)
    if begin is None:
        return 0.0, 0, None, False
    values = array("d")
    differs = False
    change = 0.0
    at = begin.end()
    while at < len(text):
        match = _PACKED.match(text, at)
        if match is None or match.end() == at or not (match[1] or match[2]):
            return 0.0, 0, None, False
        sign = match[1]
        digits = match[2]
        try:
            if sign in _REPEATED and sign:
                count = int(_REPEATED[sign] + digits)
                if not values or count > _MAX_POINTS:
                    return 0.0, 0, None, False
                for _ in range(count - 1):
                    values.append(values[-1] + change)
            elif sign in _DIFFERENCE and sign:
                if not values:
                    return 0.0, 0, None, False
                differs = True
                change = float(_DIFFERENCE[sign] + digits)
                values.append(values[-1] + change)
            else:
                differs = False
                change = 0.0
                values.append(float(_SQUEEZED.get(sign, sign) + digits))
        except ValueError:
            return 0.0, 0, None, False
        at = match.end()
    return float(begin[1]), _decimals(begin[1]), values, differs


def _decimals(word: str) -> int:
    """Digits after the point of a number; fewer than none if it has an exponent."""
    number, _, exponent = word.lower().partition("e")
    return max(-300, min(300, len(number.partition(".")[2]) - int(exponent[:6] or 0)))
