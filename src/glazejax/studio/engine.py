"""What a stack looks like: spectra by glazejax's solver, in few shapes so that few programs are
compiled.

All that one change asks for is one call: the stack on its ground, on white and on black, the bare
grounds, the stack at another angle, a ladder of coats, and the stack with each coefficient a little
larger, for the 90 % band. Stacks are filled up with coats of no thickness, which are absent
exactly, to 1, 3 or 8.
"""

import threading
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .. import colour
from ..geometry import Bidirectional, Geometry, Hemispherical
from ..paint.describe import Coat
from ..paint.media import MAX_THICKNESS, Mixture, Pigment
from ..radiative.common.fresnel import dielectric_reflectance
from ..radiative.stack import stack_hemispherical_reflectance, stack_reflectance_factor
from ..stacks import BLACK, WHITE, Spectrum, Stack, all_paints, common_grid, paints

SIZES = (1, 3, 8)
"""Numbers of coats that programs are compiled for."""
WARM = (3, 1, 8)
"""The same, in the order in which they are wanted: the shelf is of three too."""
Key: TypeAlias = tuple[int, int, bool]
"""What a program is compiled for: coats, bands, and whether an integrating sphere looks."""
LADDER = (1, 2, 3, 5, 8, 13, 21, 34)
"""Coats of the ladder's steps."""
TOLERANCE = 1e-5
GAMUT = 0.002
"""How far outside [0, 1] sRGB may lie and still count as shown: half a step of 255."""
# Numbers of bands that spectra are filled up to.
_BANDS = (31, 41, 81, 161, 401, 1000)
# Relative step of k and s for their slopes, and standard deviations to the ends of the central 90
# %.
_STEP = 0.01
NINETY = 1.6448536269514722
# Stacks whose media are kept.
_KEPT = 64
_COEFFICIENTS = ("absorption", "scattering")
_TINY = 1e-30
# Rows of the batch: the stack on its ground, white and black, at another angle, and the three bare
# grounds.
_ON_GROUND = 0
_ON_WHITE = 1
_ON_BLACK = 2
_ANGLE = 3
_BARE = 4
_STEPS = 7
_FIXED = _STEPS + len(LADDER)


class View(NamedTuple):
    """How a stack is looked at.

    Attributes:
        lamps: names of illuminants, or (name, wavelengths, power) of one's own; the first is the
            main one.
        light, view: angles of the second geometry, degrees.
        repeated: the coat that the ladder repeats, counted from the top among those shown.
        pinned: L*a*b* of the reference, or None.
    """

    lamps: tuple[str | tuple[str, Float[np.ndarray, "lamp"], Float[np.ndarray, "lamp"]], ...] = (
        "D65",
    )
    light: float = 45.0
    view: float = 60.0
    repeated: int = 0
    pinned: tuple[float, float, float] | None = None


class Seen(NamedTuple):
    """A stack's spectra and colours: words, and arrays by name; `Engine.see` says which."""

    words: dict[str, Any]
    arrays: dict[str, Float[np.ndarray, "..."]]


