"""Report of ``glazejax render``: the stack, its spectrum, its colour, the ladder and remarks."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Array, Float
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..colour import delta_e_2000, xyz
from ..paint.describe import Coat, format_length
from ..plots import hex_colour
from ..report import swatch
from .rendering import Rendering

# Rounding in a spectrum moves an encoded value by less than this.
_WIDE = 72
_LADDER_ROWS = (1, 2, 5, 10, 20, 40)


def print_stack(
    console: Console, coats: Sequence[Coat], *, ground: str, refractive_index: float, seen: str
) -> None:
    """Draw the layers from top to bottom, and say in words what is below and how they are seen."""
    bar = min(console.width, 72)
    console.print(
        Text(f"~~~~ smooth surface, n = {refractive_index:g} ".ljust(bar, "~"), style="cyan")
    )
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
    console.print(table)
    console.print(Text(f"==== ground: {ground} ".ljust(bar, "="), style="cyan"))
    console.print(Text(f"seen with {seen}"))


def print_spectrum(console: Console, rendering: Rendering) -> None:
    """Print the reflectance of every band, as many columns as the terminal is wide."""
    console.print()
    console.print(Text("Reflectance", style="bold"))
    columns = max(1, min(10, (console.width - 5) // 7))
    x = rendering.wavelengths
    values = rendering.glaze
    for start in range(0, x.size, columns):
        columns_shown = slice(start, start + columns)
        console.print(Text("  nm " + "".join(f"{w:>7g}" for w in x[columns_shown]), style="dim"))
        console.print(Text("  R  " + "".join(f"{r:>7.4f}" for r in values[columns_shown])))


def print_colour(console: Console, rendering: Rendering) -> None:
    """Print XYZ, Lab and sRGB of the glaze."""
    spectrum = rendering.glaze
    tristimulus = np.asarray(xyz(rendering.wavelengths, spectrum, **rendering.light))
    lightness, a, b = rendering.lab(spectrum)
    raw = rendering.rgb(spectrum, clip=False)
    shade = hex_colour(raw)
    console.print()
    console.print(Text.assemble(("Colour", "bold"), f" under {rendering.eye}"))
    console.print(
        Text("  XYZ    " + "".join(f"{v:9.4f}" for v in tristimulus) + "  (white: Y = 1)")
    )
    hue = np.rad2deg(np.arctan2(b, a)) % 360
    values = "".join(f"{format_decimals(v, 2):>9}" for v in (lightness, a, b))
    console.print(Text(f"  L*a*b* {values}  (C* {np.hypot(a, b):.1f}, h {hue:.0f}°)"))
    line = Text(
        "  sRGB   "
        + "".join(f"{round(255 * float(v)):9d}" for v in np.clip(raw, 0, 1))
        + f"  {shade} "
    )
    console.print(line + swatch(shade))
    if outside := out_of_gamut(raw):
        console.print(Text(f"         {outside}", style="yellow"))


def out_of_gamut(raw: Float[Array | np.ndarray, "3"]) -> str:
    """A sentence on unclipped sRGB that a screen cannot show, or nothing."""
    # Rounding in a spectrum moves an encoded value by less than this.
    slack = 5e-4
    wrong = [
        f"{name} {255 * float(value):.0f}"
        for name, value in zip("RGB", np.asarray(raw), strict=True)
        if not -slack <= value <= 1 + slack
    ]
    return (
        f"outside the sRGB gamut, clipped (would need {', '.join(wrong)} of 0-255)" if wrong else ""
    )


def print_comparison(console: Console, rendering: Rendering, coats: Sequence[Coat]) -> None:
    """Print the colours of the bare ground and of each layer alone."""
    rows = [("the glaze", rendering.glaze)]
    if len(coats) > 1:
        pairs = zip(coats, rendering.alone, strict=True)
        rows += [(f"{coat.name} alone", spectrum) for coat, spectrum in pairs if coat.total > 0]
    rows.append(("bare ground", rendering.ground))
    wide = console.width >= _WIDE
    table = Table(box=None, padding=(0, 1), header_style="dim")
    table.add_column(" On this ground", overflow="fold")
    for title in ("L*", "a*", "b*", *(["ΔE00"] if wide else [])):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("sRGB", no_wrap=True)
    glaze_lab = rendering.lab(rendering.glaze)
    for name, spectrum in rows:
        values = rendering.lab(spectrum)
        shade = hex_colour(rendering.rgb(spectrum))
        cells = [*values, float(delta_e_2000(glaze_lab, values))] if wide else [*values]
        table.add_row(
            f" {name}", *(format_decimals(v) for v in cells), Text(f"{shade} ") + swatch(shade)
        )
    console.print()
    console.print(table)


def print_ladder(console: Console, rendering: Rendering, coat: Coat) -> None:
    """Print a few rungs of the ladder of a coat."""
    ladder = rendering.ladder
    console.print()
    what = f" of {coat.name}, one coat {format_length(coat.thickness)}: sRGB, L*, C*"
    console.print(Text.assemble(("Ladder", "bold"), what))
    table = Table(box=None, padding=(0, 1), header_style="dim")
    table.add_column(" coats", justify="right", no_wrap=True)
    narrow = console.width < _WIDE
    for title in ("glazejax", "multiply", "mixing"):
        table.add_column(title, no_wrap=True)
    for count in _LADDER_ROWS:
        if count > ladder.counts[-1]:
            break
        cells = []
        for spectra in (ladder.glaze, ladder.multiply, ladder.mixing):
            lightness, a, b = rendering.lab(spectra[count])
            shade = hex_colour(rendering.rgb(spectra[count]))
            numbers = "" if narrow else f"{lightness:4.0f}{np.hypot(a, b):4.0f} "
            patch = Text("") if console.width < 50 else swatch(shade)
            cells.append(Text(f"{shade}{numbers} ") + patch)
        table.add_row(str(count), *cells)
    console.print(table)


def print_remarks(console: Console, remarks: Sequence[tuple[str, str]]) -> None:
    """Print notes and warnings, wrapped with a hanging indent."""
    if not remarks:
        return
    console.print()
    table = Table.grid(padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for kind, words in remarks:
        table.add_row(Text(f"{kind}:", style="yellow" if kind == "warning" else "dim"), Text(words))
    console.print(table)


def format_decimals(value: float, places: int = 1) -> str:
    """A number with so many decimals, and never minus zero."""
    return f"{round(float(value), places) + 0.0:.{places}f}"
