"""Output of `glazejax identify`: lines on the screen and tables."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from glazejax import catalogue
from glazejax.io import write_table
from glazejax.report import plain_table

from ...page.words import chance
from ..families.evidence import describe_anachronism, facts_of
from ..result import Identification
from ..result.groups import FamilySet
from ..result.in_tests import has_infrared, were_tested
from .ambiguity import describe_ambiguity
from .explanation import explanations

# Spectra up to which each has a table.
_FEW = 8


def print_identification(identification: Identification, console: Console, top: int) -> None:
    """Print the most probable explanations: a table for each of a few spectra, one line for each of
    many.

    Args:
        identification: its result.
        console: to print to.
        top: explanations in a table.
    """
    for row in range(len(identification)):
        if len(identification) > _FEW:
            console.print(identification.words(row))
            continue
        console.print(_table(identification, row, top))
        console.print(_verdict(identification, row), style="bold")
        if sentence := identification.coats_words(row):
            console.print(sentence, soft_wrap=True)
        for doubt in describe_ambiguity(identification, row):
            console.print(doubt, style="dim")
        console.print()


def report_families(
    identification: Identification, top: int, painted: int | None
) -> Iterator[str | Text]:
    """The most probable families of pigments of each spectrum, the exemplars that look most like
    it, and what was not in use when it was painted: lines as they are, without markup.

    Args:
        identification: by family.
        top: sets of families for each spectrum.
        painted: year, or None if it is not known.
    """
    for row, name in enumerate(identification.measured.names):
        sets = identification.family_sets[row][:top]
        if identification.explained[row]:
            yield f"{name}: {sets[0].words}, {identification.stated_words(row)}"
        else:
            yield f"{name}: {identification.unexplained(row)}"
        for family in facts_of(sets[0].families):
            facts = (family.formula, family.colour_index, f"in use {family.in_use}")
            yield f"  {family.name}: {', '.join(f for f in facts if f != '-')}"
        if sentence := describe_anachronism(sets[0].families, painted):
            yield f"  {sentence}"
        # Below half a per cent an answer is none that anybody would look into.
        alternatives = [
            f"{answer.words} {answer.probability:.0%}"
            for answer in sets[1:]
            if answer.probability >= 0.005
        ]
        if identification.explained[row]:
            alternatives.append(f"none of them {identification.none[row]:.0%}")
        if alternatives:
            yield f"  or {'; '.join(alternatives)}"
        if sentence := identification.coats_words(row):
            yield f"  {sentence}"
        # A few hundredths are noise of the darkest bands.
        if (gloss := float(identification.gloss[row, 0])) < 0.97:
            yield (
                "  its darkest bands are below what a smooth surface alone reflects to the stated "
                f"instrument (taken as {gloss:.0%} of that): is the paint matte? If not, state the "
                "instrument that read it, such as --instrument de:8 or 45:0"
            )
        near = dict.fromkeys(paint for c in identification.ranked(row, top) for paint in c.paints)
        if own_names := _own_references(near, sets[0]):
            yield f"  nearest reference: {', '.join(own_names)}"
        yield Text(f"  nearest exemplars: {', '.join(list(near)[:top])}", "dim")
    if identification.explained.any():
        bands = identification.measured.wavelengths
        read = "with" if has_infrared(bands) else "without"
        tested = (
            "In tests: so many of the answers that were as sure were right, on pure paints by "
            f"others, read {read} the near infrared; of mixtures fewer are."
            if were_tested(bands)
            else f"No test read as few as {len(bands)} bands: answers may be less sure than stated."
        )
        yield Text(tested, "dim")


def _own_references(near: Iterable[str], answer: FamilySet) -> list[str]:
    """Of the nearest paints, those of the user's own that are of an answer's families: names that
    the catalogue does not have.
    """
    families = {family for name in answer.families for family in answer.shares(name)}
    own_paints = (paint.partition("/") for paint in near if paint not in catalogue.provenance())
    return [name for family, _, name in own_paints if family in families]


def _verdict(identification: Identification, row: int) -> str:
    if not identification.explained[row] or identification.likely_paint(row) is not None:
        sentence = identification.verdict(row)
        return f"{sentence[0].upper()}{sentence[1:]}."
    best, (pigments, chance) = identification.ranked(row, 1)[0], identification.families(row)[0]
    sentence = f"Pigments: {' + '.join(pigments)} ({chance:.0%}). Most probable film: {best.words}."
    none = identification.none[row]
    return f"{sentence} Probability that none of these paints explains it: {none:.1%}."


def _table(identification: Identification, row: int, top: int) -> Table:
    thickness = [] if identification.opaque else ["thickness"]
    table = plain_table(
        "paints",
        "probability",
        *thickness,
        "RMSE",
        "angle",
        "ΔE00",
        title=identification.measured.names[row],
    )
    for candidate in identification.ranked(row, top):
        cells = [chance(candidate.probability)]
        if not identification.opaque:
            # A film that hides its ground has no thickness to state.
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


def _compared(measured: float, film: float) -> tuple[float, float] | tuple[str, str]:
    """Cells of a film and of what is left; empty at bands where it is not computed."""
    return ("", "") if np.isnan(film) else (film, measured - film)


def write_residuals(identification: Identification, path: Path, *, overwrite: bool = False) -> None:
    """Write measured, fitted and residual spectra of the best explanations, a line a spectrum,
    ground and band; where families were searched, as the report draws them.
    """
    by_family = " at the reading's gloss and brightness" if identification.family_sets else ""
    fitted = f"fitted{by_family}"
    header = ("spectrum", "ground", "wavelength_nm", "measured", fitted, "residual")
    measured = identification.measured
    lines = (
        (name, ground, f"{nm:g}", read, *_compared(read, film))
        for row, name in enumerate(measured.names)
        for best in explanations(identification, row, 1)
        for ground, (readings, films) in enumerate(
            zip(measured.readings[row], best.fitted, strict=True), start=1
        )
        for nm, read, film in zip(measured.wavelengths, readings, films, strict=True)
    )
    write_table(path, header, lines, overwrite=overwrite)
