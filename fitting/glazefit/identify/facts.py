"""Further facts of a painting, as options of `glazejax identify` and `glazejax map`: elements,
the year, and reference paints.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from glazejax.commands import options, progress

if TYPE_CHECKING:
    from rich.console import Console

    from glazejax import Pigment
    from glazejax.io.quantity import Stated

    from ..film.films import Instrument


def _check_elements(text: str) -> None:
    from .families.evidence import check_elements

    check_elements(options.split_names(text))


def _symbols(text: str) -> Any:
    return typer.Option(
        metavar="SYMBOLS",
        callback=options.checked(_check_elements),
        help=text,
        show_default=False,
    )


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
    typer.Option(
        metavar="YEAR",
        help="Year of the painting, such as 1620: pigments not in use then become fifty times "
        "less probable, and are marked.",
        show_default=False,
    ),
]
References = Annotated[Path | None, options.REFERENCES]


def describe_facts(elements: str, without_elements: str, painted: int | None) -> dict[str, Any]:
    """Elements and year by the names that `IdentificationOptions` has for them."""
    return {
        "elements": tuple(options.split_names(elements)),
        "without_elements": tuple(options.split_names(without_elements)),
        "painted": painted,
    }


def add_references(
    paints: "Sequence[Pigment]",
    references: Path | None,
    facts: dict[str, Any],
    *,
    by_family: bool,
    instrument: "Instrument",
    console: "Console",
    stated: "Stated",
) -> "list[Pigment]":
    """Paints of a catalogue, and reference paints with them.

    Args:
        paints: of the catalogue.
        references: file of ``--references``, or None.
        facts: by `describe_facts`.
        by_family: whether families are searched.
        instrument: that read the references.
        console: to print notes to.
        stated: what the user says of quantity and units.

    Raises:
        FileNotFoundError: no such file.
        ValueError: facts or references where no families are searched, or a table that is no
            references.
    """
    if any(value not in ((), None) for value in facts.values()) and not by_family:
        raise ValueError(
            "--elements, --without-elements and --painted weigh families of pigments: give "
            "--catalogue pigments"
        )
    if references is None:
        return list(paints)
    if not by_family:
        raise ValueError(
            "--references are searched by family: give --catalogue pigments, and neither "
            "--pigments nor --own-films"
        )
    from .families.references import read_references

    library = read_references(references, instrument, **stated)
    progress.print_notes(console, references, (*library.notes, *library.unclear))
    return [*paints, *library.pigments]
