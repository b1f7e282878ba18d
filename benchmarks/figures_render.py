"""Figures of renderers: Mitsuba, OpenPBR, rough surfaces, layered truth. Where each stands, and how
it is said.

See `benchmarks.figures`. Numbers are said as the first sentence that quotes them says them; others
may round further.
"""

import re
from collections.abc import Callable

from benchmarks.figures import Reader, add, below, cell, found, least, most, number, ratio

# The ray caster beside Mitsuba.
_SCENES = ("diffuse", "copper", "glaze", "map", "gloss")
for _key, _k in (("", 0), ("things_", 1), ("noise_", 3)):
    _cells = [cell(scene, _k) for scene in _SCENES]
    add(
        "mitsuba_compare", ".2f %", **{f"{_key}least": least(*_cells), f"{_key}most": most(*_cells)}
    )

# The plugin.
_MATERIALS = {
    "smooth": "glaze, smooth",
    "rough": "glaze, rough",
    "thickness_map": "+ thickness map",
    "ground_map": "+ ground map",
    "roughplastic": "roughplastic",
    "measured": "measured export",
}
for _key, _row in _MATERIALS.items():
    add("mitsuba_plugin", ".1f" if _key == "measured" else ".0f", **{f"{_key}_eval": cell(_row, 0)})
    if _key != "roughplastic":
        add("mitsuba_plugin", ".2f", **{f"{_key}_paths": cell(_row, 3)})
    if _key in ("smooth", "rough"):
        add("mitsuba_plugin", ".0f s", **{f"{_key}_load": cell(_row, 4)})
        add("mitsuba_plugin", ".0f", **{f"{_key}_kb": cell(_row, 5)})
    if _key not in ("roughplastic", "measured"):
        add("mitsuba_plugin", ".1e", **{f"{_key}_stated": cell(_row, 6)})
    if not _key.endswith("_map"):
        add(
            "mitsuba_plugin",
            ".2f" if _key in ("roughplastic", "measured") else ".1e",
            **{f"{_key}_error": cell(_row, -1)},
        )
_slower = [ratio(cell("roughplastic", 0), cell(row, 0)) for row in list(_MATERIALS.values())[:4]]
add(
    "mitsuba_plugin",
    ".0f times",
    eval_slower_least=least(*_slower),
    eval_slower_most=most(*_slower),
)

# Thickness from pictures.
add(
    "thickness_from_views",
    ".2f %",
    rms=found(r"root mean square error (\S+)% of the root mean square"),
    absolute=found(r"mean absolute error (\S+)% of the mean"),
    bias=found(r"bias [+-]?(\S+)%"),
)
add("thickness_from_views", ".1f %", noise=found(r"noise of the pictures: (\S+)%"))
add("thickness_from_views", ".1f", thickest=found(r"at most (\S+) um"))
add(
    "thickness_from_views",
    ".0f",
    view_samples=found(r"pixels, (\d+) samples"),
    steps=found(r"(\d+) steps of one view"),
    step_samples=found(r"one view, (\d+) samples"),
)

# A rough surface.
add(
    "rough_surface",
    ".1e",
    worst_1e3=cell("worst", 0),
    worst_1e4=cell("worst", 2),
    worst_1e5=cell("worst", 4),
)
add("rough_surface", ".1f times", times_1e3=cell("1e-03", 0))
add("rough_surface", ".0f times", times_1e4=cell("1e-04", 0), times_1e5=cell("1e-05", 0))
add("rough_surface", ".1f s", operators=cell("1e-05", 2))
add(
    "rough_surface",
    ".0f",
    random=found(r"over (\d+) random stacks"),
    timed=found(r"Time of (\d+) stacks"),
)

Choice = Callable[[str], bool]


def _pieces(after: str) -> Callable[[str], list[list[str]]]:
    """Rows of the table below some words, up to an empty line: name and pieces that two spaces
    part.
    """

    def read(text: str) -> list[list[str]]:
        table = re.split(r"\n[ \t]*\n", below(text, after), maxsplit=1)[0]
        rows = [re.split(r"\s{2,}", line.strip()) for line in table.splitlines()]
        return [row for row in rows if len(row) > 3 and re.fullmatch(r"[-+\d.e]+", row[-1])]

    return read


def _column(
    after: str, column: int, chosen: Choice = lambda _: True
) -> Callable[[str], list[float]]:
    """A column's absolute values, in rows whose name is chosen; 1 is the first after the name."""

    def read(text: str) -> list[float]:
        rows = [
            row
            for row in _pieces(after)(text)
            if not row[0].startswith(("median", "stack")) and chosen(row[0])
        ]
        return [abs(number(row[column])) for row in rows]

    return read


def _min(read: Callable[[str], list[float]]) -> Reader:
    return lambda text: min(read(text))


