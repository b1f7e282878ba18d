"""Task of a search for recipes, checked before anything is computed."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypedDict

import numpy as np
from jaxtyping import Float

from glazejax import Bidirectional, Pigment, catalogue, colour
from glazejax.geometry import resolve_instrument
from glazejax.paint.media import MAX_THICKNESS
from glazejax.spectra import common_range, describe_grid, lie_between, same_grid

from ..film.films import Instrument, InstrumentLike
from ..film.model.mixing import Pigments, listed_pigments
from ..film.model.optics import Optics
from .distance import TargetArrays
from .model import StackModel, make_model
from .targets import Target, lab_target

DEFAULT_THICKNESS = (1e-6, 50e-6)
"""Thinnest and thickest coat in m, if nothing else is said; on the catalogue's scale of
thickness.
"""

_USUAL = {"max_paints": 3, "max_coats": 2}
"""Limits of a search for mixed coats, if nothing is said."""


class RecipeOptions(TypedDict, total=False):
    """Further arguments of `glazefit.find_recipes`, which says what each is."""

    ground: float | Float[np.ndarray, "bands"]
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
    pigments: tuple[Pigment, ...]
    ground: float | Float[np.ndarray, "bands"]
    instrument: Instrument
    illuminants: tuple[str, ...]
    test_illuminant: str
    observer: str
    max_paints: int
    max_coats: int
    glazes: bool
    thickness: tuple[float, float]
    count: int
    metamerism: float
    simplicity: float
    seed: int

    @property
    def mixed(self) -> "RecipeTask":
        """The same search with paints mixed within coats, as far as it is wide without being asked
        for more.
        """
        limits = {name: min(getattr(self, name), most) for name, most in _USUAL.items()}
        return replace(self, glazes=False, **limits)

    @property
    def wavelengths(self) -> Float[np.ndarray, "bands"]:
        """Wavelengths of the pigments, nm."""
        return self.pigments[0].wavelengths

    @functools.cached_property
    def optics(self) -> Optics:
        """The instrument, as the solver takes it."""
        return Optics.of(self.instrument)

    @functools.cached_property
    def model(self) -> StackModel:
        """Model of what stacks of these paints read, as arrays."""
        return make_model(
            self.pigments,
            self.ground,
            self.instrument,
            self.illuminants,
            self.observer,
            self.thickness,
        )

    @functools.cached_property
    def target_arrays(self) -> TargetArrays:
        """The targets as arrays."""
        return TargetArrays.of(
            self.targets, self.wavelengths, self.illuminants, self.observer, self.metamerism
        )


def make_task(
    targets: Sequence[Target],
    pigments: Pigments | None,
    *,
    ground: float | Float[np.ndarray, "bands"] = 0.9,
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
    # Coats of a single paint each are quickly gone through: all that are possible are.
    most_of = {"max_paints": 6, "max_coats": 6 if glazes else 4}
    usual = most_of if glazes else _USUAL
    max_paints = usual["max_paints"] if max_paints is None else max_paints
    max_coats = usual["max_coats"] if max_coats is None else max_coats
    limits = {
        "max_paints": (max_paints, most_of["max_paints"]),
        "max_coats": (max_coats, most_of["max_coats"]),
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
            f"{MAX_THICKNESS:g} m at most, "
            "such as (1e-6, 50e-6)"
        )
    # The mirror reflection is out of view, as a painter looks at a picture.
    seen_by = resolve_instrument(instrument or Bidirectional(45, 0), float(refractive_index))
    names = (
        tuple(dict.fromkeys(map(colour.find_illuminant, illuminants)))
        if illuminants
        else _stated_illuminants(targets)
    )
    full_observer = colour.find_observer(observer)
    for target in targets:
        for name in names:
            target.lab(name, full_observer)  # says what is missing
    paints, base = _on_one_grid(_list_pigments(pigments), ground, targets)
    return RecipeTask(
        targets=tuple(targets),
        pigments=paints,
        ground=base,
        instrument=seen_by,
        illuminants=names,
        test_illuminant=colour.find_illuminant(test_illuminant),
        observer=full_observer,
        max_paints=min(int(max_paints), len(paints)),
        max_coats=int(max_coats),
        glazes=bool(glazes),
        thickness=(low, high),
        count=int(count),
        metamerism=float(metamerism),
        simplicity=float(simplicity),
        seed=int(seed),
    )


def _stated_illuminants(targets: Sequence[Target]) -> tuple[str, ...]:
    """The illuminants that the colours are given under; D65 if all targets are spectra."""
    illuminants = dict.fromkeys(name for target in targets for name in target.labs)
    return tuple(illuminants) or (colour.find_illuminant("D65"),)


def as_targets(target: Any) -> tuple[tuple[Target, ...], bool]:
    """Targets of one or of a batch, and whether it is a batch; a target may be a `Target`, three
    numbers, or a mapping of such.
    """
    if isinstance(target, Target):
        return (target,), False
    first = _first(target)
    number = np.ndim(first) == 0 and not isinstance(first, Target | Mapping)
    if isinstance(target, Mapping) or number:
        return (lab_target(target),), False
    colours = (member if isinstance(member, Target) else lab_target(member) for member in target)
    return tuple(colours), True


def _first(target: Any) -> Any:
    try:
        return next(iter(target), ())
    except TypeError:
        raise ValueError(
            f"a target is a colour of three numbers, or made by spectral_target, not {target!r}"
        ) from None


def _list_pigments(pigments: Pigments | None) -> list[Pigment]:
    if pigments is None:
        pigments = catalogue.load()
    paints = listed_pigments(pigments)
    if not paints:
        raise ValueError(
            "there are no pigments: leave them out for the catalogue, or give at least one"
        )
    twice = {p.name for p in paints if [q.name for q in paints].count(p.name) > 1}
    if twice:
        raise ValueError(f"two pigments are called {min(twice)!r}: give each its own name")
    for paint in paints:
        if paint.absorption.ndim > 1 or paint.scattering.ndim > 1:
            raise ValueError(
                f"pigment {paint.name!r} is a batch of {paint.absorption.shape[:-1]}; give one "
                "paint"
            )
        if paint.phase is not None:
            raise ValueError(
                f"pigment {paint.name!r} has a phase function; here paint scatters isotropically"
            )
    return paints


def _on_one_grid(
    paints: list[Pigment], ground: float | Float[np.ndarray, "bands"], targets: Sequence[Target]
) -> tuple[tuple[Pigment, ...], float | Float[np.ndarray, "bands"]]:
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
            f"{describe_grid(grid)}, the "
            "wavelengths of the pigments"
        )
    wrong = base[~((base >= 0) & (base <= 1))]
    if wrong.size:
        raise ValueError(f"the ground's reflectance must lie in [0, 1], not {wrong.flat[0]:g}")
    if not shared.any():
        raise ValueError(f"pigments ({describe_grid(grid)}) and targets share no wavelengths")
    common = grid[shared]
    colour.colour_weights(common)  # says if too little is left for a colour
    same = [p if same_grid(p.wavelengths, common) else p.resample(common) for p in paints]
    return tuple(same), float(base) if base.ndim == 0 else base[shared]
