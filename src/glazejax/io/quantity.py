"""Quantity and unit of the numbers of a file, and in what unit: one vocabulary for titles, rows of
units and keywords, of all formats.

What a file says comes before the size of its numbers. Reflectance is read; any other quantity is
refused by its name, unless the user says that it is reflectance. What nobody says is taken as nm,
as fractions, with a note.
"""

import math
import re
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple, TypedDict

import numpy as np

if TYPE_CHECKING:
    from .spectra_table import Bands

MODES = {
    "SCI": "specular component included, d:8",
    "SPIN": "specular component included, d:8",
    "SCE": "specular component excluded, de:8",
    "SPEX": "specular component excluded, de:8",
}
REFLECTANCE = "reflectance"
_EXPORT = "export it (%R) from the instrument's software"
_LIGHT = "measure what is lit against a white standard"
# What is measured of light itself.
_SHINE = {"radiance", "irradiance", "emission"}
# The first that matches counts: log(1/R) names R as well, 'Rad. (Ref.)' what looks like it.
# Pigments may be called raw, dark, lamp black or reflex blue: these words are no quantities.
_QUANTITIES = {
    "K/S": r"\bk\s*(/|over)\s*s\b|\bkubelka|\bf\s*\(\s*r|\bkm unit|\(1\s*-\s*r\)",
    "decibels": r"^dbm?\W*$|[\[(]\s*dbm?\b|\bdecibel",
    "intensity": r"\bintensity\W+a\.?u\b|\barb(\.|itrary)? ?unit",
    "a Raman spectrum": r"\braman\b",
    "a derivative": r"\bderivative",
    "a deviation": r"\bst(d|andard)?\.?\W?(dev|err)|\bs\.?d\.?\W*$|(?-i:^std$)|\bvariance\b",
    "absorbance": (
        r"\ba[bs]sor(?!be[nrd])[bpvc]|\babs\b(?!\W*irr)|\boptical densit|\bextin[ck]tion|"
        r"\b(log|lg|ln)\w*\W*[1rt]\b|(^|[\[(]\s*)(a\.?u|o\.?d)\.?\s*([\])]|$)"
    ),
    "counts": (
        r"\bcounts?\b|(^|[\[(]|\b(norm|raw)\.?\s*)dn\b|\bdigital number|\b(adu|cts|cuentas)\b|"
        r"\bz[äa]hl(imp|rat)"
    ),
    "radiance": r"\bradian(ce|c?ia|za|z)\b|\brad\.|^rad$|[/·*\s]sr\b|\bstrahldichte",
    "irradiance": r"\birradian|\bbestrahlungss|\bphoton flux|(^|[\W\d])[uµm]?w\W*c?m(\b|[\^\d²])",
    "emission": (
        r"\bemi(s|ttan)|(\"|^(?=\w+\W*$))(ambient|display|flash|monitor)\b|^display (type|\")|"
        r"\bluminan|cd/m|\bspd\b|"
        r"\b(fluorescence\b|photolum)|\b(spectral|relative|optical) power"
    ),
    "sensitivity": r"\bsensitivit|\bresponsivit|\bquantum eff",
    "transmittance": r"\btrans(mi|fl)|\btrasmi|\bdurchl[äa]s|%\s*t\b|\bt\s*[\[(]?\s*%",
    REFLECTANCE: (
        r"\br[eé]fl(?!ex\b)|\brifl|\bremission|%\s*r\b|\br\s*[\[(]?\s*(%|pct|perc)|\bbrf\b|"
        r"\bspectral (pct|dec)"
    ),
}
_PATTERNS = {name: re.compile(words, re.IGNORECASE) for name, words in _QUANTITIES.items()}
_MODE = re.compile(rf"(?<![a-z])({'|'.join(MODES)})(?![a-z])", re.IGNORECASE)
_PERCENT = r"%|\bpercent|\bper cent|\bpct\b|\bprozent|\bprocent|\bpor ciento"
_FRACTION = r"\bfractions?\b|\b0\s*[-–.]+\s*1\b|[\[(](?:-|1\.0)[\])]"
# Alone or in brackets it is the unit of whatever stands before it; 'red 10%' is a mixture.
_UNIT = r"(?:^\W*|[\[(,/]\s*)(?:{})[^\])]*(?:[\])]|$)"
_SCALES = tuple(
    (scale, re.compile(words, re.IGNORECASE), re.compile(_UNIT.format(words), re.IGNORECASE))
    for scale, words in ((100.0, _PERCENT), (1.0, _FRACTION))
)
# Titles that say what is measured and of what nothing more.
_NO_NAME = re.compile(
    r"[\W_]*(?:(?:r|in|rfl|refl\w*|réfl\w*|rifl\w*|remission\w*|factor|percent|pct|fractions?|values?|"
    r"intensity|processed|1\.0|counts?|sc[ie]|spin|spex|transm\w*|t|abs\w*|k\s*/\s*s|kubelka|munk|"
    r"(ir)?radiance)\b[\W_]*)+|\W*%\W*",
    re.IGNORECASE,
)
# What an instrument reads and computes reflectance from.
READING = re.compile(
    "sample|target|scope|raw|probe|muestra|échantillon|campione|dark|dunkel|oscuro|noir|buio|"
    "reference|ref|referenz|referencia|référence|riferimento|white|blanc|background"
)
_PARTS = re.compile(r"(?<!\d)(?:100|\d{1,2})(?:[.,]\d+)?\s*%")

