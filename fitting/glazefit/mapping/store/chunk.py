"""Results of a solved window: its arrays, its counts, sums over the pixels of each set, and spectra
that no set explains.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self, TypeAlias

import numpy as np
from jaxtyping import Float, Int

from ...film.numerics.columns import Columns

Bands: TypeAlias = Float[np.ndarray, "bands"]
"""A number a band; `glazejax.spectra`, which has it too, loads JAX."""
PixelReadings: TypeAlias = Float[np.ndarray, "pixels bands"]
"""Readings of pixels at the working bands, or their standard deviations."""
Members = tuple[int, ...]
"""Paints of a set by number, ascending; () where none of the paints explain a pixel."""


@dataclass
class SetSum:
    """Sums over the pixels whose most probable set is this one.

    Attributes:
        pixels: how many there are.
        spectrum: (bands,) sum of their readings at the working bands.
        fitted: (bands,) sum of what was fitted to them.
        square: (bands,) sum of their readings squared.
        thickness: sum of their thicknesses, m.
        pixels_with_thickness: how many have one.
    """

    pixels: int
    spectrum: Bands
    fitted: Bands
    square: Bands
    thickness: float = 0.0
    pixels_with_thickness: int = 0

    @property
    def mean(self) -> Bands:
        """Of the readings."""
        return self.spectrum / self.pixels

    @property
    def mean_fit(self) -> Bands:
        """Of what was fitted; NaN where that is not known of all pixels."""
        return self.fitted / self.pixels

    @property
    def sd(self) -> Bands:
        """Standard deviation of the readings."""
        return np.sqrt(np.maximum(self.square / self.pixels - self.mean**2, 0.0))

    @property
    def rmse(self) -> float:
        """Root mean square of the mean less the mean fit."""
        return float(rms_difference(self.mean, self.mean_fit))

    @property
    def thickness_um(self) -> float | None:
        """Mean thickness in micrometres; None where no pixel has one."""
        count = self.pixels_with_thickness
        return self.thickness / count * 1e6 if count else None

    def __add__(self, other: Self) -> "SetSum":
        return SetSum(**{name: value + getattr(other, name) for name, value in vars(self).items()})


SetSums: TypeAlias = Mapping[Members, SetSum]
"""Sums of each set, the largest set first."""


@dataclass(frozen=True)
class Unexplained(Columns):
    """Spectra that no paints explain, in groups of like ones.

    Attributes:
        pixels: of each group.
        readings: means of the groups, at the working bands.
        places: (y, x) of the pixel next to each mean.
    """

    pixels: Int[np.ndarray, "groups"]
    readings: Float[np.ndarray, "groups bands"]
    places: Int[np.ndarray, "groups 2"]

    @classmethod
    def nothing(cls) -> Self:
        """No spectra."""
        return cls(
            pixels=np.zeros(0, np.int64),
            readings=np.zeros((0, 0)),
            places=np.zeros((0, 2), np.int64),
        )


@dataclass
class ChunkMaps:
    """Maps of one window.

    Attributes:
        arrays: by the names of `layout.VARIABLES`, (y, x, ...); what is left out is filled.
        tallies: counts that are summed over windows, such as pixels of each status.
        sets: sums over the pixels of each set.
        unexplained: spectra of those that no set explains.
    """

    arrays: dict[str, np.ndarray]
    tallies: Mapping[str, float] = field(default_factory=dict)
    sets: dict[Members, SetSum] = field(default_factory=dict)
    unexplained: Unexplained = field(default_factory=Unexplained.nothing)


def distinct_sets(
    members: Int[np.ndarray, "pixels places"],
) -> tuple[Int[np.ndarray, "sets"], Int[np.ndarray, "pixels"]]:
    """A pixel of each set that occurs, and the number of each pixel's set among these.

    Args:
        members: paints of each pixel's set by number, in one order everywhere; -1 for none.
    """
    # Numbers of paints as one: to sort rows takes many times as long.
    paints = int(members.max(initial=0)) + 2
    keys = (members.astype(np.int64) + 1) @ paints ** np.arange(members.shape[1])
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    return first, which


def rms_difference(
    one: Float[np.ndarray, "*n bands"], other: Float[np.ndarray, "*n bands"]
) -> Float[np.ndarray, "*n"]:
    """Root mean square difference of spectra over the bands that the other ones know; NaN without
    any.
    """
    finite = np.isfinite(other)
    square = np.where(finite, one - other, 0.0) ** 2
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(square.sum(axis=-1) / finite.sum(axis=-1)))


def true_colour(wavelengths: Bands, readings: PixelReadings) -> np.ndarray:
    """sRGB from 0 to 255 under D65, (pixels, 3); grey where the bands give no colour."""
    from glazejax.colour import srgb

    clipped = np.clip(np.nan_to_num(readings, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 2.0)
    try:
        encoded = np.asarray(srgb(wavelengths, clipped))
    except ValueError:
        encoded = np.repeat(np.sqrt(clipped.mean(axis=1, keepdims=True)), 3, axis=1)
    return np.rint(255.0 * np.clip(encoded, 0.0, 1.0)).astype(np.uint8)


def pack(maps: ChunkMaps) -> dict[str, np.ndarray]:
    """All of a window but its arrays, by name; `unpack` gives the same numbers back."""
    counts = {"tallies": maps.tallies, "members": [*maps.sets]}
    # A row a set; counts of pixels are whole in float64, too.
    sums = [
        [
            total.pixels,
            total.thickness,
            total.pixels_with_thickness,
            *total.spectrum,
            *total.fitted,
            *total.square,
        ]
        for total in maps.sets.values()
    ]
    return {
        "counts": np.frombuffer(json.dumps(counts).encode(), np.uint8),
        "sums": np.array(sums, np.float64),
        **{f"unexplained_{name}": values for name, values in maps.unexplained.arrays().items()},
    }


def unpack(arrays: Mapping[str, np.ndarray]) -> ChunkMaps:
    """Restore a window from the arrays of `pack`, without its maps."""
    counts = json.loads(arrays["counts"].tobytes())
    sets = {}
    for members, (pixels, thickness, with_thickness, *spectra) in zip(
        counts["members"], arrays["sums"], strict=True
    ):
        spectrum, fitted, square = np.split(np.array(spectra), 3)
        sets[tuple(members)] = SetSum(
            pixels=int(pixels),
            spectrum=spectrum,
            fitted=fitted,
            square=square,
            thickness=float(thickness),
            pixels_with_thickness=int(with_thickness),
        )
    return ChunkMaps(
        arrays={},
        tallies=counts["tallies"],
        sets=sets,
        unexplained=Unexplained.joined(1, lambda _, name: arrays[f"unexplained_{name}"]),
    )
