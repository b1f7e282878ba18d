"""Pigments that ship with the package, each with its provenance: oil paints and acrylics.

- "oils": k and s fitted together to pure films, tints and shades of unknown thickness, a typical
  one taken as 25 micrometres (`pigments.csv`, `PROVENANCE.md`). 400-700 nm.
- "acrylics": k and s converted from Kubelka-Munk's K and S of Golden paints, with an assumed s of
  titanium white (`acrylics.csv`, `ACRYLICS.md`). 380-750 nm. Their errors are not known, so there
  are no standard deviations.

- "pigments": paints of many hands by the pigment that they are of, ``family/source-detail``, each
  on a grid of its own, 380-2400 nm at the most (`exemplars.py`, `exemplars.tsv`).

In each, how much stronger one paint is than another is known, their common scale is not: the two
have two. Where k and s could not be separated, `Pigment.identifiable` is False and only k/s can be
trusted.
"""

import functools
import hashlib
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..names import nearest_names
from ..paint.describe import format_length
from .exemplars import (
    Family,
    Provenance,
    families,
    families_of,
    paints_by_exemplar,
    provenance,
    sources,
)

if TYPE_CHECKING:
    # Names of paints are checked before what a paint is made of is loaded.
    from ..paint.media import Pigment

    _Paints = dict[str, Pigment]
else:
    _Paints = dict

__all__ = [
    "Catalogue",
    "Family",
    "Provenance",
    "assumed_scale",
    "caution",
    "checksum",
    "families",
    "families_of",
    "family",
    "load",
    "names",
    "pigment",
    "provenance",
    "read",
]

ASSUMED_THICKNESS = 25e-6
"""Thickness of a typical film of the oils in m, an assumption."""

PROVENANCE = (
    "Fitted jointly to 58 films over black and over white from revigo-spectra (CC0 1.0): Geldof, "
    "Proaño Gaibor, Kirchner, Ligterink, 'Reconstructing Van Gogh's palette...', Heritage "
    "Science 6:17 (2018), doi 10.1186/s40494-018-0181-6. Thickness unknown, that of a typical "
    "film taken as 25 micrometres: k and s of all paints scale with its inverse. Mixtures add k "
    "and s by mass. Integrating sphere d:8 with the specular part, refractive index 1.5."
)

ACRYLICS_PROVENANCE = (
    "Converted from Kubelka-Munk's K and S of Golden heavy-body acrylics: Artist Paint Spectral "
    "Database (Rochester Institute of Technology), as tabulated by Wacton.Unicolour (MIT, "
    "copyright 2022 William Acton), commit 4bf3d8c. Masstones and 1:10 tints with titanium white "
    "reflect what K and S give under the source's Saunderson surface (k1 = .03, k2 = .65). No "
    "length is given: the s of titanium white is taken as 500000 1/m at every wavelength, so "
    "that 76 micrometres of it hide black to 98 %; k and s of all paints scale with it. Mixtures "
    "add k and s by weight. Integrating sphere at 8 degrees without the specular part, "
    "refractive index 1.5."
)


_FAMILIES = {
    "Eosin1Wax": "Eosin",
    "Eosin2PbWax": "Eosin",
    "ZincWhiteLinseed": "ZincWhite",
    "ChromeYellowPoppyseed": "ChromeYellow",
    "ChromeYellowOtero": "ChromeYellow",
}
"""Paints of the oils that are another's pigment in another medium, or from another maker."""


PIGMENTS = "pigments"
"""The catalogue by family."""


class _Shipped(NamedTuple):
    """Facts about a catalogue before it is read."""

    file: str
    provenance: str
    scale: str


_SHIPPED = {
    "oils": _Shipped(
        "pigments.csv",
        PROVENANCE,
        "pigments of the catalogue were fitted to films of unknown thickness, taken as "
        + format_length(ASSUMED_THICKNESS),
    ),
    "acrylics": _Shipped(
        "acrylics.csv",
        ACRYLICS_PROVENANCE,
        f"pigments come from K and S without lengths; {format_length(76e-6)} of titanium white "
        "are taken to hide black",
    ),
    PIGMENTS: _Shipped(
        "exemplars.csv",
        "exemplars",
        "pigments of each source have a unit of length of their own; they were brought together "
        "by the median of s",
    ),
}


class Catalogue(_Paints):
    """Pigments by name; a name that is not known raises a KeyError that lists the nearest."""

    def __missing__(self, name: str) -> "Pigment":
        near = nearest_names(str(name).replace(" ", ""), self, cutoff=0.4, shortest=1)
        if near:
            raise KeyError(f"unknown pigment {name!r}; nearest: " + ", ".join(map(repr, near)))
        raise KeyError(f"unknown pigment {name!r}; the catalogue has {', '.join(self)}")

    def __repr__(self) -> str:
        return f"Catalogue({', '.join(self)})"


def names() -> tuple[str, ...]:
    """Names of the catalogues that ship whose paints are by one hand and on one grid; the first is
    the default. The catalogue "pigments" is of many hands.
    """
    return tuple(name for name in _SHIPPED if name != PIGMENTS)