class Engine:
    """Computes what stacks look like, and knows which shapes are compiled already."""

    def __init__(self) -> None:
        self._ready: set[Key] = set()
        self._kept: dict[Any, tuple[np.ndarray, list[Pigment | Mixture]]] = {}
        # One for each shape: a page that asks for what is compiled does not wait for what is not.
        self._locks: defaultdict[Key, threading.Lock] = defaultdict(threading.Lock)

    def size(self, stack: Stack) -> int:
        """Coats that the stack is filled up to.

        Raises:
            ValueError: more coats are shown than the largest of `SIZES`.
        """
        count = len(stack.shown)
        if count > SIZES[-1]:
            raise ValueError(
                f"{count} coats are shown (a ground that hides is one); hide some: {SIZES[-1]} "
                "at most"
            )
        return next(size for size in SIZES if size >= count)

    def compiles(self, stack: Stack) -> str:
        """What must be compiled before `see` can answer, in words; empty if nothing."""
        key = self._key(stack, self._media(stack)[0].size)
        return "" if key in self._ready else f"compiling for up to {key[0]} coats, once"

    def _key(self, stack: Stack, bands: int) -> Key:
        return self.size(stack), padded_size(bands), isinstance(stack.seen_by, Hemispherical)

    def see(self, stack: Stack, view: View) -> Seen:
        """Spectra and colours of a stack.

        Returns:
            arrays: `wavelengths` (bands,); `spectra` (7, bands): the stack on its ground, on white,
            on black, on its ground at the view's angles, then bare ground, white and black; `sd`
            (bands,), empty where it is not known;
            `ladder` (8, bands); `rgb`, `encoded` (lamps, 15, 3): 8-bit and unclipped sRGB of these
            spectra and the ladder's; `lab` (lamps, 3); `delta` (1,), CIEDE2000 to the pinned colour
            under the first lamp, or empty.

        Raises:
            ValueError: too many coats, an unknown lamp, or one that does not suit the spectra.
        """
        grid, media = self._media(stack)
        weights = [weights_of(lamp, grid) for lamp in view.lamps]
        k, s = (coefficients(media, what, grid.size) for what in _COEFFICIENTS)
        thickness = np.array([coat.total for coat in stack.shown])
        grounds = _grounds(stack, grid)
        key = self._key(stack, grid.size)
        spectra = self.solve(key, *_rows(k, s, thickness, grounds, view, key), stack, view)[
            :, : grid.size
        ]
        seen = spectra[:_STEPS]
        ladder = spectra[_STEPS:_FIXED]
        slopes = (
            spectra[_FIXED:].reshape(2, key[0], -1)[:, : len(media)] - seen[_ON_GROUND]
        ) / _STEP
        sd, why = deviation(media, slopes)
        words = {
            "rest": why,
            "coats": [coat.name for coat in stack.shown],
            "geometry": stack.seen_by.describe(),
        }
        arrays = {"wavelengths": grid, "spectra": seen, "sd": sd, "ladder": ladder}
        return Seen(words, arrays | _colours(np.concatenate([seen, ladder]), weights, stack, view))

    def _media(self, stack: Stack) -> tuple[Float[np.ndarray, "bands"], list[Pigment | Mixture]]:
        """Wavelengths and media of a stack; those of the last few are kept, for a slider changes
        thicknesses alone.
        """
        key = (
            tuple(coat.parts for coat in stack.shown),
            stack.ground if isinstance(stack.ground, str) else "",
        )
        if stack.pigments or isinstance(stack.ground, Spectrum):
            return common_grid(stack, paints(stack)), stack.media()
        if key not in self._kept:
            while len(self._kept) >= _KEPT:
                self._kept.pop(next(iter(self._kept)), None)
            self._kept[key] = common_grid(stack, paints(stack)), stack.media()
        return self._kept[key]

    def solve(
        self,
        key: Key,
        both: Float[np.ndarray, "2 rows bands coats"],
        depth: Float[np.ndarray, "rows coats"],
        ground: Float[np.ndarray, "rows bands"],
        stack: Stack,
        view: View,
    ) -> Float[np.ndarray, "rows bands"]:
        """Spectra of a batch as `rows_of` has it; who comes while its program is compiled waits for
        it.
        """
        light, seen = _angles(stack.seen_by, view, len(depth))
        with self._locks[key]:
            spectra = spectra_of(both, depth, ground, stack, light, seen)
            self._ready.add(key)
        return spectra

    def warm(self, sizes: Sequence[int] = WARM) -> None:
        """Compile for these numbers of coats, so that the first drag is quick."""
        paint = next(iter(all_paints().values()))
        for size in sizes:
            self.see(Stack(tuple(Coat(((1.0, paint.name),), 1e-6, 1) for _ in range(size))), View())

    def ready(self, key: Key) -> bool:
        """Whether a program is compiled."""
        return key in self._ready


def padded_size(bands: int) -> int:
    """Bands that spectra of so many are filled up to."""
    return next((n for n in _BANDS if n >= bands), bands)


def rows_of(size: int) -> int:
    """Rows of the batch for so many coats."""
    return _FIXED + 2 * size


def coefficients(
    media: Sequence[Pigment | Mixture], what: str, bands: int
) -> Float[np.ndarray, "coats bands"]:
    """k or s of coats, 1/m."""
    return np.array([np.asarray(getattr(medium, what), float) for medium in media]).reshape(
        -1, bands
    )


