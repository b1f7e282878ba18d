"""Paints of many hands by their pigment: families of pigments, and exemplars of each.

An exemplar is a paint of one source and binder. `exemplars.csv` has k and s, fitted to each
source's own readings by ``python -m benchmarks.paint.pigments``; `exemplars.tsv` says of each where
it is from, and `sources.tsv` has the licence and citation of each source; `families.tsv` has what
is known of each pigment; `paints.tsv` names the families of the oils and acrylics, which are
exemplars, too.
"""

import csv
import functools
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from ..paint.media import Pigment


class Family(NamedTuple):
    """Facts about a pigment.

    Attributes:
        name: such as "azurite".
        formula: chemical formula.
        elements: that X-ray fluorescence may find, by symbol; none for most dyes.
        colour_index: names in the Colour Index.
        in_use: when it was used in paint, in words.
        first_year, last_year: the same as years, negative before Christ; None if it still is.
        poison: what in it is poisonous; empty where nothing is known to be. Compounds of lead,
            arsenic and chromium(VI), and cadmium sulphide, are classified in Annex VI of
            Regulation (EC) No 1272/2008; mercury sulphide, cadmium in other pigments and copper
            acetate are named for what they hold.
        sold: "rarely" where it is sold as a powder or by few makers only, "no longer" where it is
            not sold as artists' paint; empty where it is.
        common: how common films of it are, compared with those of a family of one pigment: how many
            pigments of the Colour Index most artists' paints of the family hold, or .3 where few
            paintings and makers' paints hold it; a judgement, after R. J. Gettens and G. L. Stout,
            Painting Materials (1942), and Artists' Pigments, vols. 1-4 (National Gallery of Art,
            1986-2007).
    """

    name: str
    formula: str
    elements: tuple[str, ...]
    colour_index: str
    in_use: str
    first_year: int
    last_year: int | None
    poison: str = ""
    sold: str = ""
    common: float = 1.0

    @property
    def caution(self) -> str:
        """Why a painter of today may want another paint, such as ``poisonous (lead), rarely sold``;
        empty if nothing speaks against it.
        """
        poison = f"poisonous ({self.poison})" if self.poison else ""
        sold = f"{self.sold} sold" if self.sold else ""
        return ", ".join(filter(None, (poison, sold)))


class Provenance(NamedTuple):
    """Source of an exemplar.

    Attributes:
        exemplar: its name, ``family/source-detail``.
        family: of the pigment.
        source: whose paint it is.
        binder: in words; empty if the source does not say.
        paint: what the source calls it.
        first_nm, last_nm: range of its k and s.
        told_by: how k and s were separated; where it begins with ``k/s alone``, s is that of
            other paints.
        licence: of the numbers.
        citation: of the source.
    """

    exemplar: str
    family: str
    source: str
    binder: str
    paint: str
    first_nm: float
    last_nm: float
    told_by: str
    licence: str
    citation: str


_SHELVES: dict[str, dict[str, Any]] = {
    "oils": {
        "source": "revigo",
        "binder": "oil",
        "first_nm": 400.0,
        "last_nm": 700.0,
        "told_by": "tints and shades",
    },
    "acrylics": {
        "source": "golden",
        "binder": "acrylic",
        "first_nm": 380.0,
        "last_nm": 750.0,
        "told_by": "tints with white",
    },
}
"""Catalogue -> what the `Provenance` of its paints shares."""


@functools.cache
def families() -> dict[str, Family]:
    """All families of pigments, by name."""
    out: dict[str, Family] = {}
    for row in _table("families.tsv"):
        name = row.pop("family")
        about: dict[str, Any] = row | {
            "elements": tuple(row["elements"].split()),
            "first_year": int(row["first_year"]),
            "last_year": int(row["last_year"]) if row["last_year"] else None,
            "common": float(row["common"]),
        }
        out[name] = Family(name, **about)
    return out


@functools.cache
def families_of(catalogue: str) -> dict[str, str]:
    """Families of the oils or the acrylics by the paints' names; empty for a pigment of none."""
    return {
        row["paint"]: row["family"] for row in _table("paints.tsv") if row["catalogue"] == catalogue
    }


@functools.cache
def sources() -> dict[str, dict[str, str]]:
    """Licence and citation of each source of exemplars."""
    return {row.pop("source"): row for row in _table("sources.tsv")}


@functools.cache
def provenance() -> dict[str, Provenance]:
    """Sources of the exemplars of ``catalogue.load("pigments")``, by its name."""
    out: dict[str, Provenance] = {}
    for row in _table("exemplars.tsv"):
        ends = {key: float(row[key]) for key in ("first_nm", "last_nm")}
        about: dict[str, Any] = row | ends | sources()[row["source"]]
        out[row["exemplar"]] = Provenance(**about)
    # Paints of the two catalogues are exemplars too.
    for shelf, shared in _SHELVES.items():
        about = shared | sources()[shared["source"]]
        for paint, family in families_of(shelf).items():
            if family:
                exemplar = f"{family}/{shared['source']}-{paint}"
                out[exemplar] = Provenance(exemplar=exemplar, family=family, paint=paint, **about)
    return out


def paints_by_exemplar(
    fitted: "dict[str, Pigment]", shelves: "dict[str, dict[str, Pigment]]"
) -> "dict[str, Pigment]":
    """Pigments by exemplar: those that were fitted, and the paints of the oils and acrylics.

    Args:
        fitted: those of `exemplars.csv`.
        shelves: catalogue -> its paints.
    """
    out: "dict[str, Pigment]" = {}
    for name, origin in sorted(provenance().items(), key=lambda pair: pair[0].casefold()):
        shelf = next((s for s, shared in _SHELVES.items() if shared["source"] == origin.source), "")
        pigment = shelves[shelf][origin.paint] if shelf else fitted[name]
        out[name] = pigment.renamed(
            name,
            family=origin.family,
            source=origin.source,
            binder=origin.binder,
            provenance=pigment.provenance if shelf else _words(origin),
        )
    return out


def _words(origin: Provenance) -> str:
    """An exemplar's provenance as one sentence."""
    return (
        f"{origin.paint}, fitted to the readings of {origin.citation} ({origin.licence}); "
        f"k separated from s by {origin.told_by}"
    )


def _table(name: str) -> list[dict[str, str]]:
    text = files("glazejax.catalogue").joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines(), delimiter="\t"))
