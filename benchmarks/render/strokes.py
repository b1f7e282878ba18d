"""Maps that look painted: brush strokes with the marks of bristles, thick and thin, a primed
canvas, a wooden board.

    python -m benchmarks.render.strokes FILE.npy [--size ROWSxCOLUMNS] [--seed N]

Writes the heights of an impasto, 0 to about 1, for the key `relief` of a scene file.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from benchmarks.results import help_parser

_STROKES = 46


def _smooth(noise: np.ndarray, *widths: float) -> np.ndarray:
    """Periodic Gaussian blur by so many pixels along all axes, or each axis by its own number,
    normalised to unit spread.
    """
    spectrum = np.fft.fftn(noise)
    for k, n in enumerate(noise.shape):
        line = np.exp(-2.0 * (np.pi * widths[k % len(widths)] * np.fft.fftfreq(n)) ** 2)
        spectrum *= line.reshape([-1 if i == k else 1 for i in range(noise.ndim)])
    out = np.fft.ifftn(spectrum).real
    return (out - out.mean()) / out.std()


def brush_strokes(
    size: int, thickness: float = 1.4e-6, seed: int = 4
) -> Float[np.ndarray, "size size"]:
    """Thickness in m of a glaze laid on in curved strokes, each over what is left of those before;
    thin between.
    """
    rng = np.random.default_rng(seed)
    y, x = (np.mgrid[0:size, 0:size] + 0.5) / size
    paint = np.zeros((size, size))
    for _ in range(_STROKES):
        centre = rng.uniform(-0.05, 1.05, 2)
        # Strokes follow a swirl around a point off the middle.
        angle = np.arctan2(centre[1] - 0.52, centre[0] - 0.45) + np.pi / 2 + rng.normal(0, 0.25)
        length, width = rng.uniform(0.16, 0.42), rng.uniform(0.035, 0.085)
        dx, dy = x - centre[0], y - centre[1]
        along = dx * np.cos(angle) + dy * np.sin(angle)
        across = dy * np.cos(angle) - dx * np.sin(angle) - rng.uniform(0.2, 0.8) * along**2
        # One track a bristle; the paint runs out towards the end of the stroke.
        tracks = (
            _smooth(rng.normal(size=512), 3.0) * 0.28 + _smooth(rng.normal(size=512), 14.0) * 0.2
        )
        bristle = np.interp(across / width, np.linspace(-1.3, 1.3, 512), tracks)
        left = np.clip(0.75 - 0.55 * along / length, 0.0, 1.3)
        ridge = 0.55 * np.exp(-(((np.abs(across) / width - 0.93) / 0.07) ** 2))
        cover = 0.5 - 0.5 * np.tanh((np.abs(across) / width - 1.0) * 13.0)
        cover *= 0.5 - 0.5 * np.tanh((np.abs(along) - length) * 60.0 + bristle)
        body = np.clip(left * (1.0 + bristle) + ridge * left, 0.0, None)
        paint = paint * (1.0 - 0.55 * cover) + (0.35 + 0.65 * rng.random()) * cover * body
    grain = 1.0 + 0.03 * _smooth(rng.normal(size=(size, size)), 0.7)
    return thickness * np.clip(paint * grain, 0.0, None)


def primed_canvas(
    size: int, thickness: float = 12e-6, seed: int = 1
) -> Float[np.ndarray, "size size"]:
    """Thickness in m of a ground coat over a weave: thin on the threads, with slow variation of the
    hand.
    """
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:size, 0:size] / size
    waver = 0.004 * _smooth(rng.normal(size=(size, size)), size / 40)
    threads = np.cos(2 * np.pi * 64 * (x + waver)) * np.cos(2 * np.pi * 64 * (y - waver))
    slow = _smooth(rng.normal(size=(size, size)), size / 9)
    return thickness * np.clip(1.0 + 0.22 * slow + 0.16 * threads, 0.12, None)


def impasto(
    rows: int,
    columns: int,
    *,
    swirl: tuple[float, float] = (0.35, 0.6),
    brush: float = 0.06,
    strokes: int = 180,
    seed: int = 0,
) -> Float[np.ndarray, "rows columns"]:
    """Heights of thick paint laid on with a stiff brush, 0 to about 1: furrows of bristles, ridges
    next to a stroke and a lip where the brush was lifted. The shorter side is one unit long; `swirl`
    is the point that the strokes turn around, in units, right and up from the lower left corner,
    and `brush` half the width of the brush.
    """
    rng = np.random.default_rng(seed)
    short = min(rows, columns)
    right, high = columns / short, rows / short
    heights = 0.12 + 0.02 * _smooth(rng.normal(size=(rows, columns)), short / 60)
    for k in range(strokes):
        # Broad strokes first, finer ones over them.
        fine = k / strokes
        centre = rng.uniform((-0.05, -0.05), (right + 0.05, high + 0.05))
        away = centre - np.asarray(swirl)
        angle = (
            np.arctan2(away[1], away[0])
            + np.pi / 2
            + 0.35 * np.sin(5.0 * np.hypot(*away))
            + rng.normal(0, 0.2)
        )
        length = brush * rng.uniform(2.2, 4.5) * (1.2 - 0.4 * fine)
        width = brush * rng.uniform(0.7, 1.2) * (1.2 - 0.5 * fine)
        # Only the part of the panel that the stroke can reach.
        reach = length + 0.1
        low = np.clip(((centre - reach) * short).astype(int), 0, (columns, rows))
        top = np.clip(((centre + reach) * short).astype(int) + 1, 0, (columns, rows))
        if np.any(top <= low):
            continue
        x, y = np.meshgrid(
            (np.arange(low[0], top[0]) + 0.5) / short, (np.arange(low[1], top[1]) + 0.5) / short
        )
        heights[low[1] : top[1], low[0] : top[0]] = _stroke(
            heights[low[1] : top[1], low[0] : top[0]],
            x - centre[0],
            y - centre[1],
            angle,
            length,
            width,
            rng,
        )
    # Rows count from the top in a map.
    return heights[::-1]


def _stroke(
    before: np.ndarray,
    dx: np.ndarray,
    dy: np.ndarray,
    angle: float,
    length: float,
    width: float,
    rng,
) -> np.ndarray:
    """One stroke over what was there before: it wipes some of it aside and leaves its own paint."""
    along = dx * np.cos(angle) + dy * np.sin(angle)
    across = dy * np.cos(angle) - dx * np.sin(angle) - rng.uniform(-0.8, 0.8) * along**2
    side, end = across / width, along / length
    tracks = 0.1 * _smooth(rng.normal(size=256), 4.5) + 0.18 * _smooth(rng.normal(size=256), 14.0)
    bristle = np.interp(side, np.linspace(-1.3, 1.3, 256), tracks)
    ragged = end + 0.12 * bristle
    cover = (0.5 - 0.5 * np.tanh((np.abs(side) - 1.0) * 10.0)) * (
        0.5 - 0.5 * np.tanh((np.abs(ragged) - 1.0) * 14.0)
    )
    load = rng.uniform(0.35, 0.8)
    body = load * np.clip(0.75 - 0.3 * end, 0.1, 1.2) * (1.0 + bristle)
    ridge = 0.3 * load * np.exp(-(((np.abs(side) - 0.98) / 0.14) ** 2)) * (np.abs(end) < 1.1)
    lip = 0.45 * load * np.exp(-(((ragged - 0.95) / 0.1) ** 2)) * (np.abs(side) < 1.0)
    return before * (1.0 - 0.75 * cover) + cover * (body + lip) + 0.7 * ridge


def wiped_glaze(
    relief: Float[np.ndarray, "h w"],
    thickness: float,
    *,
    pooling: float = 1.0,
    uneven: float = 0.3,
    seed: int = 0,
) -> Float[np.ndarray, "h w"]:
    """Thickness in m of a glaze brushed over a relief and wiped: it stays in the furrows and leaves
    the ridges thin.

    Args:
        relief: heights, any unit.
        thickness: mean, m.
        pooling: how much more lies in a furrow one standard deviation deep, in parts of the mean.
        uneven: slow variation that the hand leaves, one standard deviation of the logarithm.
        seed: of that.
    """
    rng = np.random.default_rng(seed)
    near = _smooth(relief, 0.012 * max(relief.shape)) * relief.std() + relief.mean()
    depth = (near - relief) / (near - relief).std()
    slow = _smooth(rng.normal(size=relief.shape), 0.12 * min(relief.shape))
    found = np.exp(0.45 * pooling * depth + uneven * slow)
    return thickness * np.clip(found / found.mean(), 0.0, 3.0)


def wood_grain(
    rows: int, columns: int, *, boards: int = 4, seed: int = 0
) -> Float[np.ndarray, "rows columns"]:
    """How dark a table of boards is, 0 to 1: fibres along the rows, year rings, a gap between
    boards.
    """
    rng = np.random.default_rng(seed)
    size = rows, columns
    fibres = _smooth(rng.normal(size=size), 1.0, 90.0)
    pores = np.clip(_smooth(rng.normal(size=size), 0.8, 25.0) - 1.2, 0.0, None)
    waver = _smooth(rng.normal(size=size), rows / (5.0 * boards), columns / 3.0)
    y = (np.arange(rows)[:, None] + 0.5) / rows * boards
    board = np.floor(y).astype(int)
    rings = np.sin(2 * np.pi * (5.0 * y + rng.uniform(0, 1, boards)[board] + 0.5 * waver))
    tone = rng.normal(0.0, 0.09, boards)[board]
    found = 0.42 + tone + 0.1 * rings + 0.05 * fibres + 0.1 * pores
    gap = np.exp(-((np.abs(y - np.round(y)) / 0.006) ** 2)) * (
        (np.round(y) > 0) & (np.round(y) < boards)
    )
    return np.clip(found * (1.0 - gap) + gap, 0.0, 1.0)


def main() -> None:
    parser = help_parser(__doc__)
    parser.add_argument("file", type=Path, help="array to write, .npy")
    parser.add_argument("--size", default="600x800", help="rows and columns (default: %(default)s)")
    parser.add_argument(
        "--seed", type=int, default=0, help="of the random strokes (default: %(default)s)"
    )
    options = parser.parse_args()
    rows, columns = (int(part) for part in options.size.split("x"))
    np.save(options.file, impasto(rows, columns, seed=options.seed).astype(np.float32))
    print(f"written to {options.file}")


if __name__ == "__main__":
    main()