def _grounds(stack: Stack, grid: Float[np.ndarray, "bands"]) -> Float[np.ndarray, "3 bands"]:
    """The ground (white, of a card), white and black."""
    levels = (stack.ground_on(grid), WHITE, BLACK)
    return np.stack([np.broadcast_to(np.asarray(one, float), grid.shape) for one in levels])


def _rows(
    k: Float[np.ndarray, "coats bands"],
    s: Float[np.ndarray, "coats bands"],
    thickness: Float[np.ndarray, "coats"],
    grounds: Float[np.ndarray, "3 bands"],
    view: View,
    key: Key,
) -> tuple[
    Float[np.ndarray, "2 rows most size"],
    Float[np.ndarray, "rows size"],
    Float[np.ndarray, "rows most"],
]:
    """All rows of the batch, see the module: k and s, thicknesses, and grounds."""
    (size, most, _), (coats, bands) = key, k.shape
    rows = rows_of(size)
    depth = np.zeros((rows, size))
    depth[:, :coats] = thickness
    depth[_BARE:_STEPS] = 0.0
    if coats:
        repeated = min(view.repeated, coats - 1)
        depth[_STEPS:_FIXED, repeated] = np.minimum(
            np.array(LADDER) * thickness[repeated], MAX_THICKNESS
        )
    ground = np.broadcast_to(grounds[0], (rows, bands)).copy()
    ground[[_ON_WHITE, _ON_BLACK]] = grounds[1:]
    ground[_BARE:_STEPS] = grounds
    # The solver sees rows and bands only: filling up both keeps to few programs.
    columns = np.minimum(np.arange(most), bands - 1)
    both = np.zeros((2, rows, most, size))
    both[..., :coats] = np.stack([k, s])[:, None, :, columns].swapaxes(-1, -2)
    for i in range(size):
        both[0, _FIXED + i, :, i] *= 1 + _STEP
        both[1, _FIXED + size + i, :, i] *= 1 + _STEP
    return both, depth, ground[:, columns]


def spectra_of(
    both: Float[np.ndarray, "2 rows bands coats"],
    depth: Float[np.ndarray, "rows coats"],
    ground: Float[np.ndarray, "rows bands"],
    stack: Stack,
    light: Float[np.ndarray, "rows"],
    seen: Float[np.ndarray, "rows"],
) -> Float[np.ndarray, "rows bands"]:
    """What `glazejax.reflectance` gives for rows of stacks, without a glaze made for each.

    Args:
        both: k and s of the coats, 1/m.
        depth: thickness, m.
        ground: internal reflectance.
        stack: whose index and kind of geometry count.
        light, seen: angles of the rows, degrees; `seen` does not matter to an integrating sphere.
    """
    extinction = both.sum(axis=0)
    clear = extinction <= 1e-12
    albedo = np.where(clear, 0.0, both[1]) / np.where(clear, 1.0, extinction)
    cosines: dict[str, Any] = {"cos_incidence": np.cos(np.deg2rad(light))[:, None]}
    solve = stack_hemispherical_reflectance
    mirrored = np.full(len(depth), True)
    if isinstance(stack.seen_by, Bidirectional):
        cosines["cos_viewing"] = np.cos(np.deg2rad(seen))[:, None]
        solve = stack_reflectance_factor
        mirrored = light == seen
    index = stack.refractive_index
    found = solve(
        albedo,
        extinction * depth[:, None],
        ground,
        refractive_index=index,
        tolerance=TOLERANCE,
        **cosines,
    )
    if not stack.seen_by.specular or not mirrored.any():
        return np.asarray(found, float)
    surface = np.asarray(
        dielectric_reflectance(jnp.asarray(cosines["cos_incidence"]), jnp.asarray(index)), float
    )
    return np.asarray(found, float) + np.where(mirrored[:, None], surface, 0.0)


def _angles(
    main: Geometry, view: View, rows: int
) -> tuple[Float[np.ndarray, "rows"], Float[np.ndarray, "rows"]]:
    """Light and view of the stack's geometry in every row but one."""
    light, seen = alike_angles(main, rows)
    light[_ANGLE], seen[_ANGLE] = view.light, view.view
    return light, seen


