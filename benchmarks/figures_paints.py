"""Figures of paints: recipes, identification, maps, recovery and posteriors. See
`benchmarks.figures`.
"""

import re
from collections.abc import Callable

from benchmarks.figures import Reader, add, below, cell, found, least, most

# Recipes.
add(
    "colourchecker_recipes",
    ".1f s",
    first=found(r"at most: (\S+) s the first"),
    again=found(r"^(\S+) s again"),
)
add(
    "colourchecker_recipes",
    ".1f",
    magenta=cell("magenta", 0),
    largest=cell("3      2", 1, after="at most  "),
)
add("colourchecker_recipes", ".2f", median=cell("3      2", 0, after="at most  "))
add("colourchecker_recipes", ".0f", within_one=cell("3      2", 2, after="at most  "))

# Identification.
_FIRST = "FILMS LEFT OUT"
for _key, _row in (
    ("glazejax", "glazejax"),
    ("bands", "errors band by band, as before"),
    ("angle", "spectral angle, nearest film"),
    ("slope", "derivative of -log R, nearest film"),
    ("unmixing", "unmixing of -log R (NNLS)"),
    ("kubelka_munk", "Kubelka-Munk, the same paints"),
):
    add("truth", ".0f %", **{f"{_key}_mixtures": cell(_row, 2)})
add(
    "truth",
    ".0f",
    mixtures=found(rf"{_FIRST} \(\d+; (\d+) of several"),
    films=found(rf"{_FIRST} \((\d+);"),
    held_of=found(r"INTERVALS of fractions, [^:]*: \d+% of (\d+)"),
    not_none=lambda text: len(
        re.findall(r"^ +without: (?!.*nothing in the catalogue)", text, re.MULTILINE)
    ),
)
add(
    "truth",
    ".0f %",
    bands_false=cell("errors band by band, as before", 7),
    glazejax_films=cell("glazejax", 0),
    first_three=cell("glazejax", 4),
    none_false=cell("glazejax", 7),
    none_found=cell("glazejax", 8),
    curve_found=found(r"fitted without the film's family: (\d+)% found"),
    curve_false=found(r"fitted without the film's family: \d+% found, (\d+)% false"),
    held=found(r"INTERVALS of fractions, [^:]*: (\d+)% of"),
)
add("truth", ".3f", fraction_mean=cell("glazejax", 5), fraction_median=cell("glazejax", 6))
add("truth", ".1f", wrong_delta_e=found(r"off by Delta E00 (\S+) at most"))
for _key, _row in (
    ("noise", "noise of .01, untold"),
    ("varnish", "yellowed varnish, untold"),
    ("opaque", "over white, said to be opaque"),
    ("ground", "over white, ground told as .5"),
    ("all_wrong", "45:0, noise .005, varnish, said to be opaque"),
):
    add("truth", ".0f %", **{f"met_{_key}": cell(_row, 0)})


def _bin(n: int, part: int, scale: float = 1.0) -> Reader:
    """Bin `n` of the probabilities: what is stated, the share that is right, and how many."""

    def read(text: str) -> float:
        lines = below(text, "STATED -> TRUE").splitlines()
        row = next((line for line in lines if line.startswith("glazejax")), "")
        return float(re.findall(r"(\S+) -> (\S+) \((\d+)\)", row)[n][part]) * scale

    return read


for _n in range(1, 5):
    add("truth", ".2f", **{f"stated_{_n}": _bin(_n, 0)})
    add("truth", ".0f", **{f"count_{_n}": _bin(_n, 2)})
    if _n < 4:
        add("truth", ".0f %", **{f"true_{_n}": _bin(_n, 1, 100)})

for _key, _row in (("noise", "noise only"), ("errors", "and errors of 5 %")):
    add(
        "identification",
        ".0f",
        **{f"{_key}_rate": cell(_row, 1), f"{_key}_thorough_rate": cell(_row, 2)},
    )
    add("identification", ".1f %", **{f"{_key}_same": cell(_row, 3), f"{_key}_off": cell(_row, 4)})
    add("identification", ".1f %", **{f"{_key}_right": cell("both paints right:", 0, after=_row)})
for _key, _row in (
    ("two", "31 bands, two cards"),
    ("errors", "the same, errors of 5 %"),
    ("fine", "61 bands, white card"),
):
    add(
        "identification_speed",
        ".1f",
        **{f"{_key}_before": cell(_row, 3), f"{_key}_now": cell(_row, 4)},
    )
    add(
        "identification_speed",
        ".1f %",
        **{f"{_key}_same": cell(_row, 6), f"{_key}_off": cell(_row, 7)},
    )
