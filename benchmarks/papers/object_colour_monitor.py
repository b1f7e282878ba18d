"""Paper B's monitor in the loop: figures 2, 3, 4, 10, 14 and 16, and the brightness of the chips.

As in the paper, section 6: spectra become XYZ, XYZ become digital levels by the matrix T and the
two tables, the levels light a monitor, and a colorimeter reads it. The monitor is simulated:
primaries within the rounding of the printed ones, so that T is as printed, a gamma a channel,
levels that are whole numbers, and some light left at level
0. What the program knows of it is what the colorimeter reads: x and y to .001, Y to three digits,
18 levels a primary.
"""

import functools
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from benchmarks.papers.object_colour import (
    COPPER,
    chart,
    chromaticity_of,
    lamp,
    measured_copper,
    reflectances,
    xyz,
)
from benchmarks.results import Results, percent, quantity
from glazejax.appearance.display.display import Display
from glazejax.appearance.display.tone import ToneCurve, look_up

PRINTED = np.array([[4.784, -2.342, -0.694], [-1.481, 2.592, 0.037], [0.045, -0.169, 0.894]])
GREEN_Y, MISPRINT = 0.597, 0.607
GAMMAS = (2.1, 2.2, 2.3)
"""Of red, green and blue: the paper's figure 2 has curves that differ a little, and no numbers."""
BLACK = 0.05
"""cd/m2 at level 0, of the colour of white."""
READ = np.arange(0, 256, 15)
TOP = np.array([255.0])
VALUES = np.concatenate([np.arange(0.0, 30.0, 0.1), np.arange(30.0, 256.0)])
SHOWABLE = 2e-3
"""Distance in xy, at most, between a colour and the nearest that the primaries make: two last
digits of a reading.
"""
PLATES = np.arange(0.0, 87.6, 2.5)
ONE_TABLE, WHOLE, MISPRINTED = 1, 3, 4
"""Places in `loops()`."""


class Monitor(NamedTuple):
    """A simulated monitor and a colorimeter before it."""

    screen: Display
    black: float = 0.0  # cd/m2 at level 0
    rounded: bool = False  # whether the colorimeter shows x and y to .001 and Y to three digits

    def read(self, levels: np.ndarray) -> np.ndarray:
        """XYZ that the colorimeter reads for levels, (..., 3)."""
        white = self.screen.white
        seen = np.asarray(self.screen.to_xyz(levels)) + self.black / white[1] * white
        if not self.rounded:
            return seen
        xy, light = np.round(chromaticity_of(seen), 3), seen[..., 1:2]
        digit = 10.0 ** (np.floor(np.log10(light)) - 2)
        light = np.round(light / digit) * digit
        return (
            light / xy[..., 1:] * np.concatenate([xy, 1 - xy.sum(axis=-1, keepdims=True)], axis=-1)
        )

    def known(self) -> Display:
        """The display as its readings show."""
        primaries = READ[:, None] * np.eye(3)[:, None]
        return Display.from_readings(READ, self.read(primaries))


class Loop(NamedTuple):
    """How a colour gets to the monitor and back."""

    words: str
    monitor: Monitor
    known: Display
    tables: int  # 0: light as it is, without levels

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """XYZ read of the colours shown for XYZ wanted, (..., 3)."""
        if not self.tables:
            return np.asarray(values)
        return self.monitor.read(np.asarray(self.known.look_up(values, fine=self.tables == 2).rgb))


def nearest_display(green_y: float) -> tuple[Display, float]:
    """The display within the rounding of all printed primaries whose T is nearest to the printed,
    and how near.
    """
    printed = Display.paper_monitor()
    start = np.concatenate([printed.chromaticities.ravel(), printed.luminances])
    start[3] = green_y
    half = np.concatenate([np.full(6, 0.0005), np.full(3, 0.05)])
    tones = tuple(ToneCurve.from_gamma(gamma) for gamma in GAMMAS)

    def made(shares: np.ndarray) -> Display:
        moved = start + shares * half
        return Display(moved[:6].reshape(3, 2), moved[6:], tones, name="simulated monitor")

    found = made(
        least_squares(lambda s: (made(s).matrix - PRINTED).ravel(), np.zeros(9), bounds=(-1, 1)).x
    )
    return found, float(np.abs(found.matrix - PRINTED).max())


