"""Figures of times beside those of others, for the table of `benchmarks.performance`.

See `benchmarks.figures`. A ratio is the peer's time over ours, also where both are told as work
done in a second.
"""

import re

from benchmarks.figures import Reader, add, cell, found, number, ratio


def _cheapest(program: str, asked: float, column: int) -> Reader:
    """Of a program's settings whose error is at most the one asked for, the fastest: its error
    (column 0) or its milliseconds (column 1).
    """

    def read(text: str) -> float:
        rows = re.findall(rf"^{re.escape(program)}  +\S+ \S+ +(\S+) +(\S+) +\S+$", text, re.M)
        kept = [(number(ms), number(error)) for error, ms in rows if number(error) <= asked]
        if not kept:
            raise ValueError(f"no setting of {program!r} has an error of at most {asked:g}")
        ms, error = min(kept)
        return (error, ms)[column]

    return read


def _ours(gradient: bool, tolerance: str) -> Reader:
    """Milliseconds at a tolerance, as the table of frontier writes it."""
    name = "glazejax n = 1.5" + ", gradient" * gradient
    return cell(f"{name:<37}{tolerance}", 1)


for _key, _asked in (("1e4", "0.0001"), ("1e8", "1e-08")):
    for _peer, _program, _gradient in (
        ("cdisort", "CDISORT n = 1", False),
        ("sasktran2", "sasktran2 n = 1, gradient", True),
    ):
        _ms = _cheapest(_program, float(_asked), 1)
        add("frontier", ".0e", **{f"{_peer}_error_{_key}": _cheapest(_program, float(_asked), 0)})
        add("frontier", ".1f ms", **{f"{_peer}_ms_{_key}": _ms})
        add(
            "frontier",
            "2s times",
            **{f"{_peer}_asked_{_key}": ratio(_ms, _ours(_gradient, _asked))},
        )

_MILLION = "1000000"
add("scaling", ".2g times", layers_40_times=ratio(cell("40", 2), cell("40", 0)))
add(
    "scaling",
    ".2g times",
    million_alone=ratio(cell(_MILLION, 0), cell(_MILLION, 2)),
    million_single_times=ratio(cell(_MILLION, 0), cell(_MILLION, 3)),
)

add("savings", "2s times", times=found(r"pixel by pixel it would take .*, (\S+) times as long"))

_AGAIN, _FULL = found(r"again: (\S+) s"), found(r"rays for every pixel: (\S+) s")
add("scene_speed", ".1f s", full=_FULL)
add("scene_speed", ".2f %", apart=found(r"mean difference of the two pictures (\S+)%"))
add("scene_speed", ".2g times", times=ratio(_FULL, _AGAIN))

for _key, _row in (("two", "31 bands, two cards"), ("fine", "61 bands, white card")):
    _before, _now = cell(_row, 0), cell(_row, 1)
    add("identification_speed", ".0f", **{f"{_key}_rate": _now, f"{_key}_before_rate": _before})
    add("identification_speed", ".2g times", **{f"{_key}_times": ratio(_now, _before)})
add("identification_speed", ".0f", finest_rate=cell("2151 bands, white card", 1))

_LARGE = "9,998,244"
_MS_A_PIXEL, _PIXELS = found(r"full search took (\S+) ms a pixel"), found(rf"^ +({_LARGE}) ")


def _full_seconds(text: str) -> float:
    return _MS_A_PIXEL(text) * _PIXELS(text) / 1000


add("painting", ".0f h", full_hours=lambda text: _full_seconds(text) / 3600)
add("painting", "2s times", full_times=ratio(_full_seconds, cell(_LARGE, 5)))
_ANGLE = cell("spectral angle, and pairs", 10)
add("painting", "3s pixels/s", angle_rate=_ANGLE)
add("painting", ".2g times", angle_times=ratio(cell("1,000,000", 6), _ANGLE))


def _draws(problem: str, sampler: str, column: int) -> Reader:
    """A number of a sampler's row: seconds, effective draws, these a second, R-hat."""
    others = r"\S+\s+" * column
    return found(rf"^{problem}\n.*\n(?:\S.*\n)*?{sampler}\s+{others}(\S+)")


_UNKNOWN, _BANDS = "a coat of unknown paint, two grounds", "a film band by band"
for _key, _problem in (("", _UNKNOWN), ("bands_", _BANDS)):
    _hmc, _emcee = _draws(_problem, "hmc", 2), _draws(_problem, "emcee", 2)
    add("samplers", ".2g times", **{f"{_key}times": ratio(_hmc, _emcee)})
for _sampler in ("hmc", "emcee"):
    add("samplers", ".0f", **{f"bands_{_sampler}_rate": _draws(_BANDS, _sampler, 2)})
    add("samplers", ".2f", **{f"bands_{_sampler}_apart": _draws(_BANDS, _sampler, 3)})

_MATRICES = found(r"microseconds for 8 coats as small matrices, all bands: (\S+)", 1e-3)
_EIGHT = found(r"milliseconds for 8 coats, 31 bands: (\S+)")
add("page_solver", ".3f ms", matrices_ms=_MATRICES)
add("page_solver", ".2g times", matrices_times=ratio(_MATRICES, _EIGHT))

_METHODS = {
    "conventional": ("conventional, ms", 0),
    "own": ("own step, decomposed, ms", 1),
    "fixed": ("fixed step, table counted, ms", 2),
}
_MS = {key: cell("0.01", 6, after=words) for key, (words, _) in _METHODS.items()}
for _key, (_words, _column) in _METHODS.items():
    add("paper_tables", ".1f ms", **{f"{_key}_ms": _MS[_key]})
    _error = cell("0.01", _column, after="Largest error of the reflectance factor")
    add("paper_tables", ".1e", **{f"{_key}_error": _error})
for _key in ("conventional", "own"):
    add("paper_tables", ".2g times", **{f"{_key}_times": ratio(_MS[_key], _MS["fixed"])})

# The coarsest setting of ours that is still more accurate than the peer's finest.
_OURS_MANY, _PEER_MANY = "glazejax, tolerance 0.003", "PythonicDISORT, 64 streams"
add("manyflux_speed", ".1e", error=cell(_OURS_MANY, 0), peer_error=cell(_PEER_MANY, 0))
add("manyflux_speed", ".1f s", seconds=cell(_OURS_MANY, 1), peer_seconds=cell(_PEER_MANY, 1))
add("manyflux_speed", ".2g times", times=ratio(cell(_PEER_MANY, 1), cell(_OURS_MANY, 1)))
