"""Figures in README and docs are those of the result files that they link."""

import re
from pathlib import Path

import pytest
from benchmarks.results import Results, version_of

import glazejax
from glazefit.film.errors import MISFIT

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
BEHIND = 1
"""Minor versions that a result may be older than the code."""


def result(name: str) -> str:
    return (RESULTS / f"{name}.txt").read_text()


def all_of(pattern: str, text: str) -> list[float]:
    """Numbers that the pattern's groups find, thousands' commas taken off."""
    found = [part for match in re.finditer(pattern, text) for part in match.groups()]
    assert found, f"nothing like {pattern!r}"
    return [float(part.replace(",", "")) for part in found]


def words(document: str) -> str:
    """A document as one line, so that its line breaks do not matter."""
    return " ".join((ROOT / document).read_text().split())


def worst_over_tolerance() -> str:
    rows = [line.split()[1:] for line in result("calibrate_directions").splitlines() if line.startswith("1e-")]
    # Of each setting: number of directions, and two errors over the tolerance.
    return f"worst of 1000 stacks a setting | {max(float(v) for row in rows for v in (*row[1::3], *row[2::3])):.2f}"


def beside_cdisort() -> str:
    (ratio,) = all_of(r"CDISORT without surface +at 1e-08 +([\d.]+)", result("frontier"))
    return f"both at an error of 1e-8 | {1 / ratio:.0f}"


def gradient() -> str:
    (ratio,) = all_of(r"value and gradient / value +tol. 1e-06 +([\d.]+)", result("frontier"))
    return f"that of the value, tolerance 1e-6 | {ratio:.1f}"


def million() -> str:
    (milliseconds,) = all_of(r"\n1000000 +(\d+)", result("scaling"))
    return f"A million stacks of two layers | {milliseconds / 1e3:.1f} s"


def chart() -> str:
    median, _, below, _ = all_of(r"\n +3 +2 +([\d.]+) +([\d.]+) +(\d+) +([\d.]+)", result("colourchecker_recipes"))
    return f"{below:.0f} of 24, {median:.2f}"


def chart_seconds() -> str:
    text = result("colourchecker_recipes")
    first, again = all_of(r"at most: ([\d.]+) s the first", text) + all_of(r"\n([\d.]+) s again", text)
    return f"All 24 take {first} s the first time, with compilation, and {again} s again"


def posterior() -> str:
    part = result("coverage").partition("bands:")[0]
    held = all_of(r"\n(?:thickness|gloss|model error|fraction) +\d+ +([\d.]+)%", part)
    return f"500 simulated films of paints | {min(held):.0f}-{max(held):.0f} %"


def kernels() -> str:
    call, count, each = all_of(r"\n +41 +1e-03 +\d+ +(\d+) +(\d+) +([\d.]+)", result("profile_solver"))
    return f"At a tolerance of 1e-3, 41 wavelengths take {call:.0f} µs in {count:.0f} kernels of {each} µs each"


def corrected_order() -> str:
    rows = all_of(r"\n +0\.01 +(\S+) +(\S+)", result("auxiliary_order"))
    printed, corrected = rows[:2], rows[-2:]
    low, high = (round(p / c, -2) for p, c in zip(printed, corrected, strict=True))
    return f"its error is {low:.0f} to {high:.0f} times smaller"


def fixed_over_own_step() -> str:
    shares = all_of(r"here: fixed step over own step, decomposed" + r" +([\d.]+)%" * 6, result("paper_tables"))
    return f"fixed step over own step, both decomposed | 3.7-6.6 % | {min(shares):.0f}-{max(shares):.0f} %"


def walkers() -> str:
    plain = all_of(r"not compiled \S+ \((\d+)\)", result("emcee_speed"))
    one = all_of(r"one walker at a time \S+ \((\d+)\)", result("emcee_speed"))
    return (
        f"{min(plain):.0f} to {max(plain):.0f} times as fast as the same formulas called walker by walker, uncompiled, "
        f"and {min(one):.0f} to {max(one):.0f} times"
    )


def paths() -> str:
    """To two digits, as a time on a shared machine is worth."""
    both, neither = (
        all_of(rf"{words}[^\n]*? +([\d,]+) +\S+\n", result("many_flux_claims"))[0]
        for words in ("by symmetry, both", "for neither: 303")
    )
    return f"symmetry for both; for neither | {float(f'{both:.2g}'):.0f}; {float(f'{neither:.2g}'):.0f}"


def monitor() -> str:
    text = result("object_colour_figures").partition("Figure 16,")[2]
    mean, most = all_of(r"as read, black of \S+ cd/m2 +([\d.]+) mean, ([\d.]+) at most", text)
    return f"ray-traced with one bounce (figure 15) | {mean:.4f} | {most:.4f}"


def draws() -> str:
    """The first table of draws, of the paints as they are."""
    first = result("paper_rounding").partition("The paper's mean h")[0]
    (share,) = all_of(r"fixed step nearer in (\d+)% of all draws", first)
    return f"Over all pairs it is nearer in {share:.0f} %"


def pigments_first() -> str:
    (share,) = all_of(r"\nglazejax +\d+% +\d+/55 +(\d+)% +\d+/39", result("truth"))
    return f"of 39 tints and shades left out of the fit | {share:.0f} %"


def predicted() -> str:
    (median,) = all_of(r"median, all +\S+ +(\S+)", result("prediction"))
    return f"left out of the fit: median ΔE00 | {median:.1f} |"


def one_reading() -> str:
    mean, median = all_of(r"with it (\S+) \((\S+)\)", result("prediction"))
    return f"is predicted over black within {mean:.2f} on average and {median:.2f} in the median"


