"""Every number that README and docs say beside a link to a result is a figure of that result, or is exempt."""

import re
from pathlib import Path

import pytest
from benchmarks import figures

from tests.prose import Quoted, backing, beside_nothing, blocks, quoted, unbacked

ROOT = Path(__file__).parents[1]
# Not what a build of the site makes.
DOCUMENTS = ["README.md"] + [
    str(path.relative_to(ROOT))
    for path in sorted((ROOT / "docs").rglob("*.md"))
    if not {"_build", "project", "reference", "results"} & set(path.parts)
]
# What no result holds. Sizes and settings are those of the command that the text names.
EXEMPT = [
    (
        r"thickness 0 to 1e6, albedo 0 to 1|cosines down to 4e-4",
        "what tests/radiative try",
    ),
    (r"1 to 5 layers of optical thickness \.003 to 30, cosines from \.05", "benchmarks/calibrate_directions.py"),
    (r"\b[\d,]+(?: x [\d,]+)+\b", "sizes of pictures and tables"),
    (
        r"\b[\d,]+ (?:wavelengths|bands|layers|coats?|pixels|paints|patches|angles|directions|incidences|acrylics|"
        r"albedos|factors)\b",
        "sizes",
    ),
    (
        r"\b[\d,]+ paths\b|\b303\b|10 million pixels|\b41 (?=at Q)|41 times|\b[Aa]ll \d+\b|\bof 24\b|at most 4000",
        "sizes",
    ),
    (r"(?:from 2 to 40|8192 or more|24 stacks|some 200 points|every second of the 200)", "sizes"),
    (r"(?<![\d.])1e-?\d+\b", "tolerances asked for, which tests hold"),
    (r"\b(?:n|g|Q|dh) = [\d.]+", "settings"),
    (r"\b(?:index|indices) (?:of )?(?:exactly )?[\d.]+(?: to [\d.]+)?|all of 1 to 2\.5", "settings"),
    (
        r"smoothed to 60 nm|noise of \.\d+|scatter of strength of 20 %|films of 25 µm|coarsening to 0\.04|times 0\.1\b",
        "settings",
    ),
    (r"gammas \([\d., ]+\)|black \(0\.05 cd/m²\)|\b8 bits|24-bit", "settings"),
    (r"\b(?:90|95) % (?:intervals?|bands?|\|)", "what an interval or a quantile is to hold"),
    (r"\b\w+:\d+\b", "geometries and tints, such as 45:0 and 1:10"),
    (r"ΔE00 (?:1|0\.001)\b|more than \.02 |error no larger than \| 17 % \| 0\.1 %|above \.9|more than 3:", "limits"),
    (r"(?i)\b(?:figures?|tables?|section|order) \d+(?:\.\d+)?(?:(?:,| and| to) \d+)*", "parts of the papers"),
    (r"y = 0\.597|printed 0\.607", "the paper's primaries; benchmarks/object_colour_figures.py has both"),
    (r"commit \w+|Mitsuba 3|MaterialX 1\.39", "versions"),
    (r"Szirmay-Kalos 2001", "the year of a paper"),
    (r"\b(?:10|45|75)°|\b10 degrees\b|alpha \.\d\b|roughness 0\.2\b|64 pairs", "settings"),
    (r"\b[Vv]arnish of 1\.5|\b(?:paint|tint) of 1\.\d\b", "indices of benchmarks/layered_stacks.py"),
    (r"\.44 \(n 1\.3\) to \.70 \(n 1\.7\)", "Fresnel's formulas: K of even light inside, as the page gives it"),
    (r"1\.2 errors of 2e-4", "of other paths, followed once for one value"),
    (r"under 0\.05", "the file says 0.0"),
    (r"93 to 97 %", "of tests/fitting/test_recover.py"),
    (r"at 390\b", "a picture's width"),
]
PATTERNS = [pattern for pattern, _ in EXEMPT]


def text(document: str) -> str:
    return (ROOT / document).read_text()


@pytest.mark.parametrize("document", DOCUMENTS)
def test_numbers_beside_a_result_are_its_figures(document):
    found = unbacked(text(document), PATTERNS)
    assert not found, (
        "no figure of the linked results says so; `python -m benchmarks.figures` shows them. Change the text, link the "
        "result, or add the figure to benchmarks/figures_*.py:\n" + "\n".join(found)
    )


def test_every_number_of_accuracy_stands_beside_a_result():
    """That page says that it does; a number above the first link of its heading would be held by nothing."""
    assert not beside_nothing(text("docs/accuracy.md"), [*PATTERNS, r"Python [\d.]+ and jax [\d.]+"])
    assert beside_nothing("It takes 0.7 s.\n\n# Next\n\n" + f"It takes 0.6 s ({RESULTS}).") == [
        "0.7 s in: It takes 0.7 s...."
    ]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_figures_put_in_by_the_site_have_names(document):
    for name in re.findall(r"\{result\}`([^`]+)`", text(document)):
        assert name in figures.names()


@pytest.mark.parametrize("pattern", PATTERNS)
def test_nothing_is_exempt_for_no_reason(pattern):
    near = [block.text for document in DOCUMENTS for block in blocks(text(document))]
    assert any(re.search(pattern, block) for block in near), f"{pattern} stands nowhere now: take it off the list"


def test_most_changes_of_a_last_digit_are_seen():
    """What is not seen meets another figure of the same result, in the same unit; sentences of test_numbers.py help."""
    seen = []
    for document in DOCUMENTS:
        for block in blocks(text(document)):
            for number in quoted(block.text, PATTERNS):
                seen += [not backing(Quoted(other, number.unit), block.results) for other in neighbours(number.digits)]
    assert len(seen) > 600
    assert sum(seen) / len(seen) > 0.8


def neighbours(digits: str) -> list[str]:
    """The number one lower and one higher in its last digit: 0.61 and 0.63 of 0.62."""
    stem, e, power = digits.replace(",", "").partition("e")
    decimals = len(stem.partition(".")[2])
    others = (float(stem) + sign * 10.0**-decimals for sign in (-1, 1))
    return [f"{other:.{decimals}f}{e}{power}" for other in others if other >= 0]


RESULTS = "[table](benchmarks/results/scaling.txt)"


@pytest.mark.parametrize(
    ("markdown", "wrong"),
    [
        (f"A million stacks take 0.62 s and 0.8 GiB ({RESULTS}).", []),
        (f"A million stacks take 0.63 s and 0.8 GiB ({RESULTS}).", ["0.63 s"]),
        (f"A million stacks take 0.8 s ({RESULTS}).", ["0.8 s"]),  # that is the memory
        (f"Measured ({RESULTS}).\n\n| stacks | time |\n|---|---|\n| a million | 0.7 s |", ["0.7 s"]),
        (f"Measured ({RESULTS}).\n\n# Another heading\n\nIt takes 0.7 s.", []),
        (f"| a million | 0.7 s | {RESULTS} |\n| another | 5 s | |", ["0.7 s"]),
        (f"- It takes 0.7 s.\n- It takes 0.6 to 0.9 s ({RESULTS}).", ["0.9 s"]),
        (f"`0.45 s`, ![0.45](0.45.png), version-0.45, {{result}}`scaling.million_seconds` ({RESULTS}).", ["0.45"]),
    ],
)
def test_the_rule(markdown, wrong):
    assert [line.partition(" in: ")[0] for line in unbacked(markdown)] == wrong