# Units of wavelength: what turns them into nm, and what is said of that.
_LENGTHS = {
    "nm": (r"nm|nanomet(er|re)s?", None, ""),
    "um": (r"um|microns?|micromet(er|re)s?", 1e3, "micrometres; multiplied by 1000"),
    "angstrom": (r"a|å|angstroms?", 0.1, "angstrom; divided by 10"),
    "m": (r"m|met(er|re)s?", 1e9, "metres; multiplied by 1e9"),
    "1/cm": (r"1\s*/\s*cm|cm\^?[-⁻][1¹]|wave\s*numbers?|wellenzahl|nombres? d.onde", None, ""),
}
_NOT_SAID = {"", "unknown", "<unspecified>", "none"}


class Stated(TypedDict, total=False):
    """Statements of a user about a file, before what the file says: arguments of all readers of
    spectra.

    Attributes:
        quantity: ``reflectance``, where that is what the values are, whatever the file calls them.
        unit: ``nm``, ``um``, ``1/cm`` of wavelengths, ``percent`` or ``fraction`` of values, or one
            of each, ``1/cm percent``.
        scale: number that stands for a reflectance of 1.
    """

    quantity: str | None
    unit: str | None
    scale: float | None


class Meaning(NamedTuple):
    """Meaning that words give to the numbers they stand at; each is empty where they say nothing of
    it.

    Attributes:
        quantity: ``reflectance``, ``absorbance``, ...
        scale: number that stands for a reflectance of 1: 100 for percent, 1 for fractions.
        mode: ``SCI``, ``SCE``, ``SPIN`` or ``SPEX``.
    """

    quantity: str
    scale: float | None
    mode: str


@lru_cache(maxsize=4096)
def meaning(words: str) -> Meaning:
    """Quantity, unit and mode that a title, a unit or the value of a keyword states."""
    # No title is longer; a search in more could take long.
    words = _PARTS.sub(" ", words[:200]).replace("_", " ").strip()
    quantity = next((name for name, pattern in _PATTERNS.items() if pattern.search(words)), "")
    mode = _MODE.search(words)
    # Of 'SCI %' the sign stands alone, too.
    unit = _MODE.sub("", words)
    scale = next(
        (scale for scale, any_, alone in _SCALES if (any_ if quantity else alone).search(unit)),
        None,
    )
    return Meaning(quantity, scale, mode[1].upper() if mode else "")


def has_meaning(words: str) -> bool:
    """Return whether words state a quantity or a scale."""
    return any(meaning(words)[:2])


def first_quantity(said: Iterable[str]) -> str:
    """The first words that state a quantity; empty if none do."""
    return next((words for words in said if meaning(words).quantity), "")


def is_no_name(title: str) -> bool:
    """Return whether a title names a quantity or a unit and no sample: ``Reflectance (%)``."""
    return len(title) <= 100 and bool(_NO_NAME.fullmatch(title))


def names_sample(title: str) -> bool:
    """Return whether a title can only be a sample's name, and says nothing of its numbers."""
    said = is_no_name(title) or has_meaning(title) or READING.fullmatch(title.lower())
    return not said


def check_reflectance(words: str, stated: Stated) -> None:
    """Refuse what is not reflectance by its name, with what to export.

    Args:
        words: what the file says of its numbers; empty where it says nothing.
        stated: what the user says.

    Raises:
        ValueError: the file says another quantity and the user does not say that it is reflectance,
            or the user says another.
    """
    quantity = stated.get("quantity")
    words = words if quantity is None else quantity
    name = meaning(words).quantity
    if name != REFLECTANCE and (words or quantity is not None):
        raise ValueError(
            f"{words!r} is {name or 'not known'}, and only reflectance can be read: "
            f"{_LIGHT if name in _SHINE else _EXPORT}, or say --quantity reflectance if it is that"
        )


