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

from ..finish import RawSpectra
from ..quantity import meaning
from ..source import NumberedLine, Source
from ..spectra_table import Bands
from ..words import finite_number, is_number, read_number

_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
# Any other letter is an empty number, and no blank is.
_PACKED = re.compile(r"\s*(?=\S)([@A-Ia-i%J-Rj-rS-Zs+-]?)(\d*\.?\d*)")
_FIRST = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+))")
_DIGITS = (*range(10), *range(-1, -10, -1))
_SQUEEZED = dict(zip("@ABCDEFGHIabcdefghi", _DIGITS, strict=True))
_DIFFERENCE = dict(zip("%JKLMNOPQRjklmnopqr", _DIGITS, strict=True))
_REPEATED = dict(zip("STUVWXYZs", range(1, 10), strict=True))
# E and e may be exponents; any other letter of these is a squeezed digit.
_PACKING = {*_SQUEEZED, *_DIFFERENCE, *_REPEATED} - {"E", "e"}
# Repetitions cost a file nothing; a spectrometer has thousands of points.
_MAX_POINTS = 1_000_000


_COUNTED = ("FIRSTX", "LASTX", "NPOINTS", "XFACTOR", "YFACTOR", "XUNITS", "YUNITS")


@dataclass
class _Block:
    """Labels of a block, in capitals without blanks, and its lines of data with their numbers."""

    source: Source
    labels: dict[str, str] = field(default_factory=dict)
    data: list[NumberedLine] = field(default_factory=list)
    form: str = ""

    @property
    def name(self) -> str:
        return self.labels["TITLE"]

    def damaged(self, complaint: str, line: int | None = None) -> ValueError:
        return self.source.error(f"{self.name!r} is damaged: {complaint}", line)

    def number(self, label: str, otherwise: float = np.nan) -> float:
        """Number of a label; a decimal comma is understood."""
        text = self.labels.get(label)
        if text is None:
            return otherwise
        value = finite_number(text.replace(",", ".", 1))
        if value is None:
            raise self.damaged(f"##{label}={text[:30]} is not a finite number")
        return value

    def check_count(self, count: int) -> None:
        """Refuse a file that was cut short."""
        promised = self.number("NPOINTS", count)
        if promised != count:
            cause = "the file was cut short"
            if count > promised:
                cause = "are its decimal points commas? write points"
            raise self.source.error(
                f"{self.name!r} promises {promised:.10g} points and holds {count}; {cause}"
            )


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
    for number, block in enumerate(blocks, start=1):
        block.labels["TITLE"] = block.name or f"block {number}"
    grids, values = zip(*map(_spectrum, blocks), strict=True)
    names = [block.name for block in blocks]
    units = [block.labels.get("YUNITS", "") or "no YUNITS" for block in blocks]
    for unit in units:
        if meaning(unit) != meaning(units[0]):
            raise source.error(
                f"some blocks are in {units[0]!r} and some in {unit!r}; bring all to one unit"
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
            block = _Block(source)
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
        elif label in _COUNTED and block.labels.get(label, value) != value:
            raise source.error(
                f"##{label}= stands there twice and differs; the block is damaged", number
            )
        else:
            block.labels[label] = value
    if block is not None and block.form:
        raise source.error("the last block has no ##END=; the file was cut short")
    return blocks


def _spectrum(block: _Block) -> tuple[Bands, Bands]:
    """Abscissas and values of a block."""
    forms = {"(XY..XY)": _pairs, "(X++(Y..Y))": _steps}
    if block.form not in forms:
        raise block.damaged(f"its data are {block.form!r}, not (XY..XY) or (X++(Y..Y))")
    x, y = forms[block.form](block)
    if not x.size:
        raise block.source.error(f"{block.name!r} holds no points")
    return x, y * block.number("YFACTOR", 1.0)


def _pairs(block: _Block) -> tuple[Bands, Bands]:
    """Points that are written with both coordinates."""
    numbers = array("d")
    for line, text in block.data:
        words = re.findall(r"[^,;\s]+", text)
        if len(words) % 2 or not all(map(is_number, words)):
            raise block.damaged(f"{text[:40]!r} are not pairs of numbers", line)
        numbers.extend(map(read_number, words))
    x, y = np.array(numbers).reshape(-1, 2).T
    block.check_count(x.size)
    return x * block.number("XFACTOR", 1.0), y


def _steps(block: _Block) -> tuple[Bands, Bands]:
    """Ordinates at equal steps; the abscissa that begins each line only checks them."""
    first, last, promised = map(block.number, ("FIRSTX", "LASTX", "NPOINTS"))
    if np.isnan([first, last, promised]).any():
        raise block.damaged("it lacks ##FIRSTX=, ##LASTX= or ##NPOINTS=")
    factor = block.number("XFACTOR", 1.0)
    step = (last - first) / (promised - 1) if promised > 1 else 0.0
    packed = any(_PACKING.intersection(text) for _, text in block.data)
    values = array("d")
    wrong = None
    # whether the line above ended in a difference, and its last ordinate begins the next line
    differs = False
    for line, text in block.data:
        try:
            word, row, ends_so = _unpack(text) if packed else _plain(text)
        except (ValueError, IndexError):
            raise block.damaged(f"{text[:40]!r} are not an abscissa and ordinates", line) from None
        x = float(word)
        at = len(values)
        if differs:
            at -= 1
            if row[:1] != values[-1:]:
                raise block.damaged(f"the line does not begin with {values[-1]:g}", line)
            row = row[1:]
        # Abscissas may be rounded or cut to the digits they have.
        last_digit = 10.0 ** -_decimals(word) * abs(factor)
        if abs(x * factor - (first + at * step)) > 0.5 * abs(step) + last_digit:
            wrong = wrong or block.damaged(
                f"the line begins at {x:g}, not {first + at * step:g}", line
            )
        values.extend(row)
        differs = ends_so
        if len(values) > min(promised, _MAX_POINTS):
            break
    block.check_count(len(values))
    if wrong:
        raise wrong
    return np.linspace(first, last, len(values)), np.array(values)


def _plain(text: str) -> tuple[str, array, bool]:
    """Abscissa as it stands, and ordinates of a line of plain numbers, which a sign may part.

    Raises:
        ValueError, IndexError: the line is damaged.
    """
    words = _PLAIN.findall(text)
    if re.sub(r"[\s,;]", "", _PLAIN.sub("", text)):
        raise ValueError(text)
    return words[0], array("d", map(float, words[1:])), False


def _unpack(text: str) -> tuple[str, array, bool]:
    """The same of a line of packed numbers, and whether it ends in a difference."""
    begin = _FIRST.match(text)
    if begin is None:
        raise ValueError(text)
    values = array("d")
    differs = False
    change = 0.0
    for sign, digits in _PACKED.findall(text, begin.end()):
        if sign in _REPEATED:
            count = int(f"{_REPEATED[sign]}{digits}")
            if count > _MAX_POINTS:
                raise ValueError(text)
            for _ in range(count - 1):
                values.append(values[-1] + change)
            continue
        differs = sign in _DIFFERENCE
        change = float(f"{_DIFFERENCE[sign]}{digits}") if differs else 0.0
        values.append(
            values[-1] + change if differs else float(f"{_SQUEEZED.get(sign, sign)}{digits}")
        )
    return begin[1], values, differs


def _decimals(word: str) -> int:
    """Digits after the point of a number; fewer than none if it has an exponent."""
    number, _, exponent = word.lower().partition("e")
    return max(-300, min(300, len(number.partition(".")[2]) - int(exponent[:6] or 0)))