def alike_angles(
    main: Geometry, rows: int
) -> tuple[Float[np.ndarray, "rows"], Float[np.ndarray, "rows"]]:
    """Light and view of a geometry in every row, degrees."""
    seen = float(np.asarray(main.viewing)) if isinstance(main, Bidirectional) else 0.0
    return np.full(rows, float(np.asarray(main.incidence))), np.full(rows, seen)


def deviation(
    media: Sequence[Pigment | Mixture], slopes: Float[np.ndarray, "2 coats bands"]
) -> tuple[Float[np.ndarray, "known"], str]:
    """Standard deviation of a spectrum by what is not known of its paints, to first order in log k
    and log s.

    Args:
        media: of the coats.
        slopes: of the spectrum, by log k and log s of each coat.

    Returns:
        Standard deviations, and why there are none: empty, and a sentence, where a paint does not
        state its own. Paints of one provenance share their errors (`Pigment.error_modes`); where a
        paint has standard deviations alone, its bands count as independent.
    """
    shared: dict[str, Any] = {}
    alone: dict[tuple[int, int], Any] = {}
    for i, medium in enumerate(media):
        whole = [np.asarray(getattr(medium, what), float) for what in _COEFFICIENTS]
        for paint, weight in _parts(medium):
            if weight == 0:
                continue
            if paint.absorption_sd is None and paint.error_modes is None:
                return np.zeros(0), f"no 90 % band: how sure {paint.name} is has not been stated"
            own = [np.asarray(getattr(paint, what), float) for what in _COEFFICIENTS]
            # Slope by log k of this paint alone: its share of the coat's k.
            slope = [slopes[j, i] * weight * own[j] / np.maximum(whole[j], _TINY) for j in (0, 1)]
            if paint.error_modes is not None:
                modes = np.asarray(paint.error_modes, float)
                change = modes[:, 0] * slope[0] + modes[:, 1] * slope[1]
                shared[paint.provenance] = shared.get(paint.provenance, 0.0) + change
                continue
            for j, sd in enumerate((paint.absorption_sd, paint.scattering_sd)):
                log_sd = 0.0 if sd is None else np.asarray(sd, float) / np.maximum(own[j], _TINY)
                alone[id(paint), j] = alone.get((id(paint), j), 0.0) + slope[j] * log_sd
    total = np.zeros(slopes.shape[-1])
    for change in shared.values():
        total = total + np.sum(change**2, axis=0)
    for change in alone.values():
        total = total + change**2
    return np.sqrt(total), ""


def _parts(medium: Pigment | Mixture) -> list[tuple[Pigment, float]]:
    """Paints of a coat and their weights."""
    if isinstance(medium, Mixture):
        return [
            (p, float(w)) for p, w in zip(medium.pigments, np.asarray(medium.weights), strict=True)
        ]
    return [(medium, 1.0)]


def weights_of(lamp: Any, grid: Float[np.ndarray, "bands"]) -> Float[np.ndarray, "bands 3"]:
    """XYZ of a lamp by its name, or of one's own as `View.lamps` has it."""
    return (
        colour.colour_weights(grid, lamp)
        if isinstance(lamp, str)
        else colour.lamp_weights(grid, *lamp[1:])
    )


def _colours(
    spectra: Float[np.ndarray, "rows bands"],
    weights: list[Float[np.ndarray, "bands 3"]],
    stack: Stack,
    view: View,
) -> dict[str, Float[np.ndarray, "..."]]:
    """8-bit and unclipped sRGB, L*a*b*, and the difference to the pinned colour."""
    rgb = []
    encoded = []
    lab = []
    for each in weights:
        xyz = spectra @ each
        white = each.sum(axis=0)
        encoded.append(np.asarray(colour.xyz_to_srgb(xyz, white, clip=False), float))
        rgb.append(np.round(255 * np.asarray(colour.xyz_to_srgb(xyz, white), float)))
        lab.append(np.asarray(colour.xyz_to_lab(xyz[_ON_GROUND], white), float))
    delta = np.zeros(0)
    if view.pinned is not None:
        delta = np.atleast_1d(np.asarray(colour.delta_e_2000(np.array(view.pinned), lab[0])))
    return {
        "rgb": np.array(rgb),
        "encoded": np.array(encoded),
        "lab": np.array(lab),
        "delta": delta,
    }