def read_units(stated: Stated) -> tuple[str, float | None]:
    """Unit of wavelengths, and number that stands for a reflectance of 1, of what a user says;
    empty and None where that says none.

    Raises:
        ValueError: a word that is no unit or contradicts another, or a scale that is not positive
            or not finite.
    """
    number = stated.get("scale")
    if number is not None and not 0 < number < math.inf:
        raise ValueError(
            f"scale is {number:g}; it must be positive and finite, such as 100 for percent"
        )
    length = ""
    scale = None
    for word in (stated.get("unit") or "").replace(",", " ").split():
        recognised, value = length_unit(word), meaning(word).scale
        before, now = (length, recognised) if recognised else (scale or number, value)
        if before and now and before != now:
            raise ValueError(
                f"unit {word!r} contradicts {before!r}: state one unit of wavelengths, and one "
                "unit or scale of values"
            )
        if recognised:
            length = recognised
        elif value is not None:
            scale = value
        else:
            raise ValueError(
                f"unit {word!r} is not known: nm, um, angstrom, m or 1/cm of wavelengths, percent "
                "or fraction of values"
            )
    return length, scale if number is None else number


def length_unit(words: str) -> str:
    """Unit of wavelengths that a title or unit states, such as ``nm``; empty where it states
    none.
    """
    words = words.strip().lower().replace("µ", "u").replace("μ", "u")
    for unit, (spellings, _, _) in _LENGTHS.items():
        # Alone, in brackets, or at the end behind a blank, comma or underscore.
        before = r"(?:.*[\[(])?" if unit in ("m", "angstrom") else r"(?:.*[\W_])?"
        if len(words) <= 100 and re.fullmatch(rf"{before}(?:{spellings})\W*", words):
            return unit
    return ""


def nanometres(wavelengths: "Bands", unit: str | None) -> tuple["Bands", list[str]]:
    """Wavelengths in nm from what a file calls their unit, with notes.

    A unit that is not named is micrometres if all are below 100, as no spectrum of paint reaches so
    far down in nm; whole numbers that small are taken for band numbers and refused, and so is what
    runs as an infrared spectrum in 1/cm does. Else it is nm, which is said.

    Raises:
        ValueError: the unit is not one of nm, um, angstrom, m, 1/cm, or there is none and they
            count bands or look like 1/cm.
    """
    word = (unit or "").strip().strip("{}()[]").strip()
    if word.lower() in _NOT_SAID:
        return _without_unit(wavelengths)
    length = length_unit(word)
    if not length:
        raise ValueError(
            f"wavelengths are in {unit!r}; known units are nm, um, angstrom, m and 1/cm"
        )
    if length == "1/cm":
        if not (wavelengths > 0).all():
            raise ValueError("wavenumbers must be positive")
        return _whole(wavelengths), ["wavenumbers in 1/cm were turned into wavelengths"]
    _, factor, note = _LENGTHS[length]
    if factor is None:
        return wavelengths, []
    return wavelengths * factor, [f"wavelengths are in {note}"]


def _without_unit(
    wavelengths: "Bands",
) -> tuple["Bands", list[str]]:
    """Wavelengths in nm where nobody says their unit."""
    low = np.fmin.reduce(wavelengths)
    high = np.fmax.reduce(wavelengths)
    if high < 100:
        if (wavelengths == np.round(wavelengths)).all():
            raise ValueError(
                f"{wavelengths[0]:g}, ... {wavelengths[-1]:g} look like band numbers, not "
                "wavelengths in nm"
            )
        return wavelengths * 1e3, [
            "wavelengths without a unit look like micrometres; multiplied by 1000"
        ]
    # Mid-infrared spectra: software writes them upwards from 400 to 4000, or downwards.
    falls = wavelengths[0] > max(1000.0, wavelengths[-1])
    if falls or (low > 2600 or high > 3400):
        raise ValueError(
            f"{wavelengths[0]:g} ... {wavelengths[-1]:g} without a unit may be wavenumbers (1/cm): "
            "say --unit 1/cm, or --unit nm"
        )
    return wavelengths, [not_stated("nm")]


def not_stated(*units: str) -> str:
    """Note on what nobody stated."""
    return f"no unit is stated: taken as {', as '.join(units)}"


def _whole(wavenumbers: "Bands") -> "Bands":
    """Wavelengths in nm of wavenumbers in 1/cm; whole ones if all are, to the digits of the file.

    14285.7 is 700.0007 nm, and would lie beyond a paint that is known up to 700 nm.
    """
    exact = 1e7 / wavenumbers
    decimals = next((n for n in range(9) if (np.round(wavenumbers, n) == wavenumbers).all()), None)
    if decimals is None:
        return exact
    slack = 0.5 * 10.0**-decimals * exact**2 / 1e7
    near = np.round(exact)
    whole = (np.abs(exact - near) <= slack).all() and np.unique(near).size == near.size
    return near if whole else exact