@functools.cache
def loops() -> list[Loop]:
    """Ways through the monitor, from none to the whole."""
    screen, _ = nearest_display(GREEN_Y)
    bare, whole = Monitor(screen), Monitor(screen, BLACK, rounded=True)
    known = whole.known()
    xy = known.chromaticities.copy()
    xy[1, 1] += MISPRINT - GREEN_Y
    misprinted = Display(xy, known.luminances, known.tones)
    return [
        Loop("no levels: the light as it is", bare, screen, 0),
        Loop("one table of 256, monitor known exactly", bare, screen, 1),
        Loop("two tables, monitor known exactly", bare, screen, 2),
        Loop(f"two tables, monitor as read, black of {BLACK:g} cd/m2", whole, known, 2),
        Loop("the same, T from y of green .607 as printed", whole, misprinted, 2),
    ]


def tables(results: Results) -> dict[str, Any]:
    """Matrix and tables: figures 2, 3 and 4."""
    display = Display.paper_monitor()
    results("        T, printed                  T, eq (3) with second row 1")
    for one, two in zip(PRINTED, display.matrix, strict=True):
        results(
            "  " + " ".join(f"{v:7.3f}" for v in one) + "     " + " ".join(f"{v:7.3f}" for v in two)
        )
    largest = np.abs(PRINTED).max()
    share = np.abs(display.matrix - PRINTED).max() / largest
    results(f"  largest difference {share:.1%} of the largest number")
    results.record(matrix=percent(share, 1))
    for green in (MISPRINT, GREEN_Y):
        off = nearest_display(green)[1]
        results(
            f"  nearest T within the rounding of the primaries, y of green {green}: {off:.4f} off"
        )
    results("  printed T has three decimals, so y = .607 of green is a misprint for .597")
    tone = ToneCurve.from_gamma(2.2)
    coarse, fine = tone.tables()
    light = np.linspace(0.0, 14.0, 14001)
    for words, table in (
        ("one table of 256", None),
        ("a second one, ten times finer below 14", fine),
    ):
        wrong = np.abs(
            255 * np.asarray(tone.light(look_up(light, coarse, table).astype(float))) - light
        )
        results(
            f"  gamma 2.2, light 0-14 of 255 by {words}: error {wrong.max():.2f} at most, "
            f"{wrong.mean():.3f} mean"
        )
    whole = loops()[WHOLE]
    curves = [tone.tables() for tone in whole.known.tones]
    results("  Figure 4: light of each primary alone for RGB values, off a straight line, of 255:")
    lines: dict[str, list[np.ndarray]] = {}
    for words, fine_too in (("one table", False), ("two tables", True)):
        found = [straight(whole, k, VALUES, fine_too) for k in range(3)]
        off = np.abs(np.array(found) - VALUES)
        low = VALUES < 14
        results(
            f"    {words}: {off.max():.2f} at most, {off.mean():.2f} mean; "
            f"below 14: {off[:, low].max():.2f} at most, {off[:, low].mean():.2f} mean"
        )
        lines[words] = found
    return {
        "tables": curves,
        "lines": lines,
        "values": VALUES,
        "luminances": whole.known.luminances,
    }


def straight(loop: Loop, channel: int, values: np.ndarray, fine: bool) -> np.ndarray:
    """Light that a primary alone gives for RGB values, less that of level 0, of 255."""
    ends = loop.known.to_xyz(np.eye(3)[channel] * loop.known.levels)
    shown = [
        loop.monitor.read(np.asarray(loop.known.look_up(v[:, None] / 255 * ends, fine=fine).rgb))
        for v in (values, TOP)
    ]
    dark = loop.monitor.read(np.zeros(3))[1]
    return 255 * (shown[0][:, 1] - dark) / (shown[1][0, 1] - dark)


def exposed(values: np.ndarray, display: Display, most: float = 0.98) -> np.ndarray:
    """XYZ made as bright as the display can show all of them, one factor for all."""
    return values * most / np.asarray(display.linear(values)).max()


def showable(values: np.ndarray) -> np.ndarray:
    """Which colours the primaries can make, were there no levels."""
    display = loops()[0].known
    light = np.clip(np.asarray(display.linear(values)), 0.0, 1.0)
    made = light @ (np.linalg.inv(display.matrix / display.levels)).T
    return np.linalg.norm(chromaticity_of(made) - chromaticity_of(values), axis=-1) <= SHOWABLE


