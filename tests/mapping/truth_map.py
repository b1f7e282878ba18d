"""A map as a perfect solver would give it, from the truth of the example painting."""

from unittest import mock

import numpy as np
from benchmarks.rivals import known_painting
from benchmarks.rivals.known_painting import NOISE, Painting

from glazefit.mapping.store.chunk import SetSum
from glazefit.mapping.store.layout import PLACES, STATUS_WORDS, VARIABLES, Status, Way

from .toy import empty_arrays

GRID = np.linspace(400.0, 700.0, 16)
"""Of all paintings of these tests: tables of their regions belong to a grid, and are made once."""


class Rough(Painting):
    """Spectra off by a third of the noise, in a third of the time; the truth is the painting's."""

    def rows(self, y0: int, y1: int, *, noise: bool = True) -> np.ndarray:
        with mock.patch.multiple(known_painting, TABLE_ERROR=NOISE / 3, _SOLVER=NOISE / 3):
            return super().rows(y0, y1, noise=noise)


def painting(shape: tuple[int, int], seed: int) -> Rough:
    """A painting on `GRID`."""
    return Rough(**vars(known_painting.painting(shape, GRID, seed=seed)))


def truth_map(painting: Painting):
    """Dataset and sums of sets, the largest first, of a map that is right everywhere.

    The first three rows are masked, and one corner is saturated; foreign paint is "none of these".
    """
    import xarray as xr

    from glazejax.colour import srgb

    height, width = painting.shape
    truth = painting.truth(0, height)
    readings, clear = painting.rows(0, height), painting.rows(0, height, noise=False)
    arrays = empty_arrays(painting.shape, len(painting.paints))
    status = arrays["status"]
    status[:] = Status.MAPPED
    status[:3] = Status.MASKED
    status[-4:, -6:] = Status.SATURATED
    mapped = status == Status.MAPPED
    known = mapped & ~truth["foreign"]
    arrays["way"][mapped] = Way.UPDATED
    arrays["way"][::5, ::5][mapped[::5, ::5]] = Way.SEARCHED
    arrays["explained"] = known.astype(np.uint8)
    arrays["members"][known] = truth["members"][known]
    thickness = truth["amounts"].sum(axis=-1)
    arrays["thickness"][known] = thickness[known]
    arrays["thickness_sd"][known] = 0.05 * thickness[known]
    share = truth["amounts"] / thickness[..., None]
    arrays["fraction"][known] = np.where(truth["members"] >= 0, share, np.nan)[known]
    arrays["fraction_sd"][known] = np.where(truth["members"] >= 0, 0.02, np.nan)[known]
    arrays["paint_probability"][mapped] = 0.0
    for place in range(PLACES):
        ys, xs = np.nonzero(known & (truth["members"][..., place] >= 0))
        arrays["paint_probability"][ys, xs, truth["members"][ys, xs, place]] = 0.9
    arrays["none"][mapped] = np.where(known, 0.02, 0.97)[mapped]
    arrays["probability"][mapped] = np.where(known, 0.9, 0.1)[mapped]
    arrays["misfit"][mapped] = np.where(known, 0.3, 6.0)[mapped]
    arrays["rmse"][mapped] = np.sqrt(np.mean((readings - clear) ** 2, axis=-1))[mapped]
    colour = np.asarray(srgb(painting.wavelengths, readings.astype(float)))
    arrays["true_colour"] = np.round(colour * 255).astype(np.uint8)
    sets = {}
    members = arrays["members"][mapped]
    for found in np.unique(members, axis=0):
        there = mapped & (arrays["members"] == found).all(axis=-1)
        thick = thickness[there & known].astype(float)
        sets[tuple(int(m) for m in found if m >= 0)] = SetSum(
            int(there.sum()),
            readings[there].sum(axis=0, dtype=float),
            clear[there].sum(axis=0, dtype=float),
            (readings[there].astype(float) ** 2).sum(axis=0),
            float(thick.sum()),
            thick.size,
        )
    attrs = {"units": "mm"}
    coordinates = {
        "y": ("y", 0.25 * (np.arange(height) + 0.5), attrs),
        "x": ("x", 0.25 * (np.arange(width) + 0.5), attrs),
        "paint": [paint.name for paint in painting.paints],
    }
    tallies = {words: float(np.sum(status == number)) for number, words in STATUS_WORDS.items()}
    tallies |= {
        f"way {way.name.lower()}": float(np.sum(arrays["way"] == way)) for way in Way if way
    }
    dataset = xr.Dataset(
        {v.name: (("y", "x", *v.further), arrays[v.name]) for v in VARIABLES},
        coordinates,
        {"working_wavelengths": painting.wavelengths.tolist(), "tallies": tallies},
    )
    return dataset, dict(sorted(sets.items(), key=lambda one: (-one[1].pixels, one[0])))