add("few_bands", ".0f", taken=cell("bands that are taken", 0))
add("few_bands", ".0f %", same=cell("the same first set", 0))
_OFF = "a paint's probability off by more than .02, at most"
add("few_bands", ".0f %", off=cell(_OFF, 0))
add("few_bands", ".2f", largest=cell(_OFF, 1))
add("identification", ".0f", triples_rate=found(r"Sets of three too.*: (\d+) a second"))
add(
    "identification",
    ".1f %",
    shades=cell("as measured        offset and strength free", 4, 100),
)
add(
    "identification",
    ".0f %",
    shades_angle=cell("as measured        nearest spectral angle", 4, 100),
    shades_smoothed=cell("smoothed to 60 nm  offset and strength free", 4, 100),
    cards=cell("offset and strength free", 4, 100, after="across cards"),
    cards_angle=cell("nearest spectral angle", 4, 100, after="across cards"),
    cards_slope=cell("angle of the slope of -log R", 4, 100, after="across cards"),
)

# Maps.
for _key, _row in (("small", "99,856"), ("million", "1,000,000"), ("large", "9,998,244")):
    add("painting", ",.0f", **{f"{_key}_pixels": found(rf"^ +({_row}) ")})
    add("painting", ".1f s", **{f"{_key}_seconds": cell(_row, 5)})
    add("painting", ".0f", **{f"{_key}_rate": cell(_row, 6)})
    add("painting", ".2f GiB", **{f"{_key}_memory": cell(_row, 7)})
add("painting", ".0f times", saved=cell("9,998,244", 10))
add("painting", ".2f %", searched=cell("9,998,244", 9))
add(
    "painting",
    ".1f %",
    same_set=found(r"same first set (\S+)%,"),
    same_none=found(r"same answer to 'none' (\S+)%"),
)
add(
    "painting",
    ".1f times",
    averaged=lambda text: (
        found(r"and (\S+) ms at every second")(text) / found(r"took (\S+) ms a pixel")(text)
    ),
)
add(
    "painting",
    ".3f",
    probability_median=found(r"differs by (\S+) in the median"),
    probability_most=found(r"by (\S+) in nine of ten"),
    thickness_median=found(r"thickness by (\S+) and"),
    thickness_most=found(r"thickness by \S+ and (\S+) of"),
)
for _key, _row in (
    ("angle", "spectral angle, and pairs"),
    ("nnls", "NNLS in R"),
    ("nnls_log", "NNLS in -log R"),
    ("opaque", "Kubelka-Munk, opaque"),
    ("film", "Kubelka-Munk, film on ground"),
    ("map", "map_cube"),
):
    _cells = {"right": 0, "main": 5, "false": 8, "found": 9}
    add(
        "painting",
        ".1f %",
        **{f"{_key}_{_what}": cell(_row, _column) for _what, _column in _cells.items()},
    )
    add("painting", ".3f", **{f"{_key}_shares": cell(_row, 6)})
add("painting", ".0f %", map_two_coats=cell("map_cube", 2))
for _key, _row in (
    ("pairs", "spectral angle, and pairs"),
    ("film", "Kubelka-Munk, film on ground"),
    ("map", "map_cube"),
    ("edges", "map_cube, off edges"),
):
    add(
        "painting_mosaic",
        ".0f %",
        **{
            f"{_key}_right": cell(_row, 0),
            f"{_key}_pigments": cell(_row, 4),
            f"{_key}_false": cell(_row, 8),
            f"{_key}_found": cell(_row, 9),
        },
    )
add(
    "painting_mosaic",
    ".0f",
    films=found(r"bands: (\d+) measured"),
    foreign=found(r"white card, (\d+) of them"),
    paints=found(r"The (\d+) paints"),
)
add(
    "painting_spots",
    ".0f",
    offered=found(r"paints offered: (\d+) of"),
    paints=found(r"paints offered: \d+ of (\d+)"),
)
for _key, _row in (
    ("viridian", "ViridianGreen"),
    ("cochineal", "Cochineal"),
    ("emerald", "EmeraldGreen"),
):
    add(
        "painting_spots",
        ".0f %",
        **{f"{_key}_none": cell(_row, 1), f"{_key}_again": cell(_row, 2)},
    )
for _key, _row in (
    ("two", "two coats"),
    ("foliage", "foliage in light"),
    ("robe", "red robe"),
    ("mantle", "blue mantle"),
):
    add(
        "painting_coats",
        ".0f %",
        **{
            f"{_key}_upper": cell(_row, 2, after="chance of"),
        },
    )
