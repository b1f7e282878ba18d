"""Paper A's table 4 explained: what the rounding of h to the fixed step does to the colour. And its
figure 2.

    python -m benchmarks.papers.paper_rounding [--out FOLDER]

The fixed step changes h to a multiple of dh, at each wavelength by another part of it, as chance
has it. So table 4 has one draw a pair. Here h is varied by some per cent, so that every wavelength
is rounded again, and the colours of each draw are compared as in the table. The exact solver on the
rounded stack shows how much of the error is rounding. The paper's times show how thick its glazes
were, which its text does not: the last table uses that.
"""

from typing import Any

import jax
import numpy as np

from benchmarks.papers.paper_tables import (
    PAINTS,
    PAIRS,
    PAPER_COARSE,
    PAPER_DECOMPOSED,
    PAPER_FIXED,
    SIZES,
    STEPS,
    THICKER,
    THINNING,
    WAVELENGTHS,
    Work,
    rgb,
    work,
)
from benchmarks.results import Results, command_line, ends, percent, quantities, quantity

NEEDS = ("matplotlib",)

STEP, COARSE = 0.01, 0.04
DRAWS = np.linspace(0.96, 1.04, 41)
"""Factors of all thicknesses."""
PAPER_OWN_STEP = {
    "a/b": (270.74, 149.73, 106.95, 84.687),
    "a/c": (181.42, 104.57, 74.679, 59.892),
    "a/d": (192.1, 108.83, 78.306, 63.278),
    "b/c": (221.94, 123.93, 88.95, 71.38),
    "b/d": (229.94, 128.71, 92.652, 73.219),
    "c/d": (127.25, 72.16, 51.707, 40.929),
}
"""Table 2 of the paper: seconds at each step."""


def rounded(pair: Work, *, end: bool, interface: bool) -> Work:
    """The stack as the fixed step has it: h, the interface, or both at a multiple of the step."""
    top, whole = pair.thickness[:, 0], pair.thickness.sum(axis=1)
    if end:
        whole = STEP * np.maximum(np.round(whole / STEP), 2)
    if interface:
        # A segment belongs to the layer of its midpoint.
        top = STEP * np.floor(top / STEP + 0.5)
    return Work(pair.albedo, np.stack([top, whole - top], axis=1))


def away(found: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.abs(found - wanted).mean())


def parts(say: Results, pairs: dict[str, Work]) -> None:
    """How much of the fixed step's error is rounding, by the exact solver on rounded stacks."""
    say(
        "\nMean absolute difference of 24-bit RGB over 19 x 19 angles, from the default solver "
        "on the stack as it is:"
    )
    say(f"{'':<58}" + "".join(f"{name:>8}" for name in pairs))
    rows: dict[str, list[float]] = {}
    for pair in pairs.values():
        exact = rgb(pair, "exact", 0.0)
        end, interface, both = (
            rgb(rounded(pair, end=h, interface=middle), "exact", 0.0)
            for h, middle in ((True, False), (False, True), (True, True))
        )
        fixed = rgb(pair, "fixed step", STEP)
        for words, one, other in (
            ("default solver, h at a multiple of .01", end, exact),
            ("default solver, interface at a multiple of .01", interface, exact),
            ("default solver, both", both, exact),
            ("fixed step .01", fixed, exact),
            ("fixed step .01 from the default solver with both", fixed, both),
        ):
            rows.setdefault(words, []).append(away(one, other))
    for words, values in rows.items():
        say(f"{words:<58}" + "".join(f"{value:8.4f}" for value in values))
    say.record(rounded_apart=quantity(max(list(rows.values())[-1]), digits=3))


