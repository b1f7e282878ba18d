"""The task `coats`: two paints mixed, or one laid over the other?

A library of the source's own paints is recovered from pure readings and from mixtures, without any
mixture of the two that are asked for; or that of another binder is taken. What is asked is the probability of more than one coat; a verdict counts as decided from .9.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from benchmarks.paint.pigments import fit
from glazefit import identify
from glazefit.film.films import ground_from_air
from glazefit.identify.result.odds import DECIDED
from glazefit.recover.joint.joint import UNIT
from glazejax import Pigment

from .library import grid_readings
from .sources import Sample, Source
from .tasks import Record, Scores

_GRID = np.arange(410.0, 981.0, 10.0)
_VISIBLE = _GRID <= 700.0
_INSTRUMENT = "45:0"
_BRIGHTEST = 0.985
OWN_BINDER = "glazejax, its own binder"
OTHER_BINDER = "glazejax, another binder"
VISIBLE = "glazejax, 410-700 nm"
NEIGHBOUR = "nearest by derivative"


def run_coats(sources: Sequence[Source], record: Record, most: int | None = None) -> None:
    """Score glazejax, and the nearest of the other pairs' samples by the first derivative.

    Args:
        sources: of samples.
        record: that the scores go to.
        most: mixtures, and superpositions, that are taken of each source; None for all.
    """
    for source in sources:
        rows = _rows(source, most)
        truths = np.array([source.samples[row].kind == "layers" for row in rows])
        if not truths.any() or truths.all():
            continue
        readings = grid_readings(source, rows, _GRID)
        samples = [source.samples[row] for row in rows]
        libraries = _Libraries(source)
        for name, other, bands in (
            (OWN_BINDER, False, np.ones(_GRID.size, dtype=bool)),
            (VISIBLE, False, _VISIBLE),
            (OTHER_BINDER, True, np.ones(_GRID.size, dtype=bool)),
        ):
            chances = np.array(
                [
                    _chance(source, sample, reading, libraries, other, bands)
                    for sample, reading in zip(samples, readings, strict=True)
                ]
            )
            there = np.isfinite(chances)
            if there.any():
                record.add("coats", source.name, name, _score(chances[there], truths[there]))
        near = _nearest(readings, truths, samples)
        record.add("coats", source.name, NEIGHBOUR, _score(near, truths))


def _rows(source: Source, most: int | None) -> list[int]:
    """Samples of two paints that were read pure too, at most so many of each kind."""
    pure = {sample.paints[0] for sample in source.samples if sample.kind == "pure"}
    rows = []
    for kind in ("mixture", "layers"):
        samples = ((row, source.samples[row].paints) for row in source.chosen(kind))
        rows += [row for row, two in samples if len(two) == 2 and set(two) <= pure][:most]
    return rows


def _score(chances: Float[np.ndarray, "samples"], truths: np.ndarray) -> Scores:
    decided = np.maximum(chances, 1.0 - chances) > DECIDED
    right = (chances > 0.5) == truths
    return {
        "n": len(chances),
        "right": float(right.mean()),
        "decided": float(decided.mean()),
        "right_decided": float(right[decided].mean()) if decided.any() else None,
        "layers_decided": float((decided & right)[truths].mean()),
        "mixtures_decided": float((decided & right)[~truths].mean()),
    }


def _bare(source: Source, binder: str) -> Float[np.ndarray, "bands"] | None:
    """Reading of the ground below a binder's samples; None where the films hide it."""
    controls = source.chosen("control")
    if not controls:
        return None
    code = "GA" if binder.lower().startswith("gum") else "EG"
    rows = [row for row in controls if code in source.samples[row].paints] or controls
    return grid_readings(source, rows[:1], _GRID)[0]