add(
    "painting_coats",
    ".0f %",
    sets=cell("map_cube, 2 coats", 2),
    sets_of_one=cell("map_cube, 1 coat", 2),
    mantle_chance=cell("blue mantle", 4, after="chance of"),
)
add("painting_coats", ".1f times", longer=found(r"([\d.]+) times as long"))
add(
    "coats_told",
    ".0f %",
    search=cell("errors of paints, the map's search", 3),
    near=cell("errors of paints, near and true", 3),
    known_near=cell("paints known exactly, near and true", 3),
    known_among=cell("paints known exactly, near and true", 4),
    expected=cell("24 and 40 stacks of 2 and 3 paints", 3),
)
add("coats_told", ".2f", mean=cell("24 and 40 stacks of 2 and 3 paints", 0))

# Catalogue and recovery.
add(
    "acrylics",
    ".1f",
    tints_1=cell("mean", 2),
    tints_100=cell("mean", 5),
    black=cell("mean", 6),
    white=cell("mean", 7),
)
add("acrylics", ".1f", most=most(*(cell("max", k) for k in range(8))))
_READINGS = {
    "white": "black by the reading over white",
    "black": "white by that over black",
}
add(
    "prediction",
    ".2f",
    fitted=cell("all               39 films", 0),
    left_out=cell("all               39 films", 1),
    kubelka_munk=cell("all               39 films", 3),
    simulated=cell("0%", 0, after="scatter of strength"),
    simulated_median=cell("0%", 1, after="scatter of strength"),
    scattered=cell("20%", 0, after="scatter of strength"),
    correlation=cell("rank correlation of said and true errors", 0),
)
add(
    "prediction",
    ".1f",
    median=cell("median, all", 1),
    kubelka_munk_median=cell("median, all", 3),
    said=cell("Delta E00 that the predictions say of themselves", 0),
    simulated_said=cell("0%", 2, after="scatter of strength"),
)
add(
    "prediction",
    ".0f %",
    in_band=cell("readings within the 90 % band", 0),
)
add(
    "prediction",
    ".0f",
    films=found(r"^all +(\d+) films"),
)
_OPTICS = {"": "glazejax", "km_": "Kubelka-Munk"}
_GIVEN = {given: f"read over {given}" for given in ("white", "black", "both")}
add(
    "prediction_readings",
    ".2f",
    **{
        f"{card}_{what}": found(rf"^glazejax, {line}: {words}")
        for card, line in _READINGS.items()
        for what, words in (
            ("without", r"without it (\S+) \("),
            ("without_median", r"without it \S+ \((\S+)\)"),
            ("rank", r".*%, (\S+);"),
        )
    },
    **{
        f"{short}{card}_{what}": found(rf"^{optics}, {line}: .* with it {words}")
        for short, optics in _OPTICS.items()
        for card, line in _READINGS.items()
        for what, words in (("with", r"(\S+) \("), ("with_median", r"\S+ \((\S+)\)"))
    },
    **{
        f"{short}{what}_{given}_median": found(rf"^{optics}, {line}, {read}: \S+ \((\S+?)\)")
        for short, optics in _OPTICS.items()
        for what, line, readings in (
            ("another", "another film", {"nothing": "nothing read", **_GIVEN}),
            ("twice", "twice as thick", _GIVEN),
        )
        for given, read in readings.items()
    },
    **{
        f"other_{card}_median": found(rf"^glazejax, the other card, {line}: \S+ \((\S+)\)")
        for card, line in _READINGS.items()
    },
    least_median=found(r"^glazejax, twice as thick, all known .*: \S+ \((\S+)\)"),
)
add(
    "prediction_readings",
    ".1f",
    another_gain=found(r"^glazejax, another film, read over both: .* without \+?(\S+) "),
    another_error=found(r"^glazejax, another film, read over both: .* \+- (\S+)"),
)
add(
    "prediction_readings",
    ".0f %",
    **{
        f"{short}{card}_inside": found(rf"^{optics}, {line}: .*, (\S+)%,")
        for short, optics in _OPTICS.items()
        for card, line in _READINGS.items()
    },
    twice_both_inside=found(r"^glazejax, twice as thick, read over both: .*, (\S+)%"),
)
add(
    "prediction_readings",
    ".0f",
    pairs=found(r"^glazejax, another film, nothing read: .*; (\d+) pairs"),
    **{
        f"{card}_above": found(rf"^glazejax, {line}: .*; (\d+) of \d+ above 3")
        for card, line in _READINGS.items()
    },
)