def chips(results: Results) -> dict[str, Any]:
    """Section 6: the brightness of standard colours on the monitor."""
    results(
        "\nChips (section 6): the 24 patches of a ColorChecker under D55, what is read over what "
        "is wanted"
    )
    known = chart()
    wanted = exposed(xyz(np.stack(list(known.values())) * lamp("D55")), loops()[0].known)
    inside = showable(wanted)
    read = [loop(wanted) for loop in loops()]
    for place, (loop, found) in enumerate(zip(loops(), read, strict=True)):
        ratio = np.abs(found[inside, 1] / wanted[inside, 1] - 1)
        off = np.linalg.norm(chromaticity_of(found) - chromaticity_of(wanted), axis=-1)[inside]
        results(
            f"  {loop.words:52} Y off {ratio.mean():.2%} mean, {ratio.max():.2%} at most; "
            f"xy {off.mean():.4f} mean, {off.max():.4f} at most"
        )
        if place == WHOLE:
            results.record(
                chips_mean=quantity(off.mean(), digits=4, n=off.size),
                chips_most=quantity(off.max(), digits=4, n=off.size),
                chips_luminance=percent(ratio.mean(), 1, n=off.size),
                chips_luminance_most=percent(ratio.max(), 1, n=off.size),
            )
    names = [name for name, there in zip(known, inside, strict=True) if not there]
    results(f"  outside the monitor's gamut, clipped and left out: {', '.join(names) or 'none'}")
    return {"chips": (wanted[inside, 1], read[WHOLE][inside, 1])}


def measured(
    results: Results, key: str, title: str, wanted: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """What the whole loop reads of the colours of a figure, xy, and how far each of `loops()` is off;
    that of the whole loop is recorded by the key.
    """
    results(f"  {title}, {len(wanted)} colours: distance in xy of what is read from what is wanted")
    inside = showable(wanted)
    read = [chromaticity_of(loop(wanted)) for loop in loops()]
    off = [np.linalg.norm(xy - chromaticity_of(wanted), axis=-1)[inside] for xy in read]
    for loop, distance in zip(loops(), off, strict=True):
        results(f"    {loop.words:52} {distance.mean():.4f} mean, {distance.max():.4f} at most")
    whole = off[WHOLE]
    results.record(
        **{
            f"{key}_mean": quantity(whole.mean(), digits=4, n=whole.size),
            f"{key}_most": quantity(whole.max(), digits=4, n=whole.size),
        }
    )
    if not inside.all():
        results(
            f"    {np.sum(~inside)} of them lie outside the monitor's gamut: clipped, and left "
            "out of these numbers"
        )
    return read[WHOLE], off


def copper_plates(results: Results) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Figure 14: copper plates by Hall's form from measured reflectance, each exposed for itself:
    chromaticities wanted and read, and the ends of their line.
    """
    light = lamp("D55")
    values = xyz(measured_copper(np.cos(np.deg2rad(PLATES))) * light)
    normal, palik = (
        measured_copper(np.array(1.0)),
        reflectances(COPPER, np.array(1.0))["exact Fresnel"],
    )
    results(
        "  normal reflectance of copper, measured (of Palik's n and k), at 400, 500, 600, 700 nm: "
        + ", ".join(f"{normal[k]:.2f} ({palik[k]:.2f})" for k in (0, 20, 40, 60))
    )
    known = loops()[0].known
    wanted = np.stack([exposed(value, known, 0.9) for value in values])
    read, _ = measured(
        results,
        "copper",
        "Figure 14: copper at 0 to 87.5 degrees step 2.5, normal reflectance measured",
        wanted,
    )
    exact = chromaticity_of(wanted)
    ends = np.stack([exact[0], chromaticity_of(xyz(light))])
    along = ends[1] - ends[0]
    share = (read - ends[0]) @ along / (along @ along)
    off = np.linalg.norm(read - ends[0] - share[:, None] * along, axis=1)
    wrong = np.linalg.norm(read - exact, axis=1)
    steep, grazing = wrong[PLATES <= 45].mean(), wrong[PLATES > 45].mean()
    results(
        f"    what is read lies within {off.max():.4f} of the line from normal incidence to the "
        "light;\n"
        f"    up to 45 degrees it is {steep:.4f} off on average, beyond {grazing:.4f}\n"
        "    paper: the locus is straight, with an error near 0 degrees"
    )
    return exact, read, ends
