"""What the example painting shows: coats of paint in smooth shapes, which fit any number
of pixels.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, UInt8

Range = tuple[float, float]


class CoatOf(NamedTuple):
    """One coat of a region.

    Attributes:
        paints: their names.
        microns: least and largest thickness, micrometres.
        shares: least and largest share of each paint but the last, of what the paints before it
            leave.
    """

    paints: tuple[str, ...]
    microns: Range
    shares: tuple[Range, ...] = ()


class Region(NamedTuple):
    """Part of the painting: coats from the top, at most three paints and three numbers
    that vary.
    """

    name: str
    coats: tuple[CoatOf, ...]

    @property
    def ranges(self) -> tuple[tuple[str, Range, bool], ...]:
        """Name, range in SI units and whether it varies by its logarithm, of each number that
        varies.
        """
        found = []
        for n, coat in enumerate(self.coats):
            found.append((f"thickness_{n}", (coat.microns[0] * 1e-6, coat.microns[1] * 1e-6), True))
            found += [(f"share_{n}_{i}", ends, ends[0] < 0.1) for i, ends in enumerate(coat.shares)]
        return tuple(entry for entry in found if entry[1][0] < entry[1][1])

    def shares(self, coat: int, values: dict[str, np.ndarray]) -> list[np.ndarray | float]:
        """Share of each paint in a coat, for numbers by name."""
        left = 1.0
        found = []
        for i, ends in enumerate(self.coats[coat].shares):
            part = values.get(f"share_{coat}_{i}", ends[0])
            found.append(left * part)
            left = left * (1.0 - part)
        return [*found, left]

    def thickness(self, coat: int, values: dict[str, np.ndarray]) -> np.ndarray | float:
        """Thickness of a coat in m, for numbers by name."""
        return values.get(f"thickness_{coat}", self.coats[coat].microns[0] * 1e-6)


FOREIGN = ("ViridianGreen", "Cochineal")
"""Paints of the oils that are in the painting, and are kept from those who map it. Neither has a
relative there.
"""

REGIONS = (
    Region("sky", (CoatOf(("CobaltBlue", "ZincWhite"), (18, 60), ((0.04, 0.5),)),)),
    Region("clouds", (CoatOf(("BoneBlack", "LeadWhite"), (15, 70), ((0.005, 0.05),)),)),
    Region(
        "hills",
        (
            CoatOf(
                ("UltramarineBlue", "EmeraldGreen", "ZincWhite"),
                (14, 40),
                ((0.08, 0.35), (0.15, 0.6)),
            ),
        ),
    ),
    Region("meadow", (CoatOf(("EmeraldGreen", "ChromeYellowPoppyseed"), (5, 22), ((0.3, 0.92),)),)),
    Region(
        "earth",
        (CoatOf(("BoneBlack", "Vermillion", "ChromeYellow"), (8, 30), ((0.05, 0.4), (0.2, 0.7))),),
    ),
    Region(
        "foliage in shade",
        (CoatOf(("PrussianBlue", "ChromeYellowOtero"), (8, 35), ((0.012, 0.09),)),),
    ),
    Region(
        "foliage in light",
        (
            CoatOf(("EmeraldGreen",), (4, 25)),
            CoatOf(("LeadWhite", "ChromeYellow"), (20, 20), ((0.2, 0.85),)),
        ),
    ),
    Region("trunk", (CoatOf(("BoneBlack", "Minium"), (7, 30), ((0.08, 0.5),)),)),
    Region(
        "red robe",
        (
            CoatOf(("Eosin",), (3, 45)),
            CoatOf(("Vermillion", "LeadWhite"), (12, 32), ((0.04, 0.7),)),
        ),
    ),
    Region(
        "blue mantle",
        (
            CoatOf(("UltramarineBlue",), (2, 22)),
            CoatOf(("BoneBlack", "LeadWhite"), (12, 32), ((0.01, 0.12),)),
        ),
    ),
    Region(
        "sash",
        (
            CoatOf(("Eosin",), (3, 25)),
            CoatOf(("UltramarineBlue",), (2, 9)),
            CoatOf(("LeadWhite",), (10, 30)),
        ),
    ),
    Region("hair", (CoatOf(("BoneBlack", "ChromeYellow"), (6, 25), ((0.1, 0.6),)),)),
    Region("halo", (CoatOf(("Minium", "ChromeYellow"), (6, 30), ((0.08, 0.6),)),)),
    Region(
        "flesh",
        (
            CoatOf(
                ("Vermillion", "ChromeYellow", "LeadWhite"), (15, 45), ((0.03, 0.2), (0.03, 0.15))
            ),
        ),
    ),
    Region("lights", (CoatOf(("LeadWhite",), (12, 70)),)),
    Region("berries", (CoatOf(("Vermillion",), (4, 30)),)),
    Region("foreign stroke", (CoatOf((FOREIGN[0],), (5, 35)),)),
    Region("foreign tint", (CoatOf((FOREIGN[1], "LeadWhite"), (12, 40), ((0.08, 0.5),)),)),
    Region("foreign glaze", (CoatOf((FOREIGN[0],), (2, 10)), CoatOf(("LeadWhite",), (12, 40)))),
)
"""All parts, by the number that `Scene.labels` gives."""

NUMBER = {region.name: n for n, region in enumerate(REGIONS)}


class Waves:
    """A smooth field of standard deviation 1: some waves of random direction and phase.

    Args:
        rng: draws the waves.
        cycles: least and largest number of cycles over the picture.
        turn: direction of the waves in radians, or None for any.
    """

    def __init__(
        self, rng: np.random.Generator, cycles: Range, turn: float | None = None, count: int = 7
    ):
        length = 2 * np.pi * np.exp(rng.uniform(np.log(cycles[0]), np.log(cycles[1]), count))
        angle = (
            rng.uniform(0, 2 * np.pi, count)
            if turn is None
            else turn + 0.25 * rng.standard_normal(count)
        )
        self.along_x, self.along_y = length * np.cos(angle), length * np.sin(angle)
        self.phase = rng.uniform(0, 2 * np.pi, count)
        height = (length / length.min()) ** -0.5
        self.height = height * np.sqrt(2.0 / np.sum(height**2))

    def __call__(self, x: np.ndarray, y: np.ndarray) -> Float[np.ndarray, "rows columns"]:
        """Values at columns x and rows y, both from 0 to 1."""
        # sin(a + b) by products of rows and columns: two small matrices in place of a sine a pixel.
        across = np.outer(self.along_x, x)
        down = np.outer(y, self.along_y) + self.phase
        rows = np.hstack([np.sin(down), np.cos(down)]) * np.tile(self.height, 2)
        return (rows @ np.vstack([np.cos(across), np.sin(across)])).astype(np.float32)


class Scene:
    """Where each region is and how paint varies in it; another seed is another painting of the same
    kind.

    Args:
        seed: of all that is drawn at random.
        shape: (y, x) in pixels.
    """

    def __init__(self, seed: int, shape: tuple[int, int]):
        rng = np.random.default_rng([seed, 18])
        self.shape = shape
        self.shift = rng.uniform(-0.03, 0.03, (8, 2))
        self.wobble = [Waves(rng, cycles) for cycles in ((1.5, 6), (4, 15), (6, 30))]
        self.cloud = Waves(rng, (1.5, 7))
        self.model: list[list[Waves]] = []
        self.brush: list[list[Waves]] = []
        for _ in REGIONS:
            turn = rng.uniform(0, np.pi)
            self.model.append([Waves(rng, (0.7, 5)) for _ in range(3)])
            self.brush.append([Waves(rng, (25, 110), turn) for _ in range(3)])

    def axes(self, y0: int, y1: int) -> tuple[np.ndarray, np.ndarray]:
        """Middles of columns and of rows y0 to y1, from 0 to 1."""
        return (np.arange(self.shape[1]) + 0.5) / self.shape[1], (
            np.arange(y0, y1) + 0.5
        ) / self.shape[0]

    def labels(self, y0: int, y1: int) -> UInt8[np.ndarray, "rows columns"]:
        """Number of the region of each pixel in rows y0 to y1."""
        columns, rows = self.axes(y0, y1)
        slow, middle, fast = (wave(columns, rows) for wave in self.wobble)
        x = columns[None, :].astype(np.float32)
        y = rows[:, None].astype(np.float32)
        found = np.full(slow.shape, NUMBER["sky"], np.uint8)

        def lay(name: str, where: np.ndarray) -> None:
            found[where] = NUMBER[name]

        def blob(n: int, at: Range, size: Range, edge: np.ndarray | float = 0.0) -> np.ndarray:
            dx, dy = self.shift[n]
            return ((x - at[0] - dx) / size[0]) ** 2 + ((y - at[1] - dy) / size[1]) ** 2 < 1 + edge

        lay("clouds", (self.cloud(columns, rows) - 4.0 * np.abs(y - 0.16) + 0.15 * fast > 0.35))
        lay("hills", y > 0.46 + 0.035 * slow)
        lay("meadow", y > 0.62 + 0.02 * slow + 0.006 * fast)
        lay("earth", y > 0.87 + 0.02 * middle + 0.004 * fast)
        lay(
            "trunk",
            (np.abs(x - 0.17 - self.shift[0, 0] - 0.008 * middle) < 0.018 + 0.03 * (y - 0.6) ** 2)
            & (y > 0.4)
            & (y < 0.88),
        )
        crown = blob(0, (0.17, 0.33), (0.15, 0.24), 0.18 * middle + 0.1 * fast)
        lay("foliage in shade", crown)
        lay(
            "foliage in light",
            crown & (fast + 0.8 * middle - 7.0 * (x - 0.17) - 4.0 * (y - 0.33) > 0.5),
        )
        berries = np.sin(95 * (x + 0.3 * y)) * np.sin(88 * (y - 0.2 * x))
        lay("berries", crown & (berries > 0.93))
        self._figure(lay, blob, x, y, middle)
        self._strokes(lay, x, y, fast)
        return found

    def _figure(self, lay, blob, x: np.ndarray, y: np.ndarray, middle: np.ndarray) -> None:
        """A standing figure in robe and mantle."""
        at = 0.58 + self.shift[1, 0]
        head = 0.27 + self.shift[1, 1]
        lay("halo", blob(1, (0.58, 0.26), (0.105, 0.14)))
        lay("hair", blob(1, (0.58, 0.275), (0.068, 0.1), 0.06 * middle))
        half = 0.055 + 0.19 * np.clip(y - head - 0.1, 0, 1) ** 0.7 + 0.006 * middle
        body = (np.abs(x - at) < half) & (y > head + 0.1) & (y < 0.94 + 0.012 * middle)
        lay("red robe", body)
        lay(
            "blue mantle",
            body & (x - at > 0.03 - 0.22 * np.sin(5 * (y - head)) * (y - 0.3) + 0.01 * middle),
        )
        lay("sash", body & (np.abs(y - head - 0.27 - 0.25 * (x - at) - 0.008 * middle) < 0.03))
        lay("flesh", (np.abs(x - at) < 0.024) & (y > head) & (y < head + 0.13))
        lay("flesh", blob(1, (0.58, 0.275), (0.046, 0.075)))
        lay("flesh", blob(2, (0.545, 0.56), (0.03, 0.022)) | blob(2, (0.61, 0.57), (0.028, 0.022)))
        lay(
            "hair",
            blob(1, (0.563, 0.262), (0.008, 0.009)) | blob(1, (0.597, 0.262), (0.008, 0.009)),
        )
        lay("lights", blob(1, (0.576, 0.285), (0.004, 0.022)))

    def _strokes(self, lay, x: np.ndarray, y: np.ndarray, fast: np.ndarray) -> None:
        """Lights and the strokes of foreign paint, with ragged edges."""

        def stroke(
            n: int, start: Range, ends: Range, slope: float, bow: float, width: float
        ) -> np.ndarray:
            dx, dy = self.shift[n]
            along = (x - ends[0] - dx) / (ends[1] - ends[0])
            line = start[0] + dy + slope * along + bow * np.sin(np.pi * along)
            return (np.abs(y - line) < width * (1 + 0.25 * fast)) & (along > 0) & (along < 1)

        lay("lights", stroke(3, (0.95, 0), (0.05, 0.4), -0.03, 0.02, 0.008))
        lay("lights", stroke(4, (0.52, 0), (0.78, 0.97), 0.03, -0.04, 0.01))
        lay("foreign stroke", stroke(5, (0.70, 0), (0.03, 0.36), 0.08, 0.03, 0.018))
        lay("foreign stroke", stroke(5, (0.79, 0), (0.78, 0.95), -0.04, 0.02, 0.013))
        lay("foreign tint", stroke(6, (0.36, 0), (0.76, 0.96), 0.05, 0.04, 0.016))
        lay("foreign tint", stroke(6, (0.84, 0), (0.05, 0.3), -0.03, -0.02, 0.012))
        lay("foreign glaze", stroke(7, (0.66, 0), (0.74, 0.97), 0.02, -0.05, 0.02))

    def fields(
        self,
        y0: int,
        y1: int,
        number: int,
        where: Bool[np.ndarray, "rows columns"],
        grain: Float[np.ndarray, "3 ..."],
    ) -> list[Float[np.ndarray, "pixels"]]:
        """From 0 to 1, how each number of a region varies over its pixels: modelling, brush, weave
        and grain.

        Args:
            y0, y1: first row and the one after the last.
            number: of the region.
            where: its pixels.
            grain: standard normal numbers, (3, rows, columns).
        """
        columns, rows = self.axes(y0, y1)
        down, across = np.nonzero(where)
        weave = np.sin(1.19 * across + 0.3) * np.sin(1.03 * (down + y0))
        found = []
        for n in range(len(REGIONS[number].ranges)):
            form = 1.2 * self.model[number][n](columns, rows) + 0.3 * self.brush[number][n](
                columns, rows
            )
            mixed = form[where] + 0.06 * weave + 0.04 * grain[n][where]
            found.append(0.5 + 0.5 * np.tanh(0.8 * mixed))
        return found
