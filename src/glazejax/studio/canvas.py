"""Brushed coats to pixels: a table of colour over the thickness of each brushed coat, evaluated for
all pixels.

The table is `glazejax.interpolated`, as in `glazejax.picture`: computed by the solver at some
hundred points to meet a colour difference, then read for millions. The page keeps the maps of
thickness; it sends those of the box that changed.
"""

import json
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from .. import colour
from ..interpolated import MOST_AXES, Interpolated, interpolated
from ..paint.describe import Coat
from ..stacks import BLACK, Stack, all_paints, common_grid, paints, stack_to_dict
from .engine import GAMUT, Engine, alike_angles, coefficients, spectra_of, weights_of

DELTA_E = 0.2
"""Largest CIEDE2000 difference wanted between a pixel and its full computation."""
MOST_THICK = 1e-3
"""Thickest brushed coat, m."""
# Points are handed to the table by so many at a time, so that few programs are compiled.
_PIECES = (1 << 14, 1 << 18)
_BLOCK = 64
_KEPT = 4

Tell = Callable[[str], None]


class Painted(NamedTuple):
    """Pixels, RGBA in 8 bits, four bytes a number as `messages.pack` carries them, and what is said
    of them.
    """

    pixels: Float[np.ndarray, "pixels"]
    words: dict[str, Any]


class Easel:
    """Tables of the stacks that one page brushes."""

    def __init__(self, engine: Engine):
        self._engine = engine
        self._tables: dict[str, tuple[Interpolated, np.ndarray]] = {}

    def paint(
        self, stack: Stack, brushed: Any, maps: dict[str, Any], lamp: Any, tell: Tell
    ) -> Painted:
        """Colours of pixels.

        Args:
            stack: the coats, each as thick everywhere as it says, but those brushed.
            brushed: coats with a map, counted among those shown, each with the top of its range in
                micrometres.
            maps: `0`, `1`, ...: thickness in micrometres of each brushed coat, (pixels,); `side`: 1
                where the pixel lies on the black half of a card.
            lamp: of the colours.
            tell: takes words while a table is made.

        Raises:
            ValueError: more than three brushed coats, or maps that do not fit.
        """
        chosen = _chosen(brushed, stack)
        if missing := [n for n in range(len(chosen)) if str(n) not in maps]:
            raise ValueError(f"the map of brushed coat {missing[0]} is missing from the message")
        columns = {
            f"coat {i}": np.asarray(maps[str(n)], float).ravel() * 1e-6
            for n, (i, _) in enumerate(chosen)
        }
        tops = {f"coat {i}": top * 1e-6 for i, top in chosen}
        table, white = self._table(stack, tops, lamp, tell)
        count = next(iter(columns.values())).size
        if count == 0 or any(column.size != count for column in columns.values()):
            raise ValueError("the maps of thickness are empty or differ in size")
        for name, column in columns.items():
            if not np.all(np.isfinite(column)):
                raise ValueError("a map of thickness holds what is no number")
            np.clip(column, 0.0, tops[name], out=column)
        xyz = _read_table(table, columns, count)
        side = np.asarray(maps.get("side", np.zeros(0))).ravel().astype(int)
        on_card = xyz.shape[1] == 2 and side.shape == (count,)
        xyz = xyz[np.arange(count), np.clip(side, 0, 1) if on_card else 0]
        encoded = np.asarray(colour.xyz_to_srgb(_fill(xyz), white, clip=False))[:count]
        outside = float(np.mean(np.any((encoded < -GAMUT) | (encoded > 1 + GAMUT), axis=1)))
        rgba = np.full((count, 4), 255, np.uint8)
        rgba[:, :3] = np.round(255 * np.clip(encoded, 0, 1))
        words = {"error": table.error, "computed": table.evaluations, "outside": outside}
        return Painted(rgba.reshape(-1).view("<f4"), words)

    def _table(
        self, stack: Stack, tops: dict[str, float], lamp: Any, tell: Tell
    ) -> tuple[Interpolated, Float[np.ndarray, "3"]]:
        shown = stack_to_dict(stack)
        counted = [coat for coat in shown["coats"] if not coat.get("hidden")]
        for name in tops:
            counted[int(name.split()[1])]["um"] = (
                0  # its own thickness does not matter to the table
            )
        key = json.dumps(
            [shown, tops, lamp if isinstance(lamp, str) else [lamp[0], *map(list, lamp[1:])]]
        )
        if key not in self._tables:
            tell("making the canvas's table")
            made = _make_table(stack, tops, lamp, self._engine.size(stack))
            while len(self._tables) >= _KEPT:
                self._tables.pop(next(iter(self._tables)))
            self._tables[key] = made
        return self._tables[key]


