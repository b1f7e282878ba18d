"""Tone curves of a display: the light that digital levels give, measured, and read backwards.

Between knots the curve is straight, in both directions with the same knots, so that a level that is
turned into light and back is the same level to rounding.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, Real

from ...radiative.common.fresnel import Either, array_module
from ...spectra import Numbers, as_array, as_float_array

FINE_BELOW = 14
"""Light, of 255, below which paper B has its finer table."""

FINE_STEP = 0.1
"""Step of the finer table, in the same unit."""


@dataclass(frozen=True, eq=False)
class ToneCurve:
    """Digital levels and the light they give; both rise strictly.

    Args:
        levels: (knots,), from 0 to the highest level.
        lights: (knots,), in any unit; kept from 0 at the first to 1 at the last.

    Raises:
        ValueError: fewer than two knots, lengths that differ, or values that do not rise strictly.
    """

    levels: Real[np.ndarray, "..."]
    lights: Real[np.ndarray, "..."]

    def __post_init__(self) -> None:
        """Check the knots, and scale the light."""
        x = np.array(self.levels, float)
        y = np.array(self.lights, float)
        if x.ndim != 1 or x.shape != y.shape or x.size < 2:
            raise ValueError(
                f"a tone curve has as many lights as levels, at least 2, not {x.shape} and "
                f"{y.shape}"
            )
        # A curve that falls somewhere could not be read backwards.
        for what, values in (("levels", x), ("light", y)):
            falls = np.flatnonzero(~(np.diff(values) > 0))
            if falls.size:
                i = int(falls[0])
                raise ValueError(
                    f"{what} of a tone curve must rise: number {i + 2} is {values[i + 1]:g} "
                    f"after {values[i]:g}"
                )
        for name, values in (("levels", x), ("lights", (y - y[0]) / (y[-1] - y[0]))):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @classmethod
    def from_gamma(cls, gamma: float, levels: int = 255) -> "ToneCurve":
        """The power curve (level / highest)^gamma, with a knot at each level.

        Raises:
            ValueError: gamma is not positive.
        """
        if not gamma > 0:
            raise ValueError(f"gamma is {gamma}; it must be positive, such as 2.2")
        steps = np.arange(levels + 1.0)
        return cls(steps, (steps / levels) ** gamma)

    @classmethod
    def from_readings(cls, levels: Numbers, readings: Numbers, highest: int = 255) -> "ToneCurve":
        """Curve at every level from light measured at some of them, by monotone cubic interpolation
        (PCHIP).

        Args:
            levels: (readings,), levels that were measured, rising, with 0 and the highest among
                them.
            readings: (readings,), light of one primary, in any unit. What it gives at level 0 is
                taken off.
            highest: highest level.

        Raises:
            ValueError: the ends were not measured, or as `ToneCurve`.
        """
        from scipy.interpolate import PchipInterpolator

        measured = cls(np.asarray(levels), np.asarray(readings))
        if measured.levels[0] != 0 or measured.levels[-1] != highest:
            raise ValueError(f"measure levels 0 and {highest} too, not only {levels}")
        steps = np.arange(highest + 1.0)
        return cls(steps, PchipInterpolator(measured.levels, measured.lights)(steps))

    @classmethod
    def from_tables(cls, coarse: Numbers, fine: Numbers | None = None) -> "ToneCurve":
        """Curve from correction tables as paper B keeps them: the level to send for evenly spaced
        light.

        Args:
            coarse: (256,) or another number, levels for light 0, 1, ... of 255.
            fine: (141,), levels for light 0, 0.1, ... 14 of 255, used below 14 instead; they must
                meet there.

        Raises:
            ValueError: tables that do not meet, are too short or do not rise.

        Source: paper B, section 2B.
        """
        steps = np.asarray(coarse, float)
        if fine is None:
            return cls(steps, np.arange(steps.size))
        low = np.asarray(fine, float)
        light = np.arange(low.size) * FINE_STEP
        # The last whole step of light that both tables hold.
        count = int(np.floor(light[-1] + 1e-9))
        if steps.size <= count + 1 or abs(np.interp(count, light, low) - steps[count]) > 0.5:
            raise ValueError(
                f"the fine table ends at light {light[-1]:g}, where it does not meet the coarse one"
            )
        keep = light < count - 1e-9
        return cls(
            np.concatenate([low[keep], steps[count:]]),
            np.concatenate([light[keep], np.arange(count, steps.size)]),
        )

    def light(self, level: Numbers) -> Float[Either, "..."]:
        """Light, 0 to 1, of levels, (...)."""
        return _interpolate(level, self.levels, self.lights)

    def level(self, light: Numbers) -> Float[Either, "..."]:
        """Level, not rounded, that gives light 0 to 1, (...)."""
        return _interpolate(light, self.lights, self.levels)

    def tables(
        self, most: int = 255
    ) -> tuple[Float[np.ndarray, "coarse"], Float[np.ndarray, "fine"]]:
        """Correction tables as paper B keeps them, for `look_up`: coarse and, below 14, ten times
        finer.

        Source: paper B, section 2B, figures 2 and 3.
        """
        coarse = np.arange(most + 1.0)
        fine = np.arange(round(FINE_BELOW / FINE_STEP) + 1) * FINE_STEP
        steps, low = (np.interp(light / most, self.lights, self.levels) for light in (coarse, fine))
        return steps, low


def look_up(
    light: Float[np.ndarray, "..."],
    coarse: Float[np.ndarray, "coarse"],
    fine: Float[np.ndarray, "fine"] | None = None,
) -> Int[np.ndarray, "..."]:
    """Level from tables without interpolation: the entry nearest to the light, as the paper's
    hardware does it.

    Args:
        light: (...), in the unit of the tables, 0 to their last entry.
        coarse: levels for light 0, 1, 2, ...
        fine: levels for light 0, 0.1, ... 14, or None to use the coarse table everywhere.

    Source: paper B, section 2B.
    """
    values = np.clip(np.asarray(light, float), 0.0, len(coarse) - 1)
    entries = np.asarray(coarse)[np.rint(values).astype(int)]
    if fine is not None:
        below = np.minimum(np.rint(values / FINE_STEP).astype(int), len(fine) - 1)
        entries = np.where(values < FINE_BELOW, np.asarray(fine)[below], entries)
    return np.rint(entries).astype(int)


def _interpolate(x: Numbers, knots: np.ndarray, values: np.ndarray) -> Float[Either, "..."]:
    """Straight lines between knots, ends kept."""
    at = as_array(x)
    if isinstance(at, np.ndarray):
        return np.interp(at, knots, values)
    at = as_float_array(at)
    xp = array_module(at)
    return xp.interp(at, xp.asarray(knots, at.dtype), xp.asarray(values, at.dtype))
