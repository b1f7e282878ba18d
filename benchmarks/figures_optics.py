"""Figures of the solver, the three papers and the studio: where each stands in its result file, and
how it is said.

See `benchmarks.figures`. Numbers are said as the first sentence that quotes them says them; others
may round further.
"""

import re
from collections.abc import Callable

from benchmarks.figures import Reader, add, below, cell, found, least, most, number, one_over, ratio


def _worst_over_tolerance(text: str) -> float:
    """Of each setting a row has the number of directions and two errors over the tolerance."""
    rows = [line.split()[1:] for line in text.splitlines() if line.startswith("1e-")]
    return max(float(error) for row in rows for error in (*row[1::3], *row[2::3]))


# The solver.
add("calibrate_directions", ".2f", worst=_worst_over_tolerance)
add("calibrate_directions", ".0f", stacks=found(r"over (\d+) stacks"))


def _times_ours(words: str, error: str) -> Reader:
    """The file has our time over theirs."""
    return one_over(found(rf"{words} +at {error} +(\S+)"))


for _key, _words in (
    ("cdisort", "CDISORT without surface"),
    ("sasktran2", "sasktran2, one mode"),
    ("sasktran2_all_modes", "sasktran2, all modes"),
):
    add(
        "frontier",
        "2s",
        **{
            f"{_key}_1e4": _times_ours(_words, "1e-04"),
            f"{_key}_1e8": _times_ours(_words, "1e-08"),
        },
    )
_GRADIENT = found(r"value and gradient / value +tol. 1e-06 +(\S+)")
add("frontier", ".2g times", alone=one_over(_GRADIENT))
add(
    "frontier",
    ".1f times",
    gradient=_GRADIENT,
    gradient_most=found(r"value and gradient / value, largest over tolerances +(\S+)"),
)
add(
    "frontier",
    ".0f times",
    conventional=one_over(found(r"glazejax / conventional at dh = .01, .* (\S+) +<= ")),
    conventional_errors=ratio(found(r"errors \S+ (\S+)$"), found(r"errors (\S+), \S+$")),
)

for _key, _row in (
    ("1e2", "0.01"),
    ("1e4", "0.0001"),
    ("1e6", "1e-06"),
    ("1e8", "1e-08"),
    ("1e10", "1e-10"),
):
    add(
        "frontier",
        ".0e",
        **{f"error_{_key}": cell(f"glazejax n = 1.5                     {_row}", 0)},
    )
    for _what, _name in (
        ("value", "glazejax n = 1.5          "),
        ("slopes", "glazejax n = 1.5, gradient"),
    ):
        add("frontier", ".2f ms", **{f"{_what}_{_key}": cell(f"{_name}           {_row}", 1)})


def _times_of(program: str, choose: Callable[[list[float]], float]) -> Reader:
    """Of a program's settings, the times over ours at equal error, the last column."""
    return lambda text: choose(
        [number(x) for x in re.findall(rf"^(?:{program}) .* (\S+)$", text, re.MULTILINE)]
    )


for _key, _program in (
    ("auxiliary", 'method="auxiliary"'),
    ("paper", "paper A,|fixed step, corrected"),
):
    add(
        "frontier",
        "1s times",
        **{f"{_key}_least": _times_of(_program, min), f"{_key}_most": _times_of(_program, max)},
    )

for _key, _range in (
    ("layers", "2 to 40"),
    ("wavelengths", "251 to 4001"),
    ("stacks", "10000 to 1000000"),
    ("pixels", "65536 to 1048576"),
):
    add("scaling", ".2f", **{f"{_key}_power": found(rf"exponent from {_range}: glazejax ([\d.]+)")})
