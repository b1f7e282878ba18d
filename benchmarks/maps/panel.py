"""A panel of other people's paint as a camera sees it: no spectrum in it was computed.

The paints of one source of measured spectra lie as flat fields, with brush strokes over them where
these are asked for. The camera's work is put on: relief and uneven light, blur over edges, noise.
Some paints are unknown to the catalogue; the exemplars of the source itself are left out of it, too.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt, gaussian_filter, maximum_filter, minimum_filter

from benchmarks.measured import data_folder
from benchmarks.paintbench.library import Table, known_families, pure_table
from benchmarks.paintbench.sources import COLOURLESS, FOREIGN, Source, read_sources
from glazefit.identify.result.groups import group_of
from glazejax import Pigment, catalogue

if TYPE_CHECKING:
    import xarray

SOURCES = ("hyperdoc", "grillini", "hyppigments", "kimera", "rrt", "revigo", "usgs")
"""Sources of which panels are laid: of each the other sources know enough families."""
PATCHES = (3, 4)
"""Flat fields of a panel, down and across."""
NOISE = 0.005
"""Usual standard deviation of a reading, independent in every band."""
LEVEL = 0.03
"""Standard deviation of the level of a field or stroke, which its spectrum is multiplied with."""
RELIEF = 0.02
"""The same of each pixel: the relief of the brush."""
LIGHT = 0.02
"""The same of the light, which changes slowly over the panel."""
BLUR = 0.8
"""Standard deviation of the camera's blur, pixels."""
BANDS = 121

T = TypeVar("T")

# Paints that the catalogue does not know and mixtures of two, of all that a panel has.
_UNKNOWN, _MIXTURES = 2, 2
# A camera's first and last band, where the source has them, nm.
_RANGE = (400.0, 1000.0)
# Pixels of a neighbourhood: where it has one paint only, its centre is off the edges.
_NEIGHBOURHOOD = 3


@dataclass(frozen=True, kw_only=True)
class PanelPaint:
    """One paint of a panel.

    Attributes:
        name: of its sample.
        families: of what it is made of, each once.
        unknown: whether the catalogue lacks it.
    """

    name: str
    families: tuple[str, ...]
    unknown: bool


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A panel with its truth.

    Attributes:
        group: whose paints they are; it is left out of the catalogue.
        hidden: families that are left out of the catalogue.
        paints: by number.
        wavelengths: (bands,), nm.
        spectra: of the paints as they were measured, (paints, bands).
        readings: reflectance, (y, x, bands).
        labels: number of the paint of each pixel.
        inside: which pixels lie off the edges of fields and strokes.
    """

    group: str
    hidden: frozenset[str]
    paints: tuple[PanelPaint, ...]
    wavelengths: Float[np.ndarray, "bands"]
    spectra: Float[np.ndarray, "paints bands"]
    readings: Float[np.ndarray, "y x bands"]
    labels: Int[np.ndarray, "y x"]
    inside: Bool[np.ndarray, "y x"]

    def image(self) -> "xarray.DataArray":
        """The panel as `glazefit.map_cube` takes it."""
        import xarray

        return xarray.DataArray(
            self.readings, dims=("y", "x", "wavelength"), coords={"wavelength": self.wavelengths}
        )

    def pigments(self) -> list[Pigment]:
        """Exemplars of the catalogue `pigments` without the panel's source and hidden families."""
        return [
            pigment
            for pigment in catalogue.load("pigments").values()
            if pigment.source != self.group and pigment.family not in self.hidden
        ]

    def library(self) -> Table:
        """Spectra of the same exemplars as they were measured, for other methods."""
        table = _table()
        return table.take(
            (table.groups != self.group) & ~np.isin(table.families, sorted(self.hidden))
        )


def lay_panel(
    source: str = SOURCES[0],
    shape: tuple[int, int] = (60, 80),
    *,
    noise: float = NOISE,
    strokes: int = 0,
    seed: int = 0,
) -> Panel:
    """Lay the paints of a source as flat fields, and brush strokes of them over these.

    Args:
        source: one of `SOURCES`.
        shape: (y, x) in pixels.
        noise: standard deviation of a reading, independent in every band.
        strokes: number of brush strokes.
        seed: of the choice of paints and of all else that is drawn at random.

    Raises:
        SystemExit: the measurements are not there.
    """
    rng = np.random.default_rng([seed, SOURCES.index(source)])
    chosen, hidden = _choose(_sources()[source], rng)
    labels, level = _lay(shape, len(chosen.samples), strokes, rng)
    first, last = chosen.cameras[0].wavelengths[[0, -1]]
    wavelengths = np.linspace(max(first, _RANGE[0]), min(last, _RANGE[1]), BANDS)
    spectra = np.stack(
        [
            np.interp(wavelengths, chosen.cameras[0].wavelengths, reading)
            for reading in chosen.cameras[0].readings
        ]
    )
    paints = tuple(
        PanelPaint(
            name=sample.name,
            families=families,
            unknown=bool(set(families) & {*hidden, FOREIGN}),
        )
        for sample in chosen.samples
        for families in [chosen.families(sample)]
    )
    least, most = (
        bound(labels, _NEIGHBOURHOOD, mode="nearest") for bound in (minimum_filter, maximum_filter)
    )
    return Panel(
        group=chosen.group,
        hidden=hidden,
        paints=paints,
        wavelengths=wavelengths,
        spectra=spectra,
        readings=_photograph(spectra[labels] * level[..., None], noise, rng),
        labels=labels,
        inside=least == most,
    )