def draws(say: Results, pairs: dict[str, Work], key: str) -> dict[str, np.ndarray]:
    """Differences from own step .01 of coarsening and of the fixed step, (draws, 2) a pair; how many
    of the paper's lie within them is recorded by the key.
    """
    found = {}
    for name, pair in pairs.items():
        rows = []
        for factor in DRAWS:
            one = Work(pair.albedo, factor * pair.thickness)
            wanted = rgb(one, "own step, decomposed", STEP)
            others = (rgb(one, "own step, decomposed", COARSE), rgb(one, "fixed step", STEP))
            rows.append([away(other, wanted) for other in others])
        found[name] = np.array(rows)
    head = f"{'':<40}" + "".join(f"{name:>17}" for name in pairs)

    def row(words: str, values: list[str]) -> None:
        say(f"{words:<40}" + "".join(f"{value:>17}" for value in values))

    say(head)
    row("paper: coarsened to own step .04", [f"{mean:.4f}" for mean, _ in PAPER_COARSE])
    row("paper: fixed step .01", [f"{mean:.4f}" for mean, _ in PAPER_FIXED])
    for column, words in enumerate(("coarsened to own step .04", "fixed step .01")):
        values = [v[:, column] for v in found.values()]
        row(f"here: {words}, median", [f"{np.median(v):.4f}" for v in values])
        row("  least to most of the draws", [f"{v.min():.4f}-{v.max():.4f}" for v in values])
    closer = nearer(found)
    row("fixed step nearer, of the draws", [f"{np.sum(v)} of {v.size}" for v in closer.values()])
    say(f"fixed step nearer in {np.mean(list(closer.values())):.0%} of all draws")
    within = [
        v[:, column].min() <= printed <= v[:, column].max()
        for column, paper in enumerate((PAPER_COARSE, PAPER_FIXED))
        for v, (printed, _) in zip(found.values(), paper, strict=True)
    ]
    say(f"of the paper's {len(within)} numbers {np.sum(within)} lie within the draws")
    say.record(**{key: quantity(np.sum(within), digits=0, n=len(within))})
    return found


def nearer(found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Which draws of each pair the fixed step is nearer in than coarsening."""
    return {name: v[:, 1] < v[:, 0] for name, v in found.items()}


def record_draws(say: Results, found: dict[str, np.ndarray], thick: dict[str, np.ndarray]) -> None:
    """Least and most of some pairs' draws, with our paints and with those as thick as the paper's;
    and how often the fixed step is nearer.
    """
    for key, values, digits in (
        ("ac", found["a/c"][:, 1], 4),
        ("bc", found["b/c"][:, 1], 4),
        ("bc_thick", thick["b/c"][:, 1], 4),
        ("ab_coarse", found["a/b"][:, 0], 2),
    ):
        say.record(**quantities(ends(key, values), "", digits, n=len(values)))
    closer = nearer(found)
    say.record(
        draws=quantity(DRAWS.size, digits=0),
        ac_nearer=quantity(np.sum(closer["a/c"]), digits=0, n=DRAWS.size),
        all_nearer=percent(np.mean(list(closer.values()))),
    )


def thickness_by_times(say: Results) -> dict[str, float]:
    """Mean optical thickness of each of the paper's paints, from how its times rise with 1/dh.

    An own step costs an assembly a wavelength. Table 1 has the time of one against Q, table 2
    against 1/dh = Q/h.
    """
    a_segment = np.polyfit(SIZES, PAPER_DECOMPOSED, 1)[0]
    inverse = 1 / np.array(STEPS)
    glazes = {
        n: np.polyfit(inverse, t, 1)[0] / a_segment / WAVELENGTHS.size
        for n, t in PAPER_OWN_STEP.items()
    }
    letters = list(PAINTS)
    sums = np.array([[float(letter in pair) for letter in letters] for pair in PAIRS])
    found, *_ = np.linalg.lstsq(sums, np.array(list(glazes.values())), rcond=None)
    off = np.abs(sums @ found - np.array(list(glazes.values()))).max()
    say(
        "\nThe paper's mean h by its times: "
        + ", ".join(f"{name} {h:.2f}" for name, h in glazes.items())
    )
    say(f"  as sums of two paints (the sums hold within {off:.2f}):")
    own = {i: float(work_h) for i, work_h in zip(letters, found, strict=True)}
    say("  " + ", ".join(f"{letter} {h:.2f}" for letter, h in own.items()))
    return own


def as_thick(pairs: dict[str, Work], wanted: dict[str, float], *, swapped: bool) -> dict[str, Work]:
    """The pairs with each paint as thick as the paper's, on average over the wavelengths; the
    second on top if so.
    """
    found = {}
    for name, pair in pairs.items():
        factor = np.array([wanted[letter] for letter in name.split("/")]) / pair.thickness.mean(
            axis=0
        )
        order = [1, 0] if swapped else [0, 1]
        found[name] = Work(pair.albedo[:, order], (factor * pair.thickness)[:, order])
    return found


def figure(pairs: dict[str, Work], found: dict[str, np.ndarray]) -> Any:
    """Figure 2's curves, of the same pigments, and the draws."""
    from matplotlib.figure import Figure

    from glazejax import catalogue

    paints = catalogue.load("pigments")
    picture = Figure(figsize=(12, 6.4), layout="constrained")
    halves: Any = picture.subfigures(2, 1)
    top, bottom = halves
    top.suptitle(
        "k and s of the catalogue's paints of the paper's pigments, as in its figure 2", fontsize=11
    )
    bottom.suptitle(
        "Table 4: mean difference of 24-bit RGB, h varied by 4 % (x: as the paper prints it)",
        fontsize=11,
    )
    for axes, (letter, name) in zip(top.subplots(1, 4, sharey=True), PAINTS.items(), strict=True):
        paint = paints[name]
        for values, colour, word in (
            (paint.absorption, "#c0392b", "k"),
            (paint.scattering, "#3558a8", "s"),
        ):
            axes.semilogy(
                paint.wavelengths, THINNING * np.asarray(values), color=colour, label=word
            )
        axes.set_title(f"({letter}) {paint.family}", fontsize=10)
        axes.set_xlim(WAVELENGTHS[0], WAVELENGTHS[-1])
        axes.set_xlabel("wavelength (nm)")
        if letter == "a":
            axes.set_ylabel("k, s times 0.1 (1/m)")
            axes.legend(frameon=False)
    axes = bottom.subplots()
    for k, values in enumerate(found.values()):
        for column, (colour, shift) in enumerate((("#d08a3c", -0.16), ("#26221e", 0.16))):
            spread = np.linspace(-0.1, 0.1, len(values))
            axes.plot(k + shift + spread, values[:, column], ".", color=colour, ms=4)
            printed = (PAPER_COARSE, PAPER_FIXED)[column][k][0]
            axes.plot(k + shift, printed, "x", color=colour, ms=9, mew=2)
    axes.plot([], [], ".", color="#d08a3c", label="coarsened to own step .04")
    axes.plot([], [], ".", color="#26221e", label="fixed step .01")
    axes.set_xticks(range(len(found)), list(found))
    axes.set_yscale("log")
    axes.set_ylabel("of a 24-bit step")
    axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=2)
    for each in (*picture.axes,):
        each.spines[["top", "right"]].set_visible(False)
    return picture