def warm(engine: Engine) -> None:
    """Compile what the first canvas asks for: two brushed coats of oils on a card."""
    first, second = [name for name in all_paints() if "/" not in name][:2]
    coats = tuple(Coat(((1.0, name),), 1e-6, 1) for name in (first, second))
    maps = {name: np.zeros(1) for name in ("0", "1", "side")}
    Easel(engine).paint(Stack(coats), [[0, 1], [1, 1]], maps, "D65", lambda words: None)


def _chosen(brushed: Any, stack: Stack) -> list[tuple[int, float]]:
    """Brushed coats and the tops of their ranges in micrometres."""
    if not isinstance(brushed, list) or not 1 <= len(brushed) <= MOST_AXES:
        raise ValueError(
            f"brush 1 to {MOST_AXES} coats of a canvas; the others lie evenly: wipe one, or hide "
            "one"
        )
    found = []
    for one in brushed:
        match one:
            case [int(i), int() | float() as top] if (
                0 <= i < len(stack.shown) and 0 < top <= MOST_THICK * 1e6
            ):
                found.append((i, float(top)))
            case _:
                raise ValueError(
                    f"a brushed coat is at most {MOST_THICK * 1e6:g} micrometres thick, and is "
                    "one shown"
                )
    return found


def _make_table(
    stack: Stack, tops: dict[str, float], lamp: Any, size: int
) -> tuple[Interpolated, Float[np.ndarray, "3"]]:
    grid = common_grid(stack, paints(stack))
    media = stack.media()
    weights = weights_of(lamp, grid)
    white = weights.sum(axis=0)
    grounds = [
        np.broadcast_to(np.asarray(one, float), grid.shape)
        for one in (stack.ground_on(grid), BLACK)
    ]
    grounds = grounds if stack.ground == "card" else grounds[:1]
    k, s = (coefficients(media, what, grid.size) for what in ("absorption", "scattering"))
    fixed = np.array([coat.total for coat in stack.shown])
    light, seen = alike_angles(stack.seen_by, _BLOCK)

    def xyz(**columns: Float[np.ndarray, "points"]) -> Float[np.ndarray, "points sides 3"]:
        count = len(next(iter(columns.values())))
        depth = np.zeros((_BLOCK, size))
        depth[:, : len(fixed)] = fixed
        for name, column in columns.items():
            depth[:count, int(name.split()[1])] = column
        both = np.zeros((2, _BLOCK, grid.size, size))
        both[..., : len(media)] = np.stack([k, s])[:, None].swapaxes(-1, -2)
        sides = []
        for ground in grounds:
            below = np.broadcast_to(ground, (_BLOCK, grid.size))
            sides.append(spectra_of(both, depth, below, stack, light, seen)[:count] @ weights)
        return np.stack(sides, axis=1)

    def distance(one: Any, two: Any) -> Any:
        labs = [
            np.asarray(colour.xyz_to_lab(np.maximum(each, 0), white), float) for each in (one, two)
        ]
        return np.max(colour.delta_e_2000(*labs), axis=-1)

    ranges = {name: (0.0, top) for name, top in tops.items()}
    return interpolated(xyz, ranges, tolerance=DELTA_E, distance=distance, block=_BLOCK), white


def _piece(count: int) -> int:
    return next((size for size in _PIECES if size >= count), -(-count // _PIECES[-1]) * _PIECES[-1])


def _read_table(
    table: Interpolated, columns: dict[str, Float[np.ndarray, "pixels"]], count: int
) -> Float[np.ndarray, "pixels sides 3"]:
    """The table's values, in pieces of few sizes."""
    filled = {name: np.pad(column, (0, _piece(count) - count)) for name, column in columns.items()}
    return np.asarray(table(**filled), float)[:count]


def _fill(xyz: Float[np.ndarray, "pixels 3"]) -> Float[np.ndarray, "more 3"]:
    return np.pad(xyz, ((0, _piece(len(xyz)) - len(xyz)), (0, 0)))
