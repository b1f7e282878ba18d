"""Options that `glazejax identify` and `glazejax map` share: elements, the year, paints, and what
is expected of films of these.
"""

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeAlias

import typer

from glazejax.commands import options, progress

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment


GEOMETRY = "d:8"
Typed: TypeAlias = Mapping[str, Any]
"""Options by the names of a command's arguments."""


def _check_elements(text: str) -> None:
    from .families.evidence import check_elements

    check_elements(options.split_names(text))


def _symbols(text: str) -> Any:
    return options.option(metavar="SYMBOLS", callback=options.checked(_check_elements), help=text)


Elements = Annotated[
    str,
    _symbols(
        "Elements found by X-ray fluorescence, such as Cu,Pb: families with them become more "
        "probable (--catalogue pigments)."
    ),
]
WithoutElements = Annotated[
    str, _symbols("Elements that X-ray fluorescence did not find, such as Co,Cr.")
]
Painted = Annotated[
    int | None,
    options.option(
        metavar="YEAR",
        callback=options.between(-10_000, datetime.date.today().year),
        help="Year of the painting, such as 1620: pigments not in use then become fifty times "
        "less probable, and are marked.",
    ),
]
References = Annotated[Path | None, options.REFERENCES]


Catalogue = Annotated[str | None, options.catalogue_option(options.PIGMENTS)]
Bare = Annotated[
    bool,
    typer.Option(
        "--bare", help="--ground is what the same instrument reads from the bare ground, in air."
    ),
]
Opaque = Annotated[
    bool, typer.Option("--opaque", help="The paint is opaque: the ground does not show.")
]
MaxPaints = Annotated[
    int,
    typer.Option(
        callback=options.between(1, 3),
        help="Largest number of paints in a film: 1, 2 or 3; families are searched alone and in "
        "pairs.",
    ),
]
InstrumentName = Annotated[str | None, options.instrument_option(GEOMETRY)]


def check_ground(ground: str | None, *, bare: bool, opaque: bool) -> None:
    """Refuse a ground of films that show none, and ``--bare`` without one."""
    if opaque and ground is not None:
        raise ValueError("--opaque films show no ground: leave out --ground, or leave out --opaque")
    if bare and ground is None:
        raise ValueError("--bare says how --ground was measured: give --ground too")


class Search(NamedTuple):
    """Paints that are searched for, and how.

    Attributes:
        paints: of the catalogue and of the user's own files.
        by_family: whether their families are searched.
        keywords: instrument, discrepancy, prior, max_paints, elements and year, as fields of
            `IdentificationOptions`.
        asked: what was asked, in words.
    """

    paints: "list[Pigment]"
    by_family: bool
    keywords: dict[str, Any]
    asked: str


def read_search(typed: Typed, console: "Console", of_paints: Sequence[str]) -> Search:
    """The search that options ask for.

    Args:
        typed: options by the names of the command's arguments.
        console: to print notes to.
        of_paints: typed options of which a search by family makes nothing.

    Raises:
        FileNotFoundError: no file of references.
        ValueError: paints that there are not, references or facts where no families are searched,
            or a table that is no references.
    """
    from ..film.films import Instrument
    from ..film.model.errors import ModelError, Prior
    from .families.expected import EXPECTED, has_families
    from .search.options import IdentificationOptions

    pigments, catalogue, references = typed["pigments"], typed["catalogue"], typed["references"]
    paints = options.choose_paints(
        options.read_shelf(pigments, catalogue), typed["only"], typed["without"]
    )
    by_family = has_families(paints) and not typed.get("own_films")
    if by_family and of_paints:
        note = "no effect on families of pigments, only on paints (--catalogue oils)"
        progress.print_notes(console, ", ".join(of_paints), (note,))
    facts = {
        "elements": tuple(options.split_names(typed["elements"])),
        "without_elements": tuple(options.split_names(typed["without_elements"])),
        "painted": typed["painted"],
    }
    if not by_family:
        # Before an image is opened or a cluster is asked.
        IdentificationOptions(**facts).refuse_facts()
    instrument = Instrument(
        options.read_geometry(typed["instrument"], GEOMETRY), typed["refractive_index"]
    )
    if references is not None:
        if not by_family:
            raise ValueError(
                "--references are searched by family: give --catalogue pigments, and neither "
                "--pigments nor --own-films"
            )
        from .families.references import read_references

        library = read_references(references, instrument)
        progress.print_notes(console, references, (*library.notes, *library.unclear))
        paints += library.pigments
    error = typed["model_error"]
    return Search(
        paints=paints,
        by_family=by_family,
        keywords={
            "instrument": instrument,
            "discrepancy": ModelError() if error is None else ModelError(amplitude=error),
            "prior": replace(
                EXPECTED if by_family else Prior(),
                thickness=options.read_length(typed["thickness"]),
            ),
            "max_paints": typed["max_paints"],
            **facts,
        },
        asked=options.say_asked(paints, catalogue, pigments or references, by_family=by_family),
    )