def main() -> None:
    """Command line."""
    options = command_line(__doc__).parse_args()
    if options.quick:
        globals().update(DRAWS=np.array([1.0]))
    jax.config.update("jax_enable_x64", True)
    say = Results("paper_rounding", options.out)
    say(
        "Table 4 of paper A: the rounding of h to the fixed step\n"
        "Paints, layers and angles as in paper_tables.txt; own step .01 is the table's standard."
    )
    pairs = work()
    parts(say, pairs)
    spread = f"h of all wavelengths times {DRAWS[0]:g} to {DRAWS[-1]:g}, {DRAWS.size} draws"
    say(f"\nTable 4 again, {spread}: mean difference from own step .01")
    found = draws(say, pairs, "within")
    wanted = thickness_by_times(say)
    mean = {letter: pairs[f"a/{letter}"].thickness[:, 1].mean() for letter in "bcd"}
    mean = {"a": pairs["a/b"].thickness[:, 0].mean(), **mean}
    say("  here: " + ", ".join(f"{letter} {h:.2f}" for letter, h in mean.items()))
    say.record(
        vermilion_thickness=quantity(wanted["b"] / mean["b"], "times", digits=1),
        lead_tin_thickness=quantity(wanted["a"] / mean["a"], "times", digits=1),
    )
    thick = {}
    for side, key in (("first", "within_thick"), ("second", "within_swapped")):
        say(f"\nWith paints as thick as the paper's, the {side} of the pair on top; {spread}")
        thick[side] = draws(say, as_thick(pairs, wanted, swapped=side == "second"), key)
    say(f"\nWith a thicker yellow, {THICKER}; {spread}")
    draws(say, work(a=THICKER), "within_thicker")
    record_draws(say, found, thick["first"])
    say.save(figure(pairs, found))


if __name__ == "__main__":
    main()
