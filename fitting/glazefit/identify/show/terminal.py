"""What `glazejax identify` leaves: lines on the screen and tables."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from glazejax import catalogue
from glazejax.io import write_table
from glazejax.report import plain_table

from ...page.words import chance
from ..families.evidence import describe_anachronism
from ..result import Identification
from ..result.groups import FamilySet
from ..result.in_tests import has_infrared
from ..result.table import table_of
from .ambiguity import describe_ambiguity
from .explanation import explanations


def print_identification(found: Identification, console: Console, top: int, detailed: int) -> None:
    """Print the most probable explanations: a table for each of the first spectra, one line for the
    others.

    Args:
        found: identification.
        console: to print to.
        top: explanations in a table.
        detailed: spectra that get a table.
    """
    for row in range(min(detailed, len(found))):
        console.print(_table(found, row, top))
        console.print(f"[bold]{_verdict(found, row)}[/bold]")
        if words := found.coats_words(row):
            console.print(words, **_AS_IS)
        for doubt in describe_ambiguity(found, row):
            console.print(f"[dim]{doubt}[/dim]")
        console.print()
    for row in range(detailed, len(found)):
        console.print(found.words(row), markup=False)


def print_families(
    found: Identification, console: Console, top: int, painted: int | None = None
) -> None:
    """Print the most probable families of pigments of each spectrum, the exemplars that look most
    like it, and what was not in use when it was painted.

    Args:
        found: identification by family.
        console: to print to.
        top: sets of families for each spectrum.
        painted: year, or None if it is not known.
    """
    known = catalogue.families()
    for row, name in enumerate(found.measured.names):
        sets = found.family_sets[row][:top]
        if found.explained[row]:
            console.print(f"{name}: {sets[0].words}, {found.stated_words(row)}", **_AS_IS)
        else:
            console.print(f"{name}: {found.unexplained(row)}", **_AS_IS)
        for family in sets[0].families if sets else ():
            if family in known:
                about = known[family]
                facts = (about.formula, about.colour_index, f"in use {about.in_use}")
                console.print(f"  {family}: {', '.join(f for f in facts if f != '-')}", **_AS_IS)
        if sets and painted is not None:
            words = describe_anachronism(sets[0].families, known, painted)
            if words:
                console.print(f"  {words}", **_AS_IS)
        # Below half a per cent an answer is none that anybody would look into.
        others = [
            f"{other.words} {other.probability:.0%}"
            for other in sets[1:]
            if other.probability >= 0.005
        ]
        if found.explained[row]:
            others.append(f"none of them {found.none[row]:.0%}")
        if others:
            console.print(f"  or {'; '.join(others)}", **_AS_IS)
        if words := found.coats_words(row):
            console.print(f"  {words}", **_AS_IS)
        # A few hundredths are noise of the darkest bands.
        if (gloss := float(found.gloss[row, 0])) < 0.97:
            console.print(
                "  its darkest bands are below what a smooth surface alone reflects to the stated "
                f"instrument (taken as {gloss:.0%} of that): is the paint matte? If not, state the "
                "instrument that read it, such as --instrument de:8 or 45:0",
                **_AS_IS,
            )
        near = dict.fromkeys(paint for c in found.ranked(row, top) for paint in c.paints)
        if own := _own_references(near, sets[0] if sets else None):
            console.print(f"  nearest reference: {', '.join(own)}", **_AS_IS)
        console.print(f"  nearest exemplars: {', '.join(list(near)[:top])}", style="dim", **_AS_IS)
    if found.explained.any():
        read = "with" if has_infrared(found.measured.wavelengths) else "without"
        console.print(
            "In tests: so many of the answers that were as sure were right, on pure paints by "
            f"others, read {read} the near infrared; of mixtures fewer are.",
            style="dim",
            **_AS_IS,
        )


def _own_references(near: Iterable[str], answer: FamilySet | None) -> list[str]:
    """Of the nearest paints, those of the user's own that are of an answer's families: names that
    the catalogue does not have.
    """
    if answer is None:
        return []
    families = {family for shares in answer.within.values() for family, _ in shares}
    families.update(answer.families)
    own = (paint.partition("/") for paint in near if paint not in catalogue.provenance())
    return [name for family, _, name in own if family in families]


_AS_IS: dict[str, Any] = {"markup": False, "soft_wrap": True}


def _verdict(found: Identification, row: int) -> str:
    if not found.explained[row]:
        words = found.unexplained(row)
        return f"{words[0].upper()}{words[1:]}."
    if found.likely_paint(row) is not None:
        words = found.verdict(row)
        return f"{words[0].upper()}{words[1:]}."
    best, (pigments, chance) = found.ranked(row, 1)[0], found.families(row)[0]
    words = f"Pigments: {' + '.join(pigments)} ({chance:.0%}). Most probable film: {best.words}."
    return f"{words} Probability that none of these paints explains it: {found.none[row]:.1%}."


def _table(found: Identification, row: int, top: int) -> Table:
    thickness = [] if found.opaque else ["thickness"]
    table = plain_table(
        "paints",
        "probability",
        *thickness,
        "RMSE",
        "angle",
        "ΔE00",
        title=found.measured.names[row],
    )
    for candidate in found.ranked(row, top):
        cells = [chance(candidate.probability)]
        if not found.opaque:
            # A film that hides its ground has no thickness that could be told.
            cells.append(
                f"{micrometres(candidate.thickness)} ± {micrometres(candidate.thickness_sd)} µm"
                if np.isfinite(candidate.thickness)
                else "-"
            )
        colour = "-" if np.isnan(candidate.delta_e) else f"{candidate.delta_e:.2f}"
        table.add_row(
            candidate.words, *cells, f"{candidate.rmse:.4f}", f"{candidate.angle:.2f}°", colour
        )
    return table


def micrometres(metres: float) -> str:
    """Micrometres, without a power of ten."""
    value = metres * 1e6
    return f"{value:.0f}" if value >= 9.5 else f"{value:.1f}" if value >= 0.95 else f"{value:.2f}"


def write_candidates(
    found: Identification, path: Path, top: int, *, overwrite: bool = False
) -> None:
    """Write the ranked explanations, a line each: of families the answers themselves."""
    write_table(path, *table_of(found, top), overwrite=overwrite)


def write_residuals(found: Identification, path: Path, *, overwrite: bool = False) -> None:
    """Write measured, fitted and residual spectra of the best explanations, a line a spectrum,
    ground and band; where families were sought, as the report draws them.
    """
    by_family = " at the reading's gloss and brightness" if found.family_sets else ""
    fitted = f"fitted{by_family}"
    header = ("spectrum", "ground", "wavelength_nm", "measured", fitted, "residual")
    lines = (
        (name, ground + 1, f"{nm:g}", measured[band], film[band], measured[band] - film[band])
        for row, name in enumerate(found.measured.names)
        for best in explanations(found, row, 1)
        for ground, (measured, film) in enumerate(
            zip(found.measured.readings[row], best.fitted, strict=True)
        )
        for band, nm in enumerate(found.measured.wavelengths)
    )
    write_table(path, header, lines, overwrite=overwrite)
