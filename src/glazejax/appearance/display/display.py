"""Digital values that make a screen show a colour: XYZ to digital RGB and back, for a display as
measured.

A display is its primaries (chromaticities and the luminance of each at its highest level) and one
tone curve a
channel: the light that each digital level gives. Colour is linear in the light, so a matrix leads
from XYZ to the light of each primary, and the tone curve, read backwards, to the level.

NumPy in, NumPy out; JAX in, JAX out, where everything but the rounding to levels can be
differentiated.

Source: paper B (Tominaga 1993), section 2; presets by colour-science.
"""

from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...colour import SRGB_PRIMARIES, bradford, colour_science, srgb_to_xyz
from ...radiative.common.fresnel import array_module
from ...spectra import Numbers, as_array, as_float_array, concrete, matmul
from .tone import ToneCurve, look_up

Channels: TypeAlias = Float[Array | np.ndarray, "*batch 3"]
"""Colours as the light of three primaries, or as XYZ."""

Gamut = Literal["clip", "dim", "desaturate", "error"]
"""What becomes of a colour that the display can't show; see `Display.to_rgb`."""

PRESETS = {
    "srgb": "sRGB",
    "display p3": "Display P3",
    "adobe rgb": "Adobe RGB (1998)",
    "rec. 2020": "ITU-R BT.2020",
}
"""Displays known by name, and what colour-science calls them."""


class Digital(NamedTuple):
    """Digital colours and whether the display could not show what was asked."""

    rgb: Int[Array | np.ndarray, "*batch 3"]
    """Levels, 0 to the highest."""
    outside: Bool[Array | np.ndarray | np.bool_, "*batch"]
    """Where the colour lies outside the gamut, is too bright or NaN, so that `rgb` is another
    colour.
    """