def _max(*reads: Callable[[str], list[float]]) -> Reader:
    return lambda text: max(value for read in reads for value in read(text))


# OpenPBR. Pieces are parted by spaces, and names have some: columns count from the line's end.
_STACK = re.compile(r"^(\S.*?) {2,}(?:yes |no |[\d.]+ )")


def _openpbr(
    after: str, column: int, chosen: Choice = lambda _: True
) -> Callable[[str], list[float]]:
    def read(text: str) -> list[float]:
        table = re.split(r"\n(?:[ \t]*\n|naive over)", below(text, after), maxsplit=1)[0]
        lines = [
            line for line in table.splitlines() if (name := _STACK.match(line)) and chosen(name[1])
        ]
        return [number(line.split()[column]) for line in lines]

    return read


for _what in ("albedo", "sky"):
    add(
        "openpbr_fit",
        ".1f times",
        **{
            f"gain_{_what}_least": found(rf"naive over fit, {_what}: (\S+) to"),
            f"gain_{_what}_most": found(rf"naive over fit, {_what}: \S+ to (\S+),"),
        },
    )
add("openpbr_fit", ".1f times", gain_lamp=found(r"naive over fit, lamp: .* median (\S+)"))
_FITTED, _ROUGH = "fit for MaterialX's node graph", "a rough surface (alpha of GGX"
for _key, _stack in (("eosin", "eosin 2 um on white"), ("white", "zinc white 100 um")):
    for _when, _back in (("naive", -4), ("fit", -3)):
        _read = _openpbr(_FITTED, _back, lambda name, wanted=_stack: name == wanted)
        add("openpbr_fit", ".2f", **{f"{_key}_lamp_{_when}": _max(_read)})
for _what, _back in (("sky", -5), ("lamp", -3)):
    _read = _openpbr(_FITTED, _back)
    add("openpbr_fit", ".1f", **{f"{_what}_least": _min(_read), f"{_what}_most": _max(_read)})
add("openpbr_fit", ".2f", rms_most=_max(_openpbr(_FITTED, -1)))
_RECIPROCAL = "RMS of materialx over reciprocal: "
add("openpbr_fit", ".1f times", reciprocal_least=found(rf"{_RECIPROCAL}(\S+) to"))
add("openpbr_fit", "1s times", reciprocal_most=found(rf"{_RECIPROCAL}\S+ to (\S+),"))
add("openpbr_fit", ".0f times", reciprocal=found(rf"{_RECIPROCAL}.* median (\S+)"))
_GLAZES = ("ultramarine 1 um on white", "eosin 2 um on white")
add(
    "openpbr_fit",
    ".4f",
    reciprocal_glaze=_max(_openpbr("other ways to put layers", -1, lambda name: name in _GLAZES)),
)
for _key, _what, _back in (
    ("rough", "sky", -7),
    ("rough", "lamp", -6),
    ("rough_reciprocal", "sky", -3),
    ("rough_reciprocal", "lamp", -2),
):
    _read = _openpbr(_ROUGH, _back)
    add(
        "openpbr_fit",
        ".1f",
        **{f"{_key}_{_what}_least": _min(_read), f"{_key}_{_what}_most": _max(_read)},
    )

# Layered truth: agreement.
_AGREEMENT, _RULES, _TIMES = (
    "glazejax against Monte Carlo",
    "Errors of the layer rules",
    "Processor time on one core",
)


def _values(text: str) -> float:
    return sum(cell(row, -1)(text) for row in _SHARES.values())


_SHARES = {
    "albedo_smooth": "albedo, smooth",
    "albedo_rough": "albedo, rough",
    "factor_smooth": "factor, smooth",
    "factor_rough": "factor, rough",
}
_INDEPENDENT = "one band and view of each run: these are independent"
for _key, _row in {**_SHARES, "independent": _INDEPENDENT, "normal": "a normal law has"}.items():
    add("layered_truth", ".3f", **{f"{_key}_within_{k + 1}": cell(_row, k) for k in range(3)})
    if _key != "normal":
        add("layered_truth", ".2f", **{f"{_key}_largest": cell(_row, 3)})
        add("layered_truth", ".0f", **{f"{_key}_values": cell(_row, 4)})
add("layered_truth", ".0f", values=_values)
add("layered_truth", ".1f", squares=found(r"sum of squares of the last line (\S+);"))
add(
    "layered_truth",
    ".0f",
    squares_expected=found(r"expected (\d+)"),
    squares_spread=found(r"expected \d+ \+- (\S+)"),
)
add(
    "layered_truth",
    ".0f",
    million_paths=lambda text: 1e-6 * sum(sum(_column(_AGREEMENT, k)(text)) for k in (1, 5)),
)
add(
    "layered_truth",
    ".1e",
    albedo_error=_max(_column(_AGREEMENT, 2)),
    factor_error=_max(_column(_AGREEMENT, 6)),
)
add(
    "layered_truth",
    ".0e",
    apart=_max(_column(_AGREEMENT, 9, lambda name: name.endswith(", smooth") and _one(name))),
)
add("layered_truth", ".1e", surface_albedo=found(r"(?s)difference of an albedo\s+(\S+),"))
add("layered_truth", ".2f %", surface_factor=found(r"difference of a reflection factor (\S+)", 100))