# Own tubes.
_TUBES = [
    "d:8, both cards, bare cards too",
    "de:8, both cards, bare cards too",
    "45:0, both cards, bare cards too",
]
_ONE, _OPAQUE = "45:0, over white only, card not measured", "d:8, opaque films"
_known = [cell(row, k) for row in _TUBES for k in (0, 1)]
add(
    "tubes",
    ".0f %",
    held_least=least(*_known),
    held_most=most(*_known),
    one_card_k=cell(_ONE, 0),
    one_card_s=cell(_ONE, 1),
    in_band=cell("mean", 2, after="Measured tubes"),
    untold_k=cell("d:8, told nothing", 1),
    untold_s=cell("d:8, told nothing", 2),
    usual_k=cell("d:8, told .0005 + .002 R", 1),
    usual_s=cell("d:8, told .0005 + .002 R", 2),
    told_k=cell("d:8, told .002", 1),
    told_s=cell("d:8, told .002", 2),
)
add(
    "tubes",
    ".1f",
    tint=cell(_TUBES[0], 2),
    one_card_tint=cell(_ONE, 2),
    opaque_tint=cell(_OPAQUE, 2),
    measured=cell("mean", 0, after="Measured tubes"),
    measured_median=cell("median", 0, after="Measured tubes"),
    joint=cell("mean", 3, after="Measured tubes"),
    joint_median=cell("median", 3, after="Measured tubes"),
)
add(
    "tubes",
    ".2f s",
    entry_seconds=found(r"in a running process: (\S+) s"),
    advice_seconds=found(r"what to measure next: (\S+) s"),
)

# Coats of a brush.
_LEARNT, _LAST = "glazejax, learnt from the others", "the same as the last coat"
_FILMLIKE, _FORMULA = "glazejax, as any film", "Kubelka-Munk, learnt from the others"
for _key, _after in (("", "Simulated by glazejax"), ("chart_", "Chart of pigments")):
    for _name, _row in (("", _LEARNT), ("film_", _FILMLIKE), ("km_", _FORMULA), ("same_", _LAST)):
        add(
            "ladders",
            ".1f",
            **{
                f"{_key}{_name}{_what}": cell(_row, _column, after=_after)
                for _column, _what in enumerate(("second", "third", "both"))
            },
        )
add(
    "ladders",
    ".0f %",
    held=cell(_LEARNT, 3, after="Simulated by glazejax"),
    chart_held_second=cell(_LEARNT, 3, after="Chart of pigments"),
    chart_held_both=cell(_LEARNT, 5, after="Chart of pigments"),
)

# Posteriors.
_FILM, _BANDS = (
    ("thickness", "gloss", "model error", "fraction"),
    ("absorption", "scattering", "ratio"),
)
for _key, _rows in (("", _FILM), ("bands_", _BANDS)):
    _held = [cell(row, 1) for row in _rows]
    add("coverage", ".0f %", **{f"{_key}least": least(*_held), f"{_key}most": most(*_held)})
_trusted = [cell(row, 3) for row in _FILM]
add("coverage", ".0f", films=found(r"on (\d+) simulated"))
add("coverage", ".0f %", trusted_least=least(*_trusted), trusted_most=most(*_trusted))
_COATS = [
    cell(row, 2) for row in ("thickness of coat 1", "fraction 1 of coat 2", "thickness of coat 2")
]
add(
    "layers_inverted",
    ".0f %",
    all=cell("all", 2),
    all_error=cell("all", 4),
    coats_least=least(*_COATS),
    coats_most=most(*_COATS),
    model=cell("model error", 2),
    model_error=cell("model error", 4),
    laplace=cell("all", 8),
    laplace_error=cell("all", 10),
    trusted=cell("all", 11),
    trusted_error=cell("all", 13),
    trusts=cell("all", 14),
)
add("layers_inverted", ".0f", stacks=found(r"a body of two, (\d+) stacks"), cases=cell("all", 0))
for _key, _words in (
    ("two_grounds", "one, two grounds"),
    ("one_ground", "one, one ground"),
    ("shelf", "of the catalogue, two"),
):
    add(
        "layers_inverted",
        ".0f %",
        **{_key: cell("all", 2, after=_words), f"{_key}_error": cell("all", 4, after=_words)},
    )