class Display:
    """A display, from its primaries' chromaticities, their luminances and a tone curve for each.

    Args:
        chromaticities: (3, 2), x and y of red, green and blue.
        luminances: (3,), Y of each primary at its highest level, in the unit of the XYZ that will
            be shown: cd/m2, or so that they sum to 1 for XYZ in which white has Y = 1.
        tone: a gamma for all channels, or a `ToneCurve`, or three of either.
        levels: highest digital level: 255 for 8 bits.
        name: for people.

    Raises:
        ValueError: primaries on one line, a luminance that is not positive, a curve that ends at
            another level than the highest, or what `ToneCurve` refuses.

    Source: paper B, eqs (1)-(3).
    """

    def __init__(
        self,
        chromaticities: Numbers,
        luminances: Numbers,
        tone: "float | ToneCurve | tuple[float | ToneCurve, ...]" = 2.2,
        *,
        levels: int = 255,
        name: str = "display",
    ):
        xy = np.asarray(chromaticities, float)
        top = np.asarray(luminances, float)
        if xy.shape != (3, 2) or top.shape != (3,):
            raise ValueError(
                f"a display has chromaticities (3, 2) and luminances (3,), not {xy.shape} and "
                f"{top.shape}"
            )
        if not (
            np.all(xy[:, 1] > 0)
            and np.all(top > 0)
            and np.all(np.isfinite(xy))
            and np.all(np.isfinite(top))
        ):
            raise ValueError(
                f"chromaticity y and luminance of each primary must be positive, not {xy[:, 1]} "
                f"and {top}"
            )
        if levels < 1:
            raise ValueError(f"levels is {levels}; it is the highest digital level, such as 255")
        self.chromaticities: np.ndarray = xy
        self.luminances: np.ndarray = top
        self.levels: int = int(levels)
        self.name: str = name
        x, y = xy.T
        # Column by column XYZ of a primary of luminance 1. Paper B prints 1/y in the second row; it
        # is 1.
        primaries = np.stack([x / y, np.ones(3), (1.0 - x - y) / y])
        if abs(np.linalg.det(primaries)) < 1e-9:
            raise ValueError(
                f"the primaries {xy.tolist()} lie on one line: they show no plane of colours"
            )
        curves = tone if isinstance(tone, tuple) else (tone,) * 3
        if len(curves) != 3:
            raise ValueError(
                f"{len(curves)} tone curves were given; a display has one for all or 3"
            )
        self.tones: tuple[ToneCurve, ...] = tuple(
            c if isinstance(c, ToneCurve) else ToneCurve.from_gamma(c, levels) for c in curves
        )
        ends = [float(curve.levels[-1]) for curve in self.tones]
        if wrong := [end for end in ends if end != levels]:
            raise ValueError(
                f"a tone curve ends at level {wrong[0]:g}, but the display's highest is {levels}: "
                f"give Display levels={wrong[0]:g}, or a curve up to {levels}"
            )
        # XYZ of each primary at its highest level; T is the inverse, up to the levels (3).
        self._to_xyz = primaries * top
        self._to_light = np.linalg.inv(self._to_xyz)

    @classmethod
    def preset(cls, name: str, *, white_luminance: float = 1.0) -> "Display":
        """A standard display: sRGB, Display P3, Adobe RGB or Rec. 2020, without any ICC profile.

        Args:
            name: see `PRESETS`; any other RGB space that colour-science knows will do.
            white_luminance: Y of its white: 1 for XYZ in which white has Y = 1, 80 for sRGB's in
                cd/m2.

        Raises:
            ValueError: there is no such display.
        """
        title = PRESETS.get(name.strip().lower(), name)
        steps = np.linspace(0.0, 1.0, 256)
        if title == "sRGB":
            # Most displays are: they need not wait for colour-science.
            primaries = SRGB_PRIMARIES
            luminances = srgb_to_xyz(np.eye(3))[:, 1]
            light = srgb_to_xyz(steps[:, None] * np.ones(3))[:, 1]
        else:
            colour = colour_science()
            names = {key.lower(): key for key in colour.RGB_COLOURSPACES}
            if title.lower() not in names:
                raise ValueError(
                    f"unknown display {name!r}: there are {', '.join(PRESETS.values())}, or "
                    "measure yours"
                )
            space = colour.RGB_COLOURSPACES[names[title.lower()]]
            title = space.name
            primaries = space.primaries
            luminances = colour.normalised_primary_matrix(primaries, space.whitepoint)[1]
            # The standard's own decoding, at each of 256 levels.
            light = np.asarray(space.cctf_decoding(steps))
        curve = ToneCurve(np.arange(256.0), light)
        return cls(primaries, luminances * white_luminance, curve, name=title)

    @classmethod
    def paper_monitor(cls) -> "Display":
        """The colour monitor of paper B, section 2C, as printed, in cd/m2.

        Its printed T follows, to the last digit, from y = 0.597 for green instead of the printed
        0.607. Its tone curves are a figure that is not in the text; a gamma of 2.2 stands for them.
        """
        xy = [[0.614, 0.350], [0.306, 0.607], [0.149, 0.074]]
        # The gamma of a cathode-ray tube: paper B has its curves as figures only.
        return cls(xy, [42.7, 138.7, 27.3], 2.2, name="paper B's monitor")

    @classmethod
    def from_readings(
        cls, levels: Numbers, readings: Numbers, *, highest: int = 255, name: str = "measured"
    ) -> "Display":
        """A display from what a colorimeter reads of each primary alone at some levels.

        Args:
            levels: (readings,), levels that were measured, rising, with 0 and the highest among
                them.
            readings: (3, readings, 3), XYZ of red, green and blue at these levels, in any unit.
                What level 0 gives, the light of the room among it, is taken off.
            highest: highest level.
            name: for people.

        Raises:
            ValueError: another shape, or what `ToneCurve.from_readings` and `Display` refuse.

        Source: paper B, section 2; between the levels by monotone cubic interpolation.
        """
        at = np.asarray(levels, float)
        xyz = np.asarray(readings, float)
        if at.ndim != 1 or xyz.shape != (3, at.size, 3):
            raise ValueError(
                f"{at.size} levels need readings (3, {at.size}, 3), XYZ of each primary, not "
                f"{xyz.shape}"
            )
        # What level 0 shows, the room's light among it, is none of the primary's.
        primaries = xyz - xyz[:, :1]
        # The sum of X, Y and Z, since blue has hardly any Y.
        light = primaries.sum(axis=-1)
        tones = tuple(
            ToneCurve.from_readings(at, readings_of_one, highest) for readings_of_one in light
        )
        return cls(
            primaries[:, -1, :2] / light[:, -1:],
            primaries[:, -1, 1],
            tones,
            levels=highest,
            name=name,
        )

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """T of paper B, eq (3): XYZ to light in units of which `levels` is the most."""
        return self.levels * self._to_light

    @property
    def white(self) -> Float[np.ndarray, "3"]:
        """XYZ of all primaries at their highest level, (3,)."""
        return self._to_xyz.sum(axis=1)

    def linear(self, xyz: Numbers) -> Float[Array | np.ndarray, "*batch 3"]:
        """Light of each primary that makes up a colour, (..., 3): 0 to 1 within the gamut, linear
        in XYZ.

        Args:
            xyz: (..., 3), on the scale of `luminances`.
        """
        return _times(_floats(xyz), self._to_light)

    def to_rgb(self, xyz: Numbers, *, gamut: Gamut = "clip") -> Digital:
        """Digital RGB of colours, and where the display can't show them.

        Args:
            xyz: (..., 3), on the scale of `luminances`.
            gamut: what becomes of a colour outside: "clip" each primary to its range; "dim" it, if
                it is only too bright, until it fits, which keeps its chromaticity; "desaturate" it
                towards the grey of its luminance, which keeps luminance and, nearly, hue; or raise
                an "error".

        Returns:
            `Digital`: levels, nearest to the tone curve, and `outside`.

        Raises:
            ValueError: an unknown `gamut`, or, for "error", a colour outside; it is named.
        """
        if gamut not in get_args(Gamut):
            raise ValueError(f"gamut is {gamut!r}; it must be one of {', '.join(get_args(Gamut))}")
        light = self.linear(xyz)
        xp = array_module(light)
        outside = _outside(light)
        if gamut == "error":
            self._refuse(xyz, outside)
        in_gamut = _bring_inside(light, self.luminances / self.luminances.sum(), gamut)
        # No integer stands for NaN: it is shown black.
        levels = xp.nan_to_num(xp.round(self.encode(in_gamut)))
        return Digital(levels.astype(np.int32), outside)

    def look_up(self, xyz: Numbers, *, fine: bool = True) -> Digital:
        """Digital RGB by correction tables without interpolation, as the hardware of paper B makes
        it.

        Args:
            xyz: (..., 3), on the scale of `luminances`.
            fine: whether a second table, ten times finer, serves light below 14 of 255.

        Returns:
            `Digital`, in NumPy; colours outside are clipped. `to_rgb` comes nearer, for it
            interpolates.

        Source: paper B, section 2, figure 1.
        """
        light = np.asarray(self.linear(xyz))
        shown = np.where(np.isnan(light), 0.0, light)
        tables = 2 if fine else 1
        levels = [
            look_up(self.levels * shown[..., k], *tone.tables(self.levels)[:tables])
            for k, tone in enumerate(self.tones)
        ]
        return Digital(np.stack(levels, axis=-1).astype(np.int32), _outside(light))

    def encode(self, light: Numbers) -> Float[Array | np.ndarray, "*batch 3"]:
        """Levels before rounding, (..., 3), of the light of each primary, (..., 3), 0 to 1;
        differentiable.
        """
        values = _floats(light)
        return array_module(values).stack(
            [tone.level(values[..., k]) for k, tone in enumerate(self.tones)], axis=-1
        )

    def to_xyz(self, rgb: Numbers) -> Float[Array | np.ndarray, "*batch 3"]:
        """XYZ that the display shows for digital RGB, (..., 3), levels 0 to `levels`; fractions are
        interpolated.
        """
        values = _floats(rgb)
        light = [tone.light(values[..., k]) for k, tone in enumerate(self.tones)]
        return _times(array_module(values).stack(light, axis=-1), self._to_xyz)

    def adapt(self, xyz: Numbers, white: Numbers) -> Float[Array | np.ndarray, "*batch 3"]:
        """Colours as they look to an eye adapted to their white, for one adapted to the display's,
        by Bradford.

        Args:
            xyz: (..., 3), seen under `white`.
            white: (3,), XYZ of white in the scene; it becomes the display's own.
        """
        return _times(_floats(xyz), bradford(np.asarray(white, float), self.white))

    def _refuse(self, xyz: Numbers, outside: Bool[Array | np.ndarray | np.bool_, "*batch"]) -> None:
        """Name the first colour outside the gamut."""
        wrong = concrete(outside)
        if wrong is None:
            raise ValueError(
                'gamut="error" needs known colours: JAX traces them; look at `outside` instead'
            )
        if wrong.any():
            values = np.asarray(concrete(xyz), float)
            first = values[wrong][0]
            raise ValueError(
                f"{int(wrong.sum())} of {wrong.size} colours lie outside {self.name}, the first "
                f"with XYZ {np.array2string(first, precision=4)}; clip, dim or desaturate them"
            )

    def __repr__(self) -> str:
        return (
            f"Display({self.name!r}, white {np.array2string(self.white, precision=4)}, "
            f"{self.levels + 1} levels)"
        )


