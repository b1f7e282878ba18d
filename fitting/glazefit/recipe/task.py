"""Task of a search for recipes, checked before anything is computed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from glazejax import Bidirectional, Pigment, catalogue, colour
from glazejax.geometry import resolve_instrument
from glazejax.paint.media import MAX_THICKNESS
from glazejax.spectra import common_range, describe_grid, lie_between

from ..film.colour_metric import lab_metric
from ..film.films import Instrument, InstrumentLike, check_ground
from ..film.model.mixing import Pigments, check_paints, listed_pigments
from ..film.model.optics import Optics
from .model import StackModel, make_model
from .targets import Bands, Ground, Target, TargetArrays

DEFAULT_THICKNESS = (1e-6, 50e-6)
"""Thinnest and thickest coat in m, if nothing else is said; on the catalogue's scale of
thickness.
"""

_MOST_PAINTS = 100
"""Of these all sets of three are looked through in minutes."""
_MIXED = (3, 2)
"""Paints in a recipe and coats, at most, of mixed coats, if nothing is said."""


class RecipeOptions(TypedDict, total=False):
    """Further arguments of `glazefit.find_recipes`, which says what each is."""

    ground: Ground
    instrument: InstrumentLike | None
    refractive_index: float
    illuminants: Sequence[str] | None
    test_illuminant: str
    observer: str | int
    max_paints: int | None
    max_coats: int | None
    glazes: bool
    thickness: tuple[float, float]
    count: int
    metamerism: float
    simplicity: float
    seed: int


@dataclass(frozen=True)
class RecipeTask:
    """A search: names are full, pigments and ground on one grid that every target covers."""

    targets: tuple[Target, ...]
    target_arrays: TargetArrays
    model: StackModel
    optics: Optics
    span: tuple[float, float]  # thinnest and thickest coat, um
    pigments: tuple[Pigment, ...]
    ground: Ground
    instrument: Instrument
    illuminants: tuple[str, ...]
    test_illuminant: str
    observer: str
    max_paints: int
    max_coats: int
    glazes: bool
    count: int
    simplicity: float
    seed: int
    mixed: "RecipeTask | None" = None
    """Of unmixed coats: the same search with paints mixed within coats, as wide as it is without
    being asked for more.
    """

    @property
    def is_narrow(self) -> bool:
        """True where fewer paints or coats are allowed than are tried without being asked."""
        paints, coats = _usual_most(self.glazes)
        return self.max_paints < min(paints, len(self.pigments)) or self.max_coats < coats

    @property
    def wavelengths(self) -> Bands:
        """Wavelengths of the pigments, nm."""
        return self.pigments[0].wavelengths


def _usual_most(glazes: bool) -> tuple[int, int]:
    """Paints and coats that are tried at most without being asked."""
    # Coats of a single paint each are quickly gone through: all that are possible are.
    return (6, 6) if glazes else _MIXED


def make_task(
    targets: Sequence[Target],
    pigments: Pigments | None,
    *,
    ground: Ground = 0.9,
    instrument: InstrumentLike | None = None,
    refractive_index: float = 1.5,
    illuminants: Sequence[str] | None = None,
    test_illuminant: str = "A",
    observer: str | int = colour.CIE_1931,
    max_paints: int | None = None,
    max_coats: int | None = None,
    glazes: bool = False,
    thickness: tuple[float, float] = DEFAULT_THICKNESS,
    count: int = 5,
    metamerism: float = 0.2,
    simplicity: float = 0.3,
    seed: int = 0,
) -> RecipeTask:
    """Check all that was asked for; see `glazefit.find_recipes` for the arguments and errors."""
    if not targets:
        raise ValueError("there is no target: give a colour, such as (50, 20, 30), or a spectrum")
    usual_paints, usual_coats = _usual_most(glazes)
    max_paints = usual_paints if max_paints is None else max_paints
    max_coats = usual_coats if max_coats is None else max_coats
    limits = {
        "max_paints": (max_paints, 6),
        "max_coats": (max_coats, 6 if glazes else 4),
        "count": (count, 1000),
    }
    for name, (value, most) in limits.items():
        if not isinstance(value, int | np.integer) or not 1 <= value <= most:
            raise ValueError(f"{name} is {value}; it must be a whole number from 1 to {most}")
    for name, value in (("metamerism", metamerism), ("simplicity", simplicity)):
        if not (np.isfinite(value) and value >= 0):
            raise ValueError(f"{name} is {value:g}; it must be 0 or more, such as 0.1")
    low, high = (float(size) for size in thickness)
    if not 0 < low <= high <= MAX_THICKNESS:
        raise ValueError(
            f"thickness is {low:g} to {high:g} m; it must ascend from above 0 to "
            f"{MAX_THICKNESS:g} m at most, such as (1e-6, 50e-6)"
        )
    # The mirror reflection is out of view, as a painter looks at a picture.
    seen_by = resolve_instrument(instrument or Bidirectional(45, 0), float(refractive_index))
    # Those that the colours are given under; D65 if all targets are spectra.
    lights = illuminants or [name for target in targets for name in target.labs] or ["D65"]
    names = tuple(dict.fromkeys(map(colour.find_illuminant, lights)))
    full_observer = colour.find_observer(observer)
    shelf = listed_pigments(catalogue.load() if pigments is None else pigments)
    if not shelf:
        raise ValueError(
            "there are no pigments: leave them out for the catalogue, or give at least one"
        )
    if len(shelf) > _MOST_PAINTS and max_paints > 1:
        raise ValueError(
            f"{len(shelf)} paints make too many sets to try them all: name {_MOST_PAINTS} at most "
            "(--only), or set max_paints to 1"
        )
    check_paints(shelf)
    paints, base = _on_one_grid(shelf, ground, targets)
    grid = paints[0].wavelengths
    # Says which colour is missing.
    labs = np.stack([[target.lab(name, full_observer) for name in names] for target in targets])
    # A root mean squared difference of 0.01 weighs as much as this Delta E.
    weight = (100.0 * metamerism) ** 2 / grid.size
    task = RecipeTask(
        targets=tuple(targets),
        target_arrays=TargetArrays(
            lab=labs,
            metric=lab_metric(labs),
            spectrum=np.stack([target.on(grid) for target in targets]),
            spectral=weight * np.array([target.spectral for target in targets]),
        ),
        model=make_model(paints, base, seen_by, names, full_observer),
        optics=Optics.of(seen_by),
        span=(low * 1e6, high * 1e6),
        pigments=paints,
        ground=base,
        instrument=seen_by,
        illuminants=names,
        test_illuminant=colour.find_illuminant(test_illuminant),
        observer=full_observer,
        max_paints=min(int(max_paints), len(paints)),
        max_coats=int(max_coats),
        glazes=bool(glazes),
        count=int(count),
        simplicity=float(simplicity),
        seed=int(seed),
    )
    if not glazes:
        return task
    most_paints, most_coats = map(min, (task.max_paints, task.max_coats), _MIXED)
    mixed = replace(task, glazes=False, max_paints=most_paints, max_coats=most_coats)
    return replace(task, mixed=mixed)


def _on_one_grid(
    paints: list[Pigment], ground: Ground, targets: Sequence[Target]
) -> tuple[tuple[Pigment, ...], Ground]:
    """Pigments and ground on the bands of the first pigment that all pigments and target spectra
    cover.
    """
    grid = paints[0].wavelengths
    reach = [p.wavelengths for p in paints] + [
        t.wavelengths for t in targets if t.wavelengths is not None
    ]
    shared = lie_between(grid, *common_range(reach))
    base = np.asarray(ground, dtype=np.float64)
    if base.shape not in ((), grid.shape):
        raise ValueError(
            f"the ground has shape {base.shape}: give one number, or {grid.size} for "
            f"{describe_grid(grid)}, the wavelengths of the pigments"
        )
    check_ground(base)
    if not shared.any():
        raise ValueError(f"pigments ({describe_grid(grid)}) and targets share no wavelengths")
    common = grid[shared]
    colour.colour_weights(common)  # says if too little is left for a colour
    on_bands = tuple(paint.resample(common) for paint in paints)
    return on_bands, float(base) if base.ndim == 0 else base[shared]