add("scaling", ".2f ms", layers_40=cell("40", 0))
add("scaling", ".0f ms", layers_40_cdisort=cell("40", 2))
add("scaling", ".2f s", million_single=cell("1000000", 3, 1e-3))
add(
    "scaling",
    ".1f s",
    million_seconds=cell("1000000", 0, 1e-3),
    million_slopes=cell("1000000", 2, 1e-3),
)
add(
    "scaling",
    ".1f GiB",
    million_memory=cell("1000000", 1, 1 / 1024),
    one_memory=cell("1", 1, 1 / 1024, "stacks of 2 l"),
)
add(
    "scaling",
    ".2f GiB",
    pixels_memory=cell("1048576", 1, 1 / 1024),
    pixels_few_memory=cell("4096", 1, 1 / 1024),
)
add("profile_solver", ".1f µs", kernel=cell("41     1e-03", 3))
add("profile_solver", ".0f", kernels=cell("41     1e-03", 2))
_COMES, _KEPT = "as JAX comes", "not handed to a thread"
add(
    "profile_solver",
    ".1f times",
    hand_over=ratio(cell(_COMES, 1), cell(_KEPT, 1)),
    call=ratio(cell(_COMES, 0), cell(_COMES, 1)),
)
add("savings", ".2f s", picture=found(r"seconds: (\S+),"))
add("savings", ".1f s", picture_first=found(r"the first time (\S+) with"))
add("savings", ".2f GiB", picture_memory=found(r"peak memory of the process: (\S+) GiB"))
add("savings", ".0f s", pixel_by_pixel=found(r"pixel by pixel it would take (\S+) s"))
add("savings", ".3f", delta_e_most=found(r"Delta E00 from that.* max (\S+)"))

# The first second.
for _key, _row in (
    ("render", "render"),
    ("recover", "recover"),
    ("identify", "identify"),
    ("recipe", "recipe --srgb"),
):
    _columns = {"empty": 0, "again": 1, "trace": 5, "compile": 7, "again_load": 10}
    add("cold_start", ".1f s", **{f"{_key}_{what}": cell(_row, k) for what, k in _columns.items()})
    add("cold_start", ".2g times", **{f"{_key}_over": ratio(cell(_row, 1), cell(_row, 0))})

# Paper A.
_PAIRS = ("a/b", "a/c", "a/d", "b/c", "b/d", "c/d")


def _of_pair(row: str, pair: str, after: str = "") -> Reader:
    """The number in a pair's column: the nearest line of pairs' names above the row says which it
    is.
    """

    def read(text: str) -> float:
        names: list[str] = []
        for line in below(text, after).splitlines():
            if set(line.split()) & set(_PAIRS):
                names = [word for word in line.split() if word in _PAIRS]
            # Means may have a variance in brackets beside them.
            if line.strip().startswith(row):
                pieces = [
                    piece for piece in line.strip()[len(row) :].split() if not piece.startswith("(")
                ]
                return number(pieces[names.index(pair)])
        raise ValueError(f"no line begins with {row!r}" + f" below {after!r}" * bool(after))

    return read


_OVER = {
    "own": "here: fixed step over own step, decomposed",
    "own_counted": "here: fixed step, table counted over own step, decomposed",
    "conventional": "here: fixed step over conventional",
    "conventional_counted": "here: fixed step, table counted over conventional",
    "own_over_conventional": "here: own step, decomposed over conventional",
    "paper": "paper: fixed step over own step, decomposed",
}
for _key, _row in _OVER.items():
    _pairs = [_of_pair(_row, pair) for pair in _PAIRS]
    _style = ".0f %" if _key.startswith("own") else ".1f %"
    add("paper_tables", _style, **{f"{_key}_least": least(*_pairs), f"{_key}_most": most(*_pairs)})
for _key in ("own", "own_counted", "conventional"):
    _pairs = [_of_pair(_OVER[_key], pair, "The same with a thicker yellow") for pair in _PAIRS[:3]]
    _style = ".0f %" if _key.startswith("own") else ".1f %"
    add(
        "paper_tables",
        _style,
        **{f"{_key}_thicker_least": least(*_pairs), f"{_key}_thicker_most": most(*_pairs)},
    )