def _floats(values: Numbers) -> Float[Array | np.ndarray, "..."]:
    """Values as floats, in NumPy unless they are JAX's."""
    array = as_array(values)
    return (
        np.asarray(array, np.result_type(array, np.float32))
        if isinstance(array, np.ndarray)
        else as_float_array(array)
    )


def _outside(light: Channels) -> Bool[Array | np.ndarray | np.bool_, "*batch"]:
    """Mask of colours for which a primary would have to shine less than not at all, or more than it
    can, and of those that are NaN.
    """
    # Light beyond what the display has, in parts of its highest level, that is rounding rather than
    # another colour.
    return array_module(light).any(~((light >= -1e-6) & (light <= 1.0 + 1e-6)), axis=-1)


def _times(vectors: Channels, matrix: Float[np.ndarray, "3 3"]) -> Channels:
    """The matrix times each vector."""
    xp = array_module(vectors)
    return matmul(xp, vectors, xp.asarray(matrix.T, vectors.dtype))


def _bring_inside(light: Channels, shares: Float[np.ndarray, "3"], how: str) -> Channels:
    """Light of each primary, (..., 3), made to lie in [0, 1].

    Args:
        light: (..., 3), linear.
        shares: (3,), share of each primary in the luminance of white, sum 1.
        how: "clip" (or "error", where nothing is outside), "dim" or "desaturate".
    """
    xp = array_module(light)
    if how == "dim":
        light = light / xp.maximum(xp.max(light, axis=-1, keepdims=True), 1.0)
    elif how == "desaturate":
        light = _desaturate(light, shares)
    # What dimming can't bring in, and rounding elsewhere.
    return xp.clip(light, 0.0, 1.0)


def _desaturate(light: Channels, shares: Float[np.ndarray, "3"]) -> Channels:
    """Each colour moved towards the grey of its luminance just until it fits."""
    xp = array_module(light)
    # What is brighter than white becomes white.
    grey = xp.clip(
        xp.sum(light * xp.asarray(shares, light.dtype), axis=-1, keepdims=True), 0.0, 1.0
    )
    away = light - grey
    room = xp.where(away > 0.0, 1.0 - grey, grey)
    size = xp.abs(away)
    fits = size <= room
    keep = xp.where(fits, 1.0, room / xp.where(fits, 1.0, size))
    return grey + xp.min(keep, axis=-1, keepdims=True) * away