def paint_families(name: str) -> dict[str, str]:
    """Names of a catalogue's paints, with the family where it is searched by families: known
    without reading their spectra.

    Raises:
        ValueError: there is no catalogue of that name; the message lists them.
    """
    _check_known(name)
    if name == PIGMENTS:
        return {exemplar: origin.family for exemplar, origin in provenance().items()}
    return dict.fromkeys(families_of(name), "")


def load(name: str = "oils") -> Catalogue:
    """A catalogue: a mapping from name to `Pigment`, k and s in 1/m.

    The pigments are made in the precision that JAX is set to when this is called.

    Args:
        name: "oils" (400-700 nm step 10), "acrylics" (380-750 nm step 10, without standard
            deviations) or "pigments" (each on its own grid, with `Pigment.family`, `source` and
            `binder`).

    Raises:
        ValueError: there is no catalogue of that name; the message lists them.
    """
    import jax.numpy as jnp

    _check_known(name)
    return Catalogue(_read_once(name, jnp.result_type(float).name))


@functools.lru_cache(maxsize=8)
def _read_once(name: str, precision: str) -> "dict[str, Pigment]":
    """Pigments of a catalogue in the precision that JAX is set to; nothing can change them, so all
    share them.
    """
    import jax

    from ..paint.pigment_table import read_pigments

    shipped = _SHIPPED[name]
    # Inside a traced function too they are arrays, which may outlive it.
    with jax.ensure_compile_time_eval(), as_file(files(__name__).joinpath(shipped.file)) as path:
        paints = read_pigments(path, shipped.provenance)
        if name != PIGMENTS:
            return paints
        # The oils and acrylics are exemplars of their families too.
        shelves = {shelf: _read_once(shelf, precision) for shelf in names()}
        return paints_by_exemplar(paints, shelves)


def read(path: str | Path) -> Catalogue:
    """Paints of your own file, such as ``glazejax recover --into mine.csv`` writes it: as `load`
    gives those that ship.

    Args:
        path: a CSV with a line for each paint and wavelength: pigment, wavelength_nm, absorption
            and scattering in 1/m, and whatever else `glazejax recover` writes.

    Raises:
        FileNotFoundError: no such file.
        ValueError: it is no table of paints; the message is one line and says why.
    """
    from ..paint.pigment_table import read_pigments

    return Catalogue(read_pigments(path))


def pigment(name: str, catalogue: str = "oils") -> "Pigment":
    """One pigment of a catalogue.

    Raises:
        ValueError: there is no catalogue of that name, or it has none of this; the message lists
            the nearest names.
    """
    shelf = load(catalogue)
    try:
        return shelf[name]
    except KeyError as error:
        raise ValueError(error.args[0]) from None


def family(name: str) -> str:
    """The pigment of a paint of the catalogues, medium and maker aside; any other name is its own
    family.

    Example:
        >>> family("Eosin1Wax"), family("CobaltBlue")
        ('Eosin', 'CobaltBlue')
    """
    return _FAMILIES.get(name, name)


def caution(paint: "Pigment") -> str:
    """Why a painter of today may want another paint: that its pigment is poisonous, or rarely or
    no longer sold, as `families` says; empty if nothing speaks against it, or for one's own paint.

    Example:
        >>> caution(pigment("EmeraldGreen"))
        'poisonous (arsenic), no longer sold'
    """
    # A paint of another catalogue than the oils may have that before its name.
    name = paint.name.replace("/", ":").rpartition(":")[2]
    exemplar_family = families_of(_catalogue_of(paint)).get(name, "")
    about = families().get(paint.family or exemplar_family)
    return "" if about is None else about.caution


def checksum(name: str = "oils") -> tuple[str, str]:
    """File of a catalogue and the SHA-256 of its content, as ``sha256sum`` prints it.

    Raises:
        ValueError: there is no catalogue of that name; the message lists them.
    """
    shipped = _check_known(name)
    return shipped.file, hashlib.sha256(
        files(__name__).joinpath(shipped.file).read_bytes()
    ).hexdigest()


def _check_known(name: str) -> _Shipped:
    if name not in _SHIPPED:
        raise ValueError(f"there is no catalogue {name!r}; choose from {', '.join(_SHIPPED)}")
    return _SHIPPED[name]


def assumed_scale(paint: "Pigment") -> str | None:
    """Assumption about lengths of the catalogue that a pigment is from, a clause; None for one's
    own.
    """
    name = _catalogue_of(paint)
    return _SHIPPED[name].scale if name else None


def _catalogue_of(paint: "Pigment") -> str:
    """Catalogue that a pigment is from; empty for one's own.

    It shows by the provenance: that of the catalogue, or an exemplar's own, and then by its source.
    """
    name = next((n for n, s in _SHIPPED.items() if s.provenance == paint.provenance), "")
    return name or (PIGMENTS if paint.source in sources() else "")