add("paper_tables", ".0f %", own_together=found(r"counted once: .* (\S+)% of the time of all"))
add("paper_tables", ".1f", scattering_factor=found(r"known to a factor of (\S+)"))
_FIXED_STEP, _COARSENED = "fixed step .01", "coarsened to own step .04"
add(
    "paper_tables",
    ".3f",
    ac_fixed=_of_pair(f"here: {_FIXED_STEP}", "a/c"),
    ac_coarse=_of_pair(f"here: {_COARSENED}", "a/c"),
)
add(
    "paper_tables",
    ".3f",
    ac_fixed_thicker=_of_pair(f"here: {_FIXED_STEP}", "a/c", "The same with a thicker yellow"),
    ac_coarse_thicker=_of_pair(f"here: {_COARSENED}", "a/c", "The same with a thicker yellow"),
)
add("paper_tables", ".3f", bc_fixed=_of_pair(f"here: {_FIXED_STEP}", "b/c"))
add("paper_tables", ".4f", bc_paper=_of_pair(f"paper: {_FIXED_STEP}", "b/c"))
add("paper_tables", ".2f", ab_coarse_paper=_of_pair(f"paper: {_COARSENED}", "a/b"))
add("paper_tables", ".0f", default_errors=one_over(found(r"error ratio (\S+)")))
add(
    "paper_tables",
    ".2f %",
    default_time=found(r"time ratio +(\S+)%"),
    default_time_one_by_one=found(r"time ratio .*; (\S+)%"),
)
_shares = {k: (cell("0.01", k), cell("0.04", k)) for k in (1, 3, 4)}
for _k, _key in ((1, "assembly"), (3, "fixed"), (4, "without")):
    add(
        "paper_shares",
        ".0f %",
        **{f"{_key}_least": least(*_shares[_k]), f"{_key}_most": most(*_shares[_k])},
    )
add(
    "paper_shares",
    ".0f %",
    hundred=cell("0.01     100           1", 4),
    angles=cell("0.01      10          18", 4),
    paper=found(r"assembly takes at least (\d+)%"),
)
for _key, _row in (("q120_401", "Q  120, 401 x  1 stacks"), ("q500", "Q  500,  41 x  1 stacks")):
    add(
        "auxiliary_products",
        ".0f ms",
        **{f"{_key}_one": cell(_row, 3), f"{_key}_fft": cell(_row, 9)},
    )
_SLOPES = "The same with derivatives"
add(
    "auxiliary_products",
    ".0f ms",
    slopes_one=cell("Q  120,  41 x  1 stacks", 3, after=_SLOPES),
    slopes_fft=cell("Q  120,  41 x  1 stacks", 9, after=_SLOPES),
)
add(
    "auxiliary_products",
    ".1f MB",
    **{
        f"q500_mb_{_key}": cell("Q  500,  41 x  1 stacks", k)
        for k, _key in ((12, "one"), (13, "all"), (14, "fft"))
    },
)
add("auxiliary_products", ".0e", apart=cell("Q  120,  41 x  1 stacks", 13, after=_SLOPES))
for _key, _words in (("printed", "fixed step, as printed"), ("corrected", "fixed step, corrected")):
    add("auxiliary_order", ".1f", **{f"{_key}": found(rf"{_words}: order (\S+)")})
for _k, _key in ((0, "rms"), (1, "largest")):
    add(
        "auxiliary_order",
        "1s times",
        **{
            f"times_smaller_{_key}": ratio(
                cell("0.01", _k, after="fixed step, as printed"),
                cell("0.01", _k, after="fixed step, corrected"),
            )
        },
    )


def _ends(what: str, pair: str, after: str = "") -> tuple[Reader, Reader]:
    """Least and most of a pair's draws, of cells such as 0.0018-0.1976 in the row below that of the
    medians.
    """

    def read(text: str, end: int) -> float:
        table = below(text, after)
        heads = (
            line.split()
            for line in table.splitlines()
            if "/" in line and set(line.split()) <= set(_PAIRS)
        )
        names = next(heads, [])
        row = below(table, f"here: {what}, median").splitlines()[1]
        return number(row.partition("draws")[2].split()[names.index(pair)].split("-")[end])

    return lambda text: read(text, 0), lambda text: read(text, 1)


_draws = {
    "ac": _ends(_FIXED_STEP, "a/c", "Table 4 again"),
    "bc": _ends(_FIXED_STEP, "b/c", "Table 4 again"),
    "bc_thick": _ends(_FIXED_STEP, "b/c", "With paints as thick"),
}
for _key, (_low, _high) in _draws.items():
    add("paper_rounding", ".4f", **{f"{_key}_least": _low, f"{_key}_most": _high})
