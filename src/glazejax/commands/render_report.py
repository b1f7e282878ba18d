"""Report of ``glazejax render``: the stack, its spectrum, its colour, the ladder and remarks."""

from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from ..colour import delta_e_2000, xyz
from ..paint.describe import Coat, format_length
from ..plots import hex_colour
from ..report import plain_table, swatch
from .rendering import Rendering

# Columns of a screen that has room for all figures.
_WIDE = 72
_LADDER_ROWS = (1, 2, 5, 10, 20, 40)


def report_stack(
    coats: Sequence[Coat], *, ground: str, refractive_index: float, seen: str, width: int
) -> Iterator[RenderableType]:
    """Draw the layers from top to bottom, and say in words what is below and how they are seen, on
    a screen of so many columns.
    """
    bar = min(width, 72)
    yield Text(f"~~~~ smooth surface, n = {refractive_index:g} ".ljust(bar, "~"), style="cyan")
    table = Table.grid(padding=(0, 2))
    table.add_column(overflow="fold")
    table.add_column(justify="right", no_wrap=True)
    table.add_column(overflow="fold")
    for coat in coats:
        remark = (
            "absent"
            if coat.total == 0
            else f"= {format_length(coat.total)}"
            if coat.repeats > 1
            else ""
        )
        table.add_row(
            f"  {coat.name}", coat.size, remark, style="dim" if coat.total == 0 else "bold"
        )
    yield table
    yield Text(f"==== ground: {ground} ".ljust(bar, "="), style="cyan")
    yield Text(f"seen with {seen}")


def report_rendering(
    rendering: Rendering, coats: Sequence[Coat], repeated: Coat, width: int
) -> Iterator[RenderableType]:
    """Spectrum and colour of a glaze, its layers alone, and the ladder of one of its coats, on a
    screen of so many columns.
    """
    yield ""
    yield from _spectrum(rendering, width)
    yield ""
    yield from _colour(rendering)
    yield ""
    yield _comparison(rendering, coats, width)
    yield ""
    what = f" of {repeated.name}, one coat {format_length(repeated.thickness)}: sRGB, L*, C*"
    yield Text.assemble(("Ladder", "bold"), what)
    yield _ladder(rendering, width)


def _spectrum(rendering: Rendering, width: int) -> Iterator[Text]:
    """Reflectance of every band, as many in a line as the screen is wide."""
    yield Text("Reflectance", style="bold")
    columns = max(1, min(10, (width - 5) // 7))
    x = rendering.wavelengths
    values = rendering.glaze
    for start in range(0, x.size, columns):
        columns_shown = slice(start, start + columns)
        yield Text("  nm " + "".join(f"{w:>7g}" for w in x[columns_shown]), style="dim")
        yield Text("  R  " + "".join(f"{r:>7.4f}" for r in values[columns_shown]))


def _colour(rendering: Rendering) -> Iterator[Text]:
    """XYZ, Lab and sRGB of the glaze."""
    spectrum = rendering.glaze
    tristimulus = np.asarray(xyz(rendering.wavelengths, spectrum, **rendering.light))
    lightness, a, b = rendering.lab(spectrum)
    raw = rendering.rgb(spectrum, clip=False)
    shade = hex_colour(raw)
    yield Text.assemble(("Colour", "bold"), f" under {rendering.eye}")
    yield Text("  XYZ    " + "".join(f"{v:9.4f}" for v in tristimulus) + "  (white: Y = 1)")
    hue = np.rad2deg(np.arctan2(b, a)) % 360
    values = "".join(f"{v:z9.2f}" for v in (lightness, a, b))
    yield Text(f"  L*a*b* {values}  (C* {np.hypot(a, b):.1f}, h {hue:.0f}°)")
    line = Text(
        "  sRGB   "
        + "".join(f"{round(255 * float(v)):9d}" for v in np.clip(raw, 0, 1))
        + f"  {shade} "
    )
    yield line + swatch(shade)
    # Rounding in a spectrum moves an encoded value by less than this.
    slack = 5e-4
    wrong = [
        f"{name} {255 * float(value):.0f}"
        for name, value in zip("RGB", raw, strict=True)
        if not -slack <= value <= 1 + slack
    ]
    if wrong:
        yield Text(
            f"         outside the sRGB gamut, clipped (would need {', '.join(wrong)} of 0-255)",
            style="yellow",
        )


def _comparison(rendering: Rendering, coats: Sequence[Coat], width: int) -> Table:
    """Colours of the bare ground and of each layer alone."""
    rows = [("the glaze", rendering.glaze)]
    if len(coats) > 1:
        pairs = zip(coats, rendering.alone, strict=True)
        rows += [(f"{coat.name} alone", spectrum) for coat, spectrum in pairs if coat.total > 0]
    rows.append(("bare ground", rendering.ground))
    wide = width >= _WIDE
    figures = ("L*", "a*", "b*", *(["ΔE00"] if wide else []))
    last = len(figures) + 1
    table = plain_table(" On this ground", *figures, "sRGB", words=(0, last), header_style="dim")
    table.columns[last].no_wrap = True
    glaze_lab = rendering.lab(rendering.glaze)
    for name, spectrum in rows:
        values = rendering.lab(spectrum)
        shade = hex_colour(rendering.rgb(spectrum))
        cells = [*values, float(delta_e_2000(glaze_lab, values))] if wide else [*values]
        table.add_row(f" {name}", *(f"{v:z.1f}" for v in cells), Text(f"{shade} ") + swatch(shade))
    return table


def _ladder(rendering: Rendering, width: int) -> Table:
    """A few rungs of the ladder."""
    ladder = rendering.ladder
    ways = ("glazejax", "multiply", "mixing")
    table = plain_table(" coats", *ways, words=(1, 2, 3), header_style="dim")
    for count in _LADDER_ROWS:
        if count > ladder.counts[-1]:
            break
        cells = []
        for spectra in (ladder.glaze, ladder.multiply, ladder.mixing):
            lightness, a, b = rendering.lab(spectra[count])
            shade = hex_colour(rendering.rgb(spectra[count]))
            numbers = "" if width < _WIDE else f"{lightness:4.0f}{np.hypot(a, b):4.0f} "
            patch = Text("") if width < 50 else swatch(shade)
            cells.append(Text(f"{shade}{numbers} ") + patch)
        table.add_row(str(count), *cells)
    return table


def report_remarks(remarks: Sequence[tuple[str, str]]) -> Table:
    """Notes and warnings, wrapped with a hanging indent."""
    table = Table.grid(padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for kind, words in remarks:
        table.add_row(Text(f"{kind}:", style="yellow" if kind == "warning" else "dim"), Text(words))
    return table