def studio() -> str:
    """Rows of the table; only they change from run to run."""
    rows = all_of(r"slider to swatch drawn, \d coats? +(\d+) +(\d+)", result("studio"))
    rows += all_of(r"touch of the brush to pixels +(\d+) +(\d+)", result("studio"))
    rows += all_of(r"all 512 x 512 pixels anew +(\d+) +(\d+)", result("studio"))
    names = ("new pixels, 1 coat", "3 coats", "8 coats", "a touch of the brush to pixels", "all 512 x 512 pixels anew")
    cells = [f"| {median:.0f} ms | {most:.0f} ms |" for median, most in zip(rows[::2], rows[1::2], strict=True)]
    first = "slider's event to the swatch's "
    return " ".join(
        f"| {first * (not i)}{name} {cell}" for i, (name, cell) in enumerate(zip(names, cells, strict=True))
    )


def studio_start() -> str:
    first, again = all_of(r"page usable ([\d.]+) s later", result("studio"))
    return f"The page is usable {again} s after it is opened, and {first} s the very first time"


def none_found() -> str:
    false, found = all_of(r"\nglazejax .*?\) +(\d+)% +(\d+)%", result("truth"))
    held, count = all_of(r"INTERVALS of fractions, [^:]*: (\d+)% of (\d+)", result("truth"))
    told = f"called 'none of these' though the paints are there | | {false:.0f} % |"
    told += " | 90 % intervals of fractions that hold the true one, where the first is right"
    told += f" | {held:.0f} % of {count:.0f} | |"
    return f"{told} | found to be none, with the family of the main paint taken out | | {found:.0f} % |"


def _painting_rows() -> list[list[str]]:
    return [line.split() for line in result("painting").splitlines() if re.match(r" +[\d,]+ +200 ", line)]


def mapped() -> str:
    seconds, memory = (float(_painting_rows()[-1][n]) for n in (6, 8))
    (same,) = all_of(r"same first set ([\d.]+)%", result("painting"))
    return f"first set as a full search says, 2000 pixels of a million | {seconds:.0f} s, {memory} GiB; {same} % |"


def maps() -> str:
    rows = [f"| {row[0]} | {row[6]} | {row[7]} | {row[8]} GiB |" for row in _painting_rows()]
    return " ".join(rows)


def map_beside_rivals() -> str:
    def row(name: str) -> str:
        found = next(line for line in result("painting").splitlines() if line.startswith(name))
        right, _, _, _, _, main, shares, _, false, seen, _ = found[len(name) :].split()
        cells = (f"{cell[:-1]} %" if cell.endswith("%") else cell for cell in (right, main, shares, false, seen))
        return " | ".join(cells)

    return f"| the map | {row('map_cube')} |"


def agreed() -> str:
    first, none = all_of(r"same first set ([\d.]+)%, same answer to 'none' ([\d.]+)%", result("painting"))
    return f"{first} % have the same first set and {none} % the same answer to 'none'"


def behind(written: str, now: str) -> float:
    """How many minor versions a result is older; another major version is more than any number of them."""
    (major, minor), (ours, today) = (map(int, words.split(".")[:2]) for words in (written, now))
    return today - minor if major == ours else float("inf")


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.txt")), ids=lambda path: path.stem)
def test_a_result_is_not_much_older_than_the_code(path):
    written = version_of(path.read_text())
    assert behind(written, glazejax.__version__) <= BEHIND, f"{path.name} is of {written}: run its benchmark again"


def test_a_result_says_when_and_by_which_version_it_was_written(tmp_path, capsys):
    results = Results("tried", tmp_path)
    results("a line")
    results.save()
    text = (tmp_path / "tried.txt").read_text()
    assert re.search(r"\nwritten \d{4}-\d\d-\d\d by glazejax \S+\n$", text)
    assert "; Python 3" in text
    assert version_of(text) == glazejax.__version__
    assert version_of("a result of old") == "0.1.0"
    assert behind("0.1.0", "0.3.0") == 2
    assert behind("0.9.0", "1.0.0") > 100


def test_none_grows_with_the_misfit_as_films_left_out_say():
    """The curve is not today's (see `log_odds_of_none`), but grows as that does, and lies lower by less than one."""
    intercept, slope = all_of(r"logistic curve, all films: (\S+) \+(\S+)", result("truth"))
    assert MISFIT[1] == pytest.approx(slope, abs=0.3)
    assert intercept - 1.0 < MISFIT[0] < intercept + 0.3


@pytest.mark.parametrize(
    ("document", "sentence"),
    [
        ("README.md", worst_over_tolerance),
        ("README.md", beside_cdisort),
        ("README.md", gradient),
        ("README.md", million),
        ("README.md", chart),
        ("README.md", posterior),
        ("docs/accuracy.md", chart_seconds),
        ("docs/accuracy.md", kernels),
        ("docs/accuracy.md", corrected_order),
        ("docs/accuracy.md", fixed_over_own_step),
        ("docs/accuracy.md", walkers),
        ("README.md", paths),
        ("docs/accuracy.md", monitor),
        ("docs/accuracy.md", draws),
        ("README.md", pigments_first),
        ("docs/accuracy.md", none_found),
        ("README.md", predicted),
        ("docs/accuracy.md", one_reading),
        ("README.md", mapped),
        ("docs/accuracy.md", maps),
        ("docs/accuracy.md", agreed),
        ("docs/accuracy.md", map_beside_rivals),
        ("docs/studio.md", studio),
        ("docs/studio.md", studio_start),
    ],
    ids=lambda value: value.__name__ if callable(value) else "",
)
def test_the_figure_is_that_of_its_result(document, sentence):
    wanted = sentence()
    assert wanted in words(document), f"{document} should say: {wanted}"