_low, _high = _ends(_COARSENED, "a/b", "Table 4 again")
add("paper_rounding", ".2f", ab_coarse_least=_low, ab_coarse_most=_high)
for _key, _after in (
    ("within", "Table 4 again"),
    ("within_thick", "the first of the pair on top"),
    ("within_swapped", "the second of the pair on top"),
    ("within_thicker", "With a thicker yellow"),
):
    add(
        "paper_rounding",
        ".0f",
        **{_key: found(r"numbers (\d+) lie within the draws", after=_after)},
    )
add(
    "paper_rounding",
    ".0f",
    draws=found(r"times 0.96 to 1.04, (\d+) draws"),
    ac_nearer=cell("fixed step nearer, of the draws", 3),
)
add("paper_rounding", ".0f %", all_nearer=found(r"fixed step nearer in (\d+)% of all draws"))
add(
    "paper_rounding",
    ".3f",
    rounded_apart=most(
        *(_of_pair("fixed step .01 from the default solver with both", pair) for pair in _PAIRS)
    ),
)
for _key, _paint in (("b", "vermilion"), ("a", "lead_tin")):
    add(
        "paper_rounding",
        ".1f times",
        **{
            f"{_paint}_thickness": ratio(
                found(rf"^ .*\b{_key} ([\d.]+)"), found(rf"here: .*\b{_key} ([\d.]+)")
            )
        },
    )

# Paper B.
for _key, _words in (
    ("spheres", "Figure 10: a line"),
    ("copper", "Figure 14: copper"),
    ("planes", "Figure 16, 42"),
):
    _row = "two tables, monitor as read, black of 0.05 cd/m2"
    add(
        "object_colour_figures",
        ".4f",
        **{
            f"{_key}_mean": cell(_row, 0, after=_words),
            f"{_key}_most": cell(_row, 2, after=_words),
        },
    )
add(
    "object_colour_figures",
    ".4f",
    chips_mean=found(r"two tables, monitor as read.*xy (\S+) mean"),
    chips_most=found(r"two tables, monitor as read.*xy \S+ mean, (\S+) at"),
    planes_misprint=cell("the same, T from y of green .607 as printed", 0, after="Figure 16, 42"),
)
add(
    "object_colour_figures",
    ".3f",
    spheres_one_table=cell("one table of 256, monitor known exactly", 2, after="Figure 10: a"),
)
add(
    "object_colour_figures",
    ".1f %",
    matrix=found(r"largest difference (\S+)% of the largest number"),
    chips_luminance=found(r"two tables, monitor as read.*Y off (\S+)% mean"),
    chips_luminance_most=found(r"two tables, monitor as read.*Y off \S+% mean, (\S+)% at"),
)
add(
    "scene_speed",
    ".1f s",
    first=found(r"first, with compilation: (\S+) s"),
    again=found(r"again: (\S+) s"),
)
add("scene_speed", ".0f %", left_out=found(r"left out: (\d+)%"))

# Paper C.
add(
    "manyflux_speed",
    ".0f times",
    fine=found(r"over glazejax at an error of \S+: (\S+) times"),
    coarse=found(r"over glazejax at an error of \S+: (\S+) times(?!.*\n.*over glazejax)"),
)
add(
    "manyflux_speed",
    ".1e",
    fine_error=found(r"over glazejax at an error of (\S+):"),
    coarse_error=found(r"over glazejax at an error of (\S+): \S+ times(?!.*\n.*over glazejax)"),
)
for _key, _words in (
    ("paper", "as the paper counts: paths 303, fluxes by symmetry"),
    ("both", "by symmetry, both: 13 incidences"),
    ("neither", "for neither: 303 incidences"),
    ("matrix", "for neither, fluxes as all cells of one matrix"),
):
    add("many_flux_claims", "2s", **{_key: cell(_words, 0)})
    add("many_flux_claims", ".0e", **{f"{_key}_scaled": cell(_words, 1)})
