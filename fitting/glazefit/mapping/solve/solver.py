"""From a window of an image to its maps."""

from dataclasses import dataclass, replace

import numpy as np

from ...identify.search.pool import NOBODY
from ..store.chunk import ChunkMaps, Members, SetSum, distinct_sets, rms_difference, true_colour
from ..store.layout import BY_NAME, STATUS_WORDS, Status, Way
from ..store.windows import Window
from .answers import Answers
from .atlas import Atlas
from .features import AROUND, PerSpectrum, SpectraReadings, pooled, spread_out
from .image import Image
from .spots import gather


@dataclass(frozen=True)
class PixelSolver:
    """Maps of windows: pixels near a representative in closed form, others by searches of the
    window's own.

    Attributes:
        image: with its noise.
        atlas: of the representatives.
        reach: how many times as far as noise and paint's errors reach a representative's answer
            is taken.
    """

    image: Image
    atlas: Atlas
    reach: float

    def solve(self, window: Window) -> ChunkMaps:
        """Maps of a window, from it alone."""
        image = self.image
        readings, status = image.read(window)
        good = np.flatnonzero(status == Status.MAPPED)
        spectra = np.maximum(readings[good], 0.0)
        means, reach = pooled(
            np.where((status == Status.MAPPED)[:, None], readings, np.float32(np.nan)),
            image.noise_sd(readings),
            self.atlas.features,
            window.shape,
            AROUND,
        )
        answers, way = self._answers(np.maximum(means[good], 0.0), reach[good])
        colours = true_colour(image.bands.wavelengths, readings)
        arrays = {
            "status": status.reshape(window.shape),
            "true_colour": colours.reshape(*window.shape, 3),
        }
        columns = {
            **answers.columns(self.atlas.searcher.prior),
            "rmse": rms_difference(spectra, answers.fitted),
            "way": way,
        }
        for name in BY_NAME.keys() & columns.keys():
            values = columns[name]
            variable = BY_NAME[name]
            full = np.full((window.pixels, *values.shape[1:]), variable.fill, variable.dtype)
            full[good] = values
            arrays[name] = full.reshape(*window.shape, *values.shape[1:])
        tallies = {label: float(np.sum(status == s)) for s, label in STATUS_WORDS.items()}
        tallies |= {f"way {w.name.lower()}": float(np.sum(way == w)) for w in Way if w}
        tallies["explained"] = float(answers.explained.sum())
        unexplained = np.flatnonzero(~answers.explained)
        positions = np.column_stack(np.unravel_index(good[unexplained], window.shape))
        return ChunkMaps(
            arrays=arrays,
            tallies=tallies,
            sets=_sums(answers, spectra),
            unexplained=gather(
                spectra[unexplained],
                self.atlas.features(spectra[unexplained]),
                positions + np.array([window.y0, window.x0]),
            ),
        )

    def _answers(self, spectra: SpectraReadings, reach: PerSpectrum) -> tuple[Answers, np.ndarray]:
        """Answers for good pixels, and the way of each."""
        answers, separation = self.atlas.answers(spectra)
        way = np.full(len(spectra), Way.UPDATED, np.uint8)
        reach = self.reach * reach
        far = np.flatnonzero(separation > reach)
        if far.size:
            features = self.atlas.features(spectra[far])
            # Spectra of a window that are searched because no representative is near, at most.
            chosen = spread_out(features, 64, reach[far])
            alone = spectra[far[chosen]]
            searched = self.atlas.searcher.search(alone, self.image.noise_sd(alone))
            window_atlas = replace(self.atlas, readings=alone, searched=searched)
            window_answers, distance = window_atlas.answers(spectra[far])
            better = distance < separation[far]
            answers.put(far[better], window_answers.take(better))
            way[far[better]] = Way.NEIGHBOUR
            way[far[chosen]] = Way.SEARCHED
        return answers, way


def _sums(answers: Answers, spectra: SpectraReadings) -> dict[Members, SetSum]:
    """Sums over the pixels of each first set; those that nothing explains are the empty set."""
    members = np.sort(np.where(answers.explained[:, None], answers.members, NOBODY), axis=1)
    one_of_each, which = distinct_sets(members)
    film_thickness = answers.thickness
    out = {}
    for number, paints in enumerate(members[one_of_each].tolist()):
        rows = np.flatnonzero(which == number)
        readings = spectra[rows].astype(np.float64)
        fitted = answers.fitted[rows].astype(np.float64)
        # Where nothing explains a pixel its thickness is that of a set that was rejected.
        thick = rows[answers.explained[rows] & ~answers.opaque[rows]]
        thickness = film_thickness[thick].astype(np.float64)
        key = tuple(paint for paint in paints if paint != NOBODY)
        out[key] = SetSum(
            pixels=len(rows),
            spectrum=readings.sum(axis=0),
            fitted=fitted.sum(axis=0),
            square=(readings**2).sum(axis=0),
            thickness=float(thickness.sum()),
            pixels_with_thickness=len(thickness),
        )
    return out