@cache
def _sources() -> dict[str, Source]:
    """Sources that may be learnt from, by name."""
    return {source.name: source for source in read_sources(data_folder()) if source.learnable}


@cache
def _table() -> Table:
    return pure_table(list(_sources().values()))


def _choose(source: Source, rng: np.random.Generator) -> tuple[Source, frozenset[str]]:
    """The samples of a panel, and the families that are hidden: of `PATCHES` samples two of paints
    that are unknown, two mixtures where the source has them, and else pure paints of as many
    families as there are.
    """
    table = _table()
    others = set(known_families(table.take(table.groups != source.group)))
    by_family: dict[str, list[int]] = {}
    for row in source.chosen("pure"):
        sample = source.samples[row]
        if source.clear(sample):
            by_family.setdefault(source.families(sample)[0], []).append(row)
    foreign = by_family.pop(FOREIGN, [])
    by_family = {family: rows for family, rows in by_family.items() if family in others}
    # A family that has neighbours of one name, as whites have, is not missed.
    alone = [family for family in sorted(by_family) if family == group_of(family)]
    hidden = _drawn(alone, _UNKNOWN - bool(foreign), rng)
    unknown = _drawn(foreign, _UNKNOWN - len(hidden), rng)
    unknown += [by_family[family][0] for family in hidden]
    mixtures = [
        row
        for row in source.chosen("mixture")
        for families in [set(source.families(source.samples[row]))]
        if len(families) == 2 and families <= others - set(hidden) and families - COLOURLESS
    ]
    mixtures = _drawn(mixtures, len(mixtures), rng)
    pure = list(
        _in_turns([rows for family, rows in by_family.items() if family not in hidden], rng)
    )
    free = PATCHES[0] * PATCHES[1] - len(unknown)
    # Where a source has few pure paints, more mixtures take their place.
    mixed = mixtures[: max(_MIXTURES, free - len(pure))]
    rows = [*unknown, *mixed, *pure[: free - len(mixed)]]
    return replace(source.take(rows), bare=None), frozenset(hidden)


def _drawn(values: Sequence[T], count: int, rng: np.random.Generator) -> list[T]:
    """Some of the values at random, in any order."""
    return [values[int(i)] for i in rng.permutation(len(values))[:count]]


def _in_turns(rows: Sequence[Sequence[int]], rng: np.random.Generator) -> Iterator[int]:
    """One row of each family, then a second of each, at random."""
    shuffled = [_drawn(own, len(own), rng) for own in _drawn(rows, len(rows), rng)]
    for turn in range(max(map(len, shuffled), default=0)):
        yield from (own[turn] for own in shuffled if turn < len(own))


def _lay(
    shape: tuple[int, int], paints: int, strokes: int, rng: np.random.Generator
) -> tuple[Int[np.ndarray, "y x"], Float[np.ndarray, "y x"]]:
    """Number of the paint of each pixel, and the level of its field or stroke."""
    height, width = shape
    down = np.arange(height) * PATCHES[0] // height
    across = np.arange(width) * PATCHES[1] // width
    field = down[:, None] * PATCHES[1] + across
    labels = np.resize(rng.permutation(paints), PATCHES[0] * PATCHES[1])[field]
    level = (1.0 + LEVEL * rng.standard_normal(field.max() + 1))[field]
    along = np.linspace(0.0, 1.0, 4 * max(shape))
    for _ in range(strokes):
        # A parabola through three points, and what lies near it.
        one, two, three = rng.uniform(-0.1, 1.1, (3, 2, 1)) * np.reshape(shape, (2, 1))
        path = (1 - along) ** 2 * one + 2 * along * (1 - along) * two + along**2 * three
        y, x = path.astype(int)
        there = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        bare = np.ones(shape, bool)
        bare[y[there], x[there]] = False
        half = max(1.5, min(shape) * rng.uniform(0.02, 0.06))
        near = np.asarray(distance_transform_edt(bare)) <= half if there.any() else ~bare
        labels[near] = rng.integers(paints)
        level[near] = 1.0 + LEVEL * rng.standard_normal()
    return labels, level


def _photograph(
    scene: Float[np.ndarray, "y x bands"], noise: float, rng: np.random.Generator
) -> Float[np.ndarray, "y x bands"]:
    """What a camera reads of a scene, float32."""
    height, width = scene.shape[:2]
    relief = 1.0 + RELIEF * rng.standard_normal((height, width, 1))
    blurred = gaussian_filter(scene * relief, (BLUR, BLUR, 0), mode="nearest")
    slow = gaussian_filter(rng.standard_normal((height, width)), min(height, width) / 4)
    light = 1.0 + LIGHT * slow / slow.std()
    readings = blurred * light[..., None]
    return (readings + noise * rng.standard_normal(scene.shape)).astype(np.float32)