_MORE = [cell(order, 1, after="order   full") for order in "123"]
add(
    "many_flux_claims",
    ".0f %",
    path_error=found(r"paths: error (\S+)% with"),
    order_0_full=cell("0", 0, after="order   full"),
    order_1_full=cell("1", 0, after="order   full"),
    inverse_diagonal=cell("inverse", 1, after="order   full"),
    order_0_diagonal=cell("0", 1, after="order   full"),
    order_more_least=least(*_MORE),
    order_more_most=most(*_MORE),
    series_saves=lambda text: 100 - found(r"inverse 100%, order 0 (\d+)%")(text),
)
add("many_flux_claims", ".2f s", path_seconds=found(r"paths: (\S+) s a direction"))
add("many_flux_claims", ".1f s", matrix_seconds=found(r"no symmetry at all: (\S+) s"))
_RATIOS = [cell(f"{n} directions on the half circle:", 4) for n in (16, 24, 32, 34, 36, 48, 64)]
add("many_flux_claims", ".0f", plane_ratio_least=least(*_RATIOS), plane_ratio_most=most(*_RATIOS))
add("many_flux_claims", ".1f", paper_ratio=found(r"paper: .* ratio (\S+) \("))
add("many_flux_claims", ".2f %", paper_order_0=found(r"paper: (\S+) and \S+, ratio"))
add("many_flux_claims", ".3f %", paper_order_1=found(r"paper: \S+ and (\S+), ratio"))
add("many_flux_claims", ".0f s", paper_path_seconds=found(r"\(paper: (\d+) s\)"))
add(
    "many_flux_claims",
    ".1f s",
    paper_matrix_seconds=found(r"no symmetry at all: \S+ s \(paper: (\S+) s\)"),
)
add("many_flux_claims", ".0f", paper_times=found(r"paper: (\S+) and more"))
add("many_flux_claims", ".3f %", plane_order_0=cell("34 directions on the half circle:", 0))
add("many_flux_claims", ".4f %", plane_order_1=cell("34 directions on the half circle:", 2))
add("many_flux_figures", ".2f %", order_0=found(r"order 0: \(a\) (\S+) %"))
add("many_flux_figures", ".3f %", order_1=found(r"order 1: \(a\) (\S+) %"))
add(
    "many_flux_figures",
    ".1f",
    orders=ratio(found(r"order 0: \(a\) (\S+) %"), found(r"order 1: \(a\) (\S+) %")),
)

# The studio.
for _key, _row in (
    ("one_coat", "slider to swatch drawn, 1 coat"),
    ("three_coats", "slider to swatch drawn, 3 coats"),
    ("eight_coats", "slider to swatch drawn, 8 coats"),
    ("brush", "brush to pixels, 2 brushed"),
    ("canvas", "canvas anew, 2 brushed"),
    ("canvas_slider", "slider to canvas, 2 brushed"),
    ("eight_brush", "brush to pixels, 8 brushed"),
    ("eight_canvas", "canvas anew, 8 brushed"),
    ("eight_sharp", "canvas anew, sharp, 8 brushed"),
    ("eight_slider", "slider to canvas, 7 brushed"),
    ("card_canvas", "WebGL2: canvas anew, 2 brushed"),
):
    add("studio", ".0f ms", **{f"{_key}_median": cell(_row, 0), f"{_key}_95": cell(_row, 1)})
add(
    "studio",
    ".1f s",
    served_start=found(r"served:.*page usable (\S+) s later"),
    one_file_start=found(r"one file:.*page usable after (\S+) s"),
)
add("studio", ".2f MB", one_file_megabytes=found(r"one file: (\S+) MB"))
add(
    "page_solver",
    ".1e",
    largest=found(r"error of the reflectance, largest: (\S+),"),
    median=found(r"error of the reflectance.*median: (\S+)"),
)
add("page_solver", ".3f", delta_e=found(r"^CIEDE2000, largest: (\S+)"))
add(
    "page_solver",
    ".2f",
    matrices_95=found(r"small matrices, CIEDE2000, 95 %: (\S+),"),
    matrices_largest=found(r"small matrices, CIEDE2000, .*largest: (\S+)"),
)
add(
    "page_solver",
    ".2f ms",
    one_coat=found(r"milliseconds for 1 coat, 31 bands: (\S+)"),
    eight_coats=found(r"milliseconds for 8 coats, 31 bands: (\S+)"),
)