for _key, _words in (
    ("two_grounds", "two grounds: "),
    ("one_ground", "one ground: "),
    ("film", "film: "),
    ("bands", "bands: "),
    ("coats", "coats: "),
):
    add(
        "calibration_ranks",
        ".0f %",
        **{
            _key: found(_words + r"[\s\S]*?\nall\s+\d+\s+(\d+)%"),
            f"{_key}_error": found(_words + r"[\s\S]*?\nall\s+\d+\s+\d+% \+- (\d+)%"),
        },
    )
add("calibration_ranks", ".0f", films=found(r"two grounds: (\d+) films"))
_MET = r"one ground: [\s\S]*?R-hat: below 1\.05 in (\d+)%"
_APART = r"one ground: [\s\S]*?R-hat: below 1\.05 in \d+% of films, median ([\d.]+)"
add("calibration_ranks", ".0f %", one_ground_met=found(_MET))
add("calibration_ranks", ".2f", one_ground_apart=found(_APART))


_UNKNOWN = r"a coat of unknown paint, two grounds\n[\s\S]*?\n"
for _key in ("hmc", "emcee", "aies"):
    _row = _UNKNOWN + _key + r"\s+[\d.]+\s+\d+\s+"
    add("samplers", ".0f", **{f"{_key}_rate": found(_row + r"(\d+)")})
    add("samplers", ".2f", **{f"{_key}_apart": found(_row + r"\d+\s+([\d.]+)")})


def _walkers(pattern: str, choose: Callable[[list[float]], float]) -> Reader:
    """Of all runs, over vectorised."""
    return lambda text: choose([float(n) for n in re.findall(pattern + r" \S+ \((\d+)\)", text)])


for _key, _words in (("uncompiled", "not compiled"), ("one", "one walker at a time")):
    add(
        "emcee_speed",
        ".0f times",
        **{f"{_key}_least": _walkers(_words, min), f"{_key}_most": _walkers(_words, max)},
    )

# Pigments in anybody's paint.


def _bench(task: str, source: str, method: str, column: int) -> Reader:
    """A share of the bench of real paint, of a task's row: columns are counted from 1."""
    others = r"(?:[\d.]+% \(\d+%-\d+%\) +)" * (column - 1)
    return found(rf"(?s)^{task} +n .*?^{source} +{method} +\d+ +{others}([\d.]+)%")


for _key, _task, _source in (
    ("hyperdoc", "PIGMENT", "hyperdoc"),
    ("chart", "PIGMENT", "hyppigments"),
    ("acrylics", "PIGMENT", "kimera"),
    ("visible", "PIGMENT_VISIBLE", "hyperdoc"),
):
    add(
        "paintbench",
        ".0f %",
        **{
            f"{_key}_first": _bench(_task, _source, "glazejax", 1),
            f"{_key}_three": _bench(_task, _source, "glazejax", 2),
            f"{_key}_neighbour": _bench(_task, _source, "slopes of both", 1),
            f"{_key}_classifier": _bench(_task, _source, "linear classifier", 1),
        },
    )
add(
    "paintbench",
    ".0f %",
    none_found=_bench("NONE", "hyperdoc", "glazejax", 1),
    none_false=_bench("NONE", "hyperdoc", "glazejax", 2),
    mixed_bath=_bench("MIXTURE", "bath", "glazejax", 1),
    mixed_grillini=_bench("MIXTURE", "grillini", "glazejax", 1),
    own_pure=_bench("PIGMENT_OWN", "revigo", "glazejax", 1),
    own_mixed=_bench("MIXTURE_OWN", "revigo", "glazejax", 1),
)


for _key, _source, _method in (
    ("own", "hyperdoc", "glazejax, its own binder"),
    ("visible", "hyperdoc", "glazejax, 410-700 nm"),
    ("other", "hyperdoc", "glazejax, another binder"),
    ("probe", "bath", "glazejax, its own binder"),
):
    add(
        "paintbench_coats",
        ".0f %",
        **{
            f"{_key}_right": _bench("COATS", _source, _method, 1),
            f"{_key}_decided": _bench("COATS", _source, _method, 2),
            f"{_key}_right_decided": _bench("COATS", _source, _method, 3),
        },
    )
add(
    "paintbench_coats",
    ".0f %",
    neighbour=_bench("COATS", "hyperdoc", "nearest by derivative", 1),
    probe_neighbour=_bench("COATS", "bath", "nearest by derivative", 1),
)
add(
    "pigment_speed",
    ".1f s",
    first_use=found(r"first use.*all pigments +(\S+)"),
    thousand=found(r"1000 spectra of 61 bands.*: +(\S+) set up"),
    fine=found(r"10 spectra of 2151 bands.*: +(\S+) set up"),
)
