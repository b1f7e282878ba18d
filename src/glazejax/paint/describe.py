"""The words a painter types for a glaze, such as ``Eosin:5um x3,
0.7*ZincWhite+0.3*CobaltBlue:20um``.

Nothing here knows optics: text becomes `Coat`s, and names become pigments of a shelf (any mapping).
"""

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple, TypeAlias

from ..io.source import is_there
from ..names import nearest_names

WeightedPaints: TypeAlias = tuple[tuple[float, str], ...]
"""(weight, name) of each paint of a coat."""

MAX_THICKNESS = 0.01
"""Of a coat, m."""
UNITS = {"nm": 1e-9, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mm": 1e-3, "m": 1.0}
"""Metres in each unit of length; both Unicode letters for micro are understood."""

_EXAMPLE = "such as UltramarineBlue:12um"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_SIZE = re.compile(rf"^({_NUMBER})\s*([A-Za-zµμ]*)\s*(.*)$")
_REPEATS = re.compile(r"^[x×]\s*(\S+)$", re.IGNORECASE)


class Coat(NamedTuple):
    """One entry of a description: a paint, how thick one coat of it is, and how many coats.

    Attributes:
        parts: (weight, name of a pigment), one for a pure paint.
        thickness: of one coat, m.
        repeats: number of equal coats, at least 1.
    """

    parts: WeightedPaints
    thickness: float
    repeats: int

    @property
    def name(self) -> str:
        """Name of the paint, such as ``0.7 ZincWhite + 0.3 CobaltBlue``."""
        if len(self.parts) == 1:
            return self.parts[0][1]
        return " + ".join(f"{weight:g} {name}" for weight, name in self.parts)

    @property
    def total(self) -> float:
        """Thickness of all coats together, m."""
        return self.thickness * self.repeats

    @property
    def size(self) -> str:
        """Thickness in words, such as ``12 µm`` or ``3 x 5 µm``."""
        coat_size = format_length(self.thickness)
        return coat_size if self.repeats == 1 else f"{self.repeats} x {coat_size}"


def format_length(metres: float) -> str:
    """A thickness in the unit that painters would use: nm below 0.1 µm, mm from 1 mm."""
    if metres >= 1e-3:
        return f"{metres * 1e3:.4g} mm"
    return f"{metres * 1e6:.4g} µm" if metres >= 1e-7 or metres == 0 else f"{metres * 1e9:.4g} nm"


def parse_coats(text: str) -> tuple[Coat, ...]:
    """Read the description of a stack.

    Args:
        text: coats separated by commas, top first, each ``PAINT:THICKNESS`` with a unit (nm, um,
            µm, mm, m) and optionally ``x3`` for three equal coats. PAINT is a name, or a mixture
            ``0.7*ZincWhite+0.3*CobaltBlue`` with fractions that sum to 1. Blanks do not matter.

    Returns:
        At least one coat, top first. A thickness of 0 is legal: an absent coat.

    Raises:
        ValueError: text that does not read as above; the message quotes the entry and says what to
            write.
    """
    if ";" in text:
        raise ValueError(
            f"there is a semicolon in {text!r}: coats are separated by commas, {_EXAMPLE}"
        )
    if not text.strip():
        raise ValueError(f"the list of coats is empty: write coats from top to bottom, {_EXAMPLE}")
    return tuple(_coat(entry.strip(), text) for entry in text.split(","))


def names_file(text: str) -> bool:
    """Test whether a text that says what the coats are is the path of a stack's file."""
    return text.lower().endswith(".json") or is_there(text)


def _coat(entry: str, text: str) -> Coat:
    if not entry:
        raise ValueError(f"there is an empty coat in {text!r}: remove the comma too many")
    paint, colon, size = (piece.strip() for piece in entry.rpartition(":"))
    if not colon:
        hint = (
            " (a decimal comma? write 12.5um)" if re.fullmatch(r"\d+\s*[A-Za-zµμ]+", entry) else ""
        )
        raise ValueError(
            f"coat {entry!r} has no thickness: write paint:thickness, {_EXAMPLE}{hint}"
        )
    if not paint:
        raise ValueError(f"coat {entry!r} names no paint: write paint:thickness, {_EXAMPLE}")
    if not size:
        raise ValueError(f"coat {entry!r} has no thickness after the colon: write {paint}:12um")
    thickness, repeats = _size(entry, size)
    return Coat(_parts(entry, paint), thickness, repeats)


def _size(entry: str, size: str) -> tuple[float, int]:
    """Thickness in m and number of coats."""
    match = _SIZE.match(size)
    if match is None:
        raise ValueError(
            f"coat {entry!r}: {size!r} is not a thickness: write a number and a unit, like 12um"
        )
    number, unit, repeats_text = match.groups()
    # In '12 x3' the unit is missing, and the x belongs to the repeats.
    if unit.lower().startswith("x"):
        unit, repeats_text = "", f"{unit}{repeats_text}"
    if not unit:
        raise ValueError(
            f"coat {entry!r}: the thickness {number} has no unit: write {number}um, mm or nm"
        )
    # In '12umx3' the x of the repeats sticks to the unit.
    if unit.lower().endswith("x") and unit.lower()[:-1] in UNITS:
        unit = unit[:-1]
        repeats_text = f"x{repeats_text}"
    scale = UNITS.get(unit.lower())
    if scale is None:
        raise ValueError(
            f"coat {entry!r}: the unit {unit!r} is unknown: use um (or µm), mm, nm or m"
        )
    repeats = _count(entry, repeats_text) if repeats_text else 1
    thickness = float(number) * scale
    if thickness < 0:
        raise ValueError(
            f"coat {entry!r}: the thickness {number}{unit} is negative: it must be 0 or more"
        )
    if not thickness * repeats <= MAX_THICKNESS:
        raise ValueError(
            f"coat {entry!r} is {format_length(thickness * repeats)} thick: at most "
            f"{format_length(MAX_THICKNESS)} is possible; a glaze has some micrometres, written um"
        )
    return thickness, repeats


def _count(entry: str, repeats_text: str) -> int:
    match = _REPEATS.match(repeats_text)
    if match is None:
        raise ValueError(
            f"coat {entry!r}: cannot read {repeats_text!r} after the thickness: repeats are "
            "written x3"
        )
    count = match.group(1)
    if not count.isdecimal() or int(count) < 1:
        raise ValueError(
            f"coat {entry!r}: the number of coats {count!r} must be a whole number from 1, as x3"
        )
    return int(count)


def _parts(entry: str, paint: str) -> WeightedPaints:
    """Weights and names of a paint or a mixture."""
    terms = [term.strip() for term in paint.split("+")]
    if len(terms) == 1 and "*" not in paint:
        return ((1.0, paint),)
    weighted = []
    for term in terms:
        weight, star, name = (piece.strip() for piece in term.partition("*"))
        if not star or not name or not re.fullmatch(_NUMBER, weight):
            raise ValueError(
                f"coat {entry!r}: cannot read {term!r}: write mixtures as "
                "0.7*ZincWhite+0.3*CobaltBlue"
            )
        if float(weight) < 0:
            raise ValueError(f"coat {entry!r}: the fraction {weight} of {name} is negative")
        weighted.append((float(weight), name))
    # Fractions as typed; rounding in the last digit is no mistake.
    total = sum(weight for weight, _ in weighted)
    if abs(total - 1.0) > 1e-6:
        raise ValueError(
            f"coat {entry!r}: fractions sum to {total:g}, not to 1: divide them by their sum"
        )
    return tuple(weighted)


ALL_NAMES = "`glazejax render --list` shows all names"


def find_name(name: str, names: Iterable[str]) -> str:
    """The one of `names` that is meant; case, blanks, hyphens and underscores do not matter, and
    the catalogue of a paint stands before a colon or a stroke. Of several that differ in these
    alone the last is taken: one's own paints stand behind the catalogue's.

    Raises:
        ValueError: none of them; the message lists the nearest.
    """
    full_names: dict[str, str] = {}
    for full in names:
        if full == name:
            return full
        full_names[_plain(full)] = full
    key = _plain(name)
    if key in full_names:
        return full_names[key]
    # A number stands between two names, where a plus sign belongs.
    if re.search(r"\S\s+\d+(\.\d+)?\s+\S", name):
        raise ValueError(
            f"there is no pigment {name!r:.60}: between two paints of a mixture stands a +, such "
            "as 10 Vermillion + 90 ZincWhite"
        )
    near = nearest_names(name, full_names.values(), fold=_plain)
    # The same paint of a catalogue, behind that of the shelf.
    near = [full for full in near if full.rpartition(":")[2] not in near or ":" not in full]
    choice = (
        f"the nearest {'is' if len(near) == 1 else 'are'} {', '.join(near)}" if near else ALL_NAMES
    )
    raise ValueError(f"there is no pigment {name!r:.60}: {choice}")


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]+", "", name).lower().replace("/", ":")


def same_name(first: str, second: str) -> bool:
    """Test whether two names differ in case, blanks, hyphens and underscores at most."""
    return _plain(first) == _plain(second)


def name_paints(coats: Sequence[Coat], names: Iterable[str]) -> tuple[Coat, ...]:
    """Coats whose parts carry the full names of pigments, each once: the weights of one that is
    named twice, in whatever spelling, add up.

    Raises:
        ValueError: an unknown pigment; see `find_name`.
    """
    names = list(names)
    named = []
    for coat in coats:
        weights = sum_weights((weight, find_name(name, names)) for weight, name in coat.parts)
        named.append(coat._replace(parts=tuple((weight, name) for name, weight in weights.items())))
    return tuple(named)


def sum_weights(parts: Iterable[tuple[float, str]]) -> dict[str, float]:
    """Weight of each paint by its name, in their order; those of one that comes twice add up."""
    weights: dict[str, float] = {}
    for weight, name in parts:
        weights[name] = weights.get(name, 0.0) + weight
    return weights