class _Libraries:
    """Paints of each binder, recovered from pure readings and from mixtures, without those of the
    pair that is asked for.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._known: dict[tuple[str, frozenset[str]], dict[str, Pigment]] = {}
        samples = source.samples
        self.binders = tuple(dict.fromkeys(s.binder for s in samples if s.kind == "pure"))

    def of(self, binder: str, pair: frozenset[str]) -> dict[str, Pigment]:
        """Paints of a binder by code."""
        mixed = any(
            sample.kind == "mixture" and sample.binder == binder and set(sample.paints) == pair
            for sample in self._source.samples
        )
        if not mixed:
            pair = frozenset()
        if (binder, pair) not in self._known:
            self._known[binder, pair] = self._recover(binder, pair)
        return self._known[binder, pair]

    def _recover(self, binder: str, pair: frozenset[str]) -> dict[str, Pigment]:
        source = self._source
        bare = _bare(source, binder)
        rows: dict[tuple[tuple[str, ...], tuple[float, ...]], list[int]] = {}
        for row, sample in enumerate(source.samples):
            pure = sample.kind == "pure"
            # Where no ground was read levels are a probe's, and mixtures show little.
            mixed = bare is not None and sample.kind == "mixture" and bool(sample.fractions)
            if sample.binder == binder and (pure or (mixed and set(sample.paints) != pair)):
                shares = (1.0,) if pure else sample.fractions
                rows.setdefault((sample.paints, shares), []).append(row)
        names = [source.samples[own[0]].name for own in rows.values()]
        recovery = fit(
            names,
            _GRID,
            np.array([_one_level(source, own) for own in rows.values()]),
            {name: dict(zip(*key, strict=True)) for name, key in zip(names, rows, strict=True)},
            bare=bare,
        )
        pure = {codes[0] for codes, _ in rows if len(codes) == 1}
        return {
            code: Pigment(
                code,
                _GRID,
                np.asarray(recovery.absorption[number]) / UNIT,
                np.asarray(recovery.scattering[number]) / UNIT,
            )
            for number, code in enumerate(recovery.paints)
            if code in pure
        }


def _one_level(source: Source, rows: Sequence[int]) -> Float[np.ndarray, "bands"]:
    """Mean of repeats, brought to one level: a probe held by hand moves it."""
    several = grid_readings(source, rows, _GRID)
    level = several.mean(axis=1, keepdims=True)
    mean = (several * np.median(level) / level).mean(axis=0)
    return mean * min(1.0, _BRIGHTEST / mean.max())


def _chance(
    source: Source,
    sample: Sample,
    reading: Float[np.ndarray, "bands"],
    libraries: _Libraries,
    other: bool,
    bands: np.ndarray,
) -> float:
    """Probability of more than one coat; NaN where no library has both paints."""
    fitting = [
        library
        for binder in libraries.binders
        if (binder != sample.binder) == other
        and set(sample.paints) <= set(library := libraries.of(binder, frozenset(sample.paints)))
    ]
    if not fitting:
        return np.nan
    pigments = [fitting[0][code].resample(_GRID[bands]) for code in sample.paints]
    bare = _bare(source, sample.binder)
    below: dict[str, Any] = {"opaque": True}
    if bare is not None:
        ground = ground_from_air(np.clip(bare[bands], 0.06, _BRIGHTEST), _INSTRUMENT)
        below = {"ground": ground}
    found = identify(
        _GRID[bands],
        np.clip(reading[bands], 0.0, 1.5),
        pigments,
        instrument=_INSTRUMENT,
        own_films=True,
        max_paints=2,
        max_coats=2,
        **below,
    )
    return float(found.coats_probability[0])


def _nearest(
    readings: Float[np.ndarray, "samples bands"], truths: np.ndarray, samples: Sequence[Sample]
) -> Float[np.ndarray, "samples"]:
    """1 where the sample of another pair with the most similar first derivative is of layers."""
    slopes = np.gradient(np.log(np.maximum(readings, 0.01)), axis=1)
    slopes -= slopes.mean(axis=1, keepdims=True)
    slopes /= np.linalg.norm(slopes, axis=1, keepdims=True)
    alike = slopes @ slopes.T
    pairs = [frozenset(sample.paints) for sample in samples]
    same = np.array([[one == two for two in pairs] for one in pairs])
    return truths[np.argmax(np.where(same, -np.inf, alike), axis=1)].astype(float)