# The rules.
_SCALING, _RECIPROCAL_SCALING, _OPENPBR, _BELCOUR = range(1, 5)
_SEVERAL = ("varnish 1.5 on", "tint 1.4 on", "forward glaze", "milk g")


def _one(name: str) -> bool:
    """One index, isotropic scattering."""
    return not name.startswith(_SEVERAL)


def _clear(name: str) -> bool:
    return name.startswith("clear ")


def _tinted(name: str) -> bool:
    """Under an absorbing coat, of one index."""
    return name.startswith(("tinted varnish", "deep tint", "tint n", "tint on"))


def _called(start: str) -> Choice:
    return lambda name: name.startswith(start)


_bright, _haze = _column(_RULES, _SCALING, lambda name: not _called("hazy")(name)), _called("hazy")
add("layered_truth", ".2f", scaling_least=_min(_bright), scaling_most=_max(_bright))
for _key, _rule, _which in (
    ("openpbr_clear", _OPENPBR, _clear),
    ("openpbr_tinted", _OPENPBR, _tinted),
    ("belcour_tinted", _BELCOUR, _tinted),
):
    _read = _column(_RULES, _rule, _which)
    add("layered_truth", ".2f", **{f"{_key}_least": _min(_read), f"{_key}_most": _max(_read)})
for _key, _rule in (("scaling", _SCALING), ("openpbr", _OPENPBR)):
    add("layered_truth", ".2f", **{f"{_key}_haze": _max(_column(_RULES, _rule, _haze))})
for _key, _rule in (("openpbr", _OPENPBR), ("belcour", _BELCOUR)):
    _read = _column(_RULES, _rule, _called("tint 1.4 on dark 1.7"))
    add("layered_truth", ".2f", **{f"{_key}_two_indices_tint": _max(_read)})
_read = _column(_RULES, _OPENPBR, _called("varnish 1.5 on white 1.4"))
add("layered_truth", ".2f", openpbr_two_indices_varnish=_max(_read))
_FACTOR, _PER_CENT = (
    "Root mean square error of the reflectance factor",
    "Root mean square error relative to it",
)
for _k, _key in enumerate(("scaling", "reciprocal", "openpbr", "belcour")):
    _style = ".2f" if _k < 2 else ".3f"
    add(
        "layered_truth",
        _style,
        **{f"{_key}_albedo": cell("median of the absolute values", _k, after=_RULES)},
    )
    # A slash parts in the plane and out of it.
    for _side, _where in enumerate(("in", "out")):
        add(
            "layered_truth",
            ".3f",
            **{f"{_key}_{_where}": cell("median", 3 * _k + 2 * _side, after=_FACTOR)},
        )
        add(
            "layered_truth",
            ".0f %",
            **{f"{_key}_{_where}_share": cell("median", 3 * _k + 2 * _side, after=_PER_CENT)},
        )

# Their times.
_KINDS: dict[str, Choice] = {
    "smooth": lambda name: _one(name) and name.endswith(", smooth"),
    "rough": lambda name: not name.endswith(", smooth"),
    "several": lambda name: not _one(name),
}
for _key, _which in _KINDS.items():
    for _what, _k in (("albedo", 1), ("factor", 5)):
        _read = _column(_TIMES, _k, _which)
        _style = ".1f ms" if _key == "smooth" or (_key, _what) == ("rough", "albedo") else ".0f ms"
        add(
            "layered_truth",
            _style,
            **{f"{_what}_{_key}_least": _min(_read), f"{_what}_{_key}_most": _max(_read)},
        )
    add(
        "layered_truth",
        ".1e",
        **{f"{_key}_error": _max(_column(_TIMES, 2, _which), _column(_TIMES, 6, _which))},
    )
for _what, _k in (("albedo", 3), ("factor", 7)):
    _read = _column(_TIMES, _k)
    add(
        "layered_truth",
        ".0f s",
        **{f"{_what}_paths_least": _min(_read), f"{_what}_paths_most": _max(_read)},
    )
    add(
        "layered_truth",
        ".1e",
        **{
            f"{_what}_ratio": found(rf"^{_what}: .* median (\S+)"),
            f"{_what}_ratio_least": found(rf"^{_what}: Monte Carlo takes (\S+) to"),
            f"{_what}_ratio_most": found(rf"^{_what}: Monte Carlo takes \S+ to (\S+)"),
        },
    )
