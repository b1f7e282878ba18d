"""A stack of coats as a small JSON file: what the studio, `glazejax render` and Python hand to one
another. `save_glaze` and `load_glaze` write and read it; `Stack` is all that such a file holds.

    {"glazejax": "stack", "version": 1, "geometry": "45:0", "refractive_index": 1.5, "ground":
     "card", "coats": [{"paint": {"CobaltBlue": 1}, "um": 2}, {"paint": {"ZincWhite": 9, "Eosin":
     1}, "um": 20}]}

Coats are top first. `paint` holds parts by weight, which need not sum to 1; `um` is the thickness
in micrometres; a coat with `"hidden": true` is kept and not counted. The ground is a number (its
reflectance as seen from inside the paint), "white", "black", "card" (half of it white, half black),
``{"wavelengths": [...], "reflectance": [...]}``, or
``{"paint": {...}}``: a coat so thick that it hides whatever is below. Paints are the oils by their
names and the acrylics as ``acrylics/NAME``; `pigments` brings own ones: ``{"Mine": {"wavelengths":
[...], "absorption": [...], "scattering": [...]}}``, nm and 1/m.
"""

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float

from . import catalogue
from .geometry import Geometry, Instrument, geometry_of, parse_geometry
from .io.outputs import check_output
from .io.source import naming, open_source
from .io.write import write_files
from .paint.describe import (
    MAX_THICKNESS,
    Coat,
    WeightedPaints,
    find_name,
    name_paints,
    sum_weights,
)
from .paint.media import Glaze, Layer, Mixture, Pigment, Shelf, make_media
from .spectra import (
    Bands,
    common_range,
    describe_grid,
    lie_between,
    resample,
    same_grid,
    validate_wavelengths,
)

WHITE = 0.93
BLACK = 0.025
"""Internal reflectance of a usual white and black card: they read 84 % and 6 % bare."""
MOST_PARTS = 4
"""Paints in one coat, at most."""
MOST_COATS = 100
_MOST_BYTES = 8 << 20
# A field instrument reads 2151, from 350 to 2500 nm. The page has the same bound (check.js).
_MOST_BANDS = 5000
_KEYS = {"glazejax", "version", "coats", "ground", "refractive_index", "geometry", "pigments"}


class Spectrum(NamedTuple):
    """A measured ground: (bands,), nm, and (bands,), its reflectance as seen from inside
    the paint.
    """

    wavelengths: Bands
    reflectance: Bands

    def on(self, wavelengths: Float[np.ndarray, "other"]) -> Float[np.ndarray, "other"]:
        """Reflectance on other wavelengths, nm.

        Raises:
            ValueError: they reach beyond its own.
        """
        return np.asarray(resample(self.wavelengths, self.reflectance, wavelengths))


class Hiding(NamedTuple):
    """A ground of paint that hides: (weight, name) of its parts; the weights sum to 1."""

    parts: WeightedPaints


Ground: TypeAlias = "float | Literal['white', 'black', 'card'] | Spectrum | Hiding"


@dataclass(frozen=True)
class Stack:
    """Coats on a ground as one file or link holds them: paints by name, hidden coats, words for the
    ground. `glaze` makes of it the `glazejax.Glaze` that light meets.

    Attributes:
        coats: top first; those that are hidden are among them.
        hidden: one for each coat.
        ground: see the module.
        refractive_index: of all coats.
        instrument: words of `glazejax.geometry.parse_geometry`.
        pigments: own paints by name.
    """

    coats: tuple[Coat, ...]
    hidden: tuple[bool, ...] = ()
    ground: Ground = "card"
    refractive_index: float = 1.5
    instrument: str = "45:0"
    pigments: Shelf = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        if not self.hidden:
            object.__setattr__(self, "hidden", (False,) * len(self.coats))

    @property
    def shown(self) -> tuple[Coat, ...]:
        """Coats that count, top first; where the ground is a coat that hides, it is the last."""
        coats = tuple(
            coat for coat, hidden in zip(self.coats, self.hidden, strict=True) if not hidden
        )
        return (
            (*coats, Coat(self.ground.parts, MAX_THICKNESS, 1))
            if isinstance(self.ground, Hiding)
            else coats
        )

    def level(self, side: str = "white") -> "float | Spectrum":
        """Reflectance of the ground; of a card, that of its white or black side."""
        if isinstance(self.ground, int | float):
            return float(self.ground)
        if isinstance(self.ground, Spectrum):
            return self.ground
        if isinstance(self.ground, Hiding):
            # Nothing below a coat that hides is seen: any ground will do.
            return 0.5
        return {"white": WHITE, "black": BLACK}[side if self.ground == "card" else self.ground]

    def ground_on(
        self, wavelengths: Bands, side: str = "white"
    ) -> "float | Float[np.ndarray, 'bands']":
        """The ground's `level` at wavelengths in nm.

        Raises:
            ValueError: a measured ground that does not reach so far.
        """
        level = self.level(side)
        return level.on(wavelengths) if isinstance(level, Spectrum) else level

    def media(self) -> list[Pigment | Mixture]:
        """Media of the `shown` coats, all on the wavelengths that all of them share.

        Raises:
            ValueError: a paint that there is not, or paints and ground without common wavelengths.
        """
        shelf = paints(self)
        grid = common_grid(self, shelf)
        return make_media(name_paints(self.shown, shelf), shelf, grid)

    def glaze(self, side: str = "white") -> Glaze:
        """The stack for `glazejax.reflectance`.

        Args:
            side: of a card, "white" or "black".

        Raises:
            ValueError: as `media`, or no coat is shown.
        """
        media = self.media()
        if not media:
            raise ValueError("the stack shows no coat: add one, or show one that is hidden")
        ground = self.ground_on(media[0].wavelengths, side)
        coats = [Layer(medium, coat.total) for medium, coat in zip(media, self.shown, strict=True)]
        return Glaze(coats, ground, self.refractive_index)


def all_paints() -> dict[str, Pigment]:
    """Every paint of every catalogue: the oils by name, others as ``CATALOGUE/NAME``."""
    first, *further = catalogue.names()
    shelf = dict(catalogue.load(first))
    for catalogue_name in further:
        shelf |= {
            f"{catalogue_name}/{name}": paint
            for name, paint in catalogue.load(catalogue_name).items()
        }
    return shelf


def own_name(name: str) -> str:
    """A name for an own paint that none of the catalogues' has."""
    # A stroke is the catalogues', but for a name that was marked before.
    stroke = "/" in name and not name.endswith(" (own)")
    return f"{name} (own)" if stroke or name in all_paints() else name


def paints(stack: Stack) -> Shelf:
    """Paints that a stack may name: its own, then those of the catalogues."""
    return {**all_paints(), **stack.pigments}


def common_grid(stack: Stack, shelf: Shelf) -> Bands:
    """Wavelengths of the uppermost coat, nm, as far as all paints and the ground reach; of the oils
    without a coat.

    Raises:
        ValueError: they share none, or a paint is not known.
    """
    grids = [
        shelf[find_name(name, shelf)].wavelengths for coat in stack.shown for _, name in coat.parts
    ]
    grids = grids or [next(iter(shelf.values())).wavelengths]
    if isinstance(stack.ground, Spectrum):
        grids.append(stack.ground.wavelengths)
    grid = grids[0][lie_between(grids[0], *common_range(grids))]
    if grid.size == 0:
        raise ValueError(
            "the paints and the ground share no wavelengths: "
            + "; ".join(map(describe_grid, grids))
        )
    return grid


def read_stack(path: str | Path) -> Stack:
    """Read a stack of coats from the small JSON file that the studio and `write_stack` write.

    Args:
        path: the file; its form is that of `glazejax.stacks`.

    Returns:
        `Stack`; its ``glaze()`` goes to `glazejax.reflectance`.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not such a file; the message says where and what would fix it.
    """
    with open_source(path) as source:
        text = source.text(most=_MOST_BYTES, fallback=None)
    with naming(path):
        return parse_stack(text)


def write_stack(
    path: str | Path, stack: Stack, *, digits: int = 6, overwrite: bool = False
) -> Path:
    """Write a stack as JSON, for the studio, ``glazejax render --stack`` and `read_stack`.

    Args:
        path: the file; its folder must exist.
        stack: what is written.
        digits: of the coefficients of its own paints.
        overwrite: replace a file that is there.

    Returns:
        The path.

    Raises:
        ValueError: `read_stack` would refuse it; nothing is written.
        FileExistsError, FileNotFoundError, IsADirectoryError: see
            `glazejax.io.outputs.check_output`.
    """
    path = check_output(path, overwrite=overwrite, switch="overwrite=True")
    text = json.dumps(stack_to_dict(stack, digits), indent=1, ensure_ascii=False)
    content = f"{text}\n".encode()
    with naming(path):
        if len(content) > _MOST_BYTES:
            raise ValueError(
                f"the stack takes {len(content) / 2**20:.1f} MB, and {_MOST_BYTES >> 20} MB are "
                "read of such a file: resample its own paints to fewer wavelengths"
            )
        parse_stack(text)
    write_files({path: [content]}, overwrite=True)
    return path


def load_glaze(path: str | Path, *, side: Literal["white", "black"] = "white") -> Glaze:
    """Read a glaze from a file of `save_glaze`, the studio or ``glazejax render --write-stack``.

    Args:
        path: the file; its form is that of `glazejax.stacks`.
        side: which one counts where the ground is a card, half white and half black.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not such a file, or all its coats are hidden; the message says where and
            what would fix it.
    """
    if side not in ("white", "black"):
        raise ValueError(f"side is {side!r}; of a card it is white or black")
    return read_stack(path).glaze(side)


def save_glaze(
    glaze: Glaze,
    path: str | Path,
    *,
    instrument: Instrument | Geometry | str = "45:0",
    overwrite: bool = False,
) -> Path:
    """Write a glaze as a small JSON file for `load_glaze`, the studio and ``glazejax render``.

    Paints of the catalogues stand in it by their names, all others with their k and s; a
    mixture is named after its parts.

    Args:
        glaze: without batch axes and phase functions, of one refractive index.
        path: the file; its folder must exist.
        instrument: what the studio and the command then see it with; single angles.
        overwrite: replace a file that is there.

    Returns:
        The path.

    Raises:
        ValueError: what such a file does not hold: no coats, batch axes, phase functions, an
            index that varies, several angles, more than four paints in a coat, or what else
            `load_glaze` would refuse. Nothing is written then.
        FileExistsError, FileNotFoundError, IsADirectoryError: see
            `glazejax.io.outputs.check_output`.
    """
    return write_stack(path, stack_of(glaze, instrument), digits=17, overwrite=overwrite)


def stack_of(glaze: Glaze, instrument: Instrument | Geometry | str = "45:0") -> Stack:
    """A glaze as a stack: paints of the catalogues by their names, others as its own.

    Args:
        glaze: without batch axes and phase functions, of one refractive index.
        instrument: that it is seen with; single angles.

    Raises:
        ValueError: a glaze that no stack's file can hold, or several angles; the message says what
            of it.
    """
    if not glaze.coats:
        raise ValueError("a glaze without coats is its ground: there is nothing to save")
    if glaze.phase is not None:
        raise ValueError("a paint here has a phase function, which a stack's file does not hold")
    if glaze.optical_thickness.ndim > 2 or glaze.ground.ndim > 1:
        raise ValueError("a stack's file holds one glaze, without batch axes")
    if np.ndim(glaze.refractive_index):
        raise ValueError("a stack's file holds one refractive index for all wavelengths")
    own_paints: dict[str, Pigment] = {}
    coats = tuple(
        Coat(_named_parts(coat.medium, own_paints), float(coat.thickness), 1)
        for coat in glaze.coats
    )
    # A ground of one number stays one, whatever bands the coats have.
    ground = np.asarray(glaze.ground, float)
    return Stack(
        coats=coats,
        ground=float(ground) if ground.size == 1 else Spectrum(glaze.wavelengths, ground),
        refractive_index=float(glaze.refractive_index),
        instrument=Instrument(geometry_of(instrument)).geometry.notation,
        pigments=MappingProxyType(own_paints),
    )


def _named_parts(medium: Pigment | Mixture, own_paints: dict[str, Pigment]) -> WeightedPaints:
    """(weight, name) of a medium's paints, each once; `own_paints` takes those that no catalogue
    has.
    """
    mixed = isinstance(medium, Mixture)
    paints = medium.pigments if mixed else (medium,)
    if len(paints) > MOST_PARTS:
        raise ValueError(
            f"{medium.name!r} is of {len(paints)} paints; a coat has {MOST_PARTS} at most"
        )
    shelf = all_paints()
    weights: dict[str, float] = {}
    for paint, weight in zip(paints, medium.weights.tolist() if mixed else [1.0], strict=True):
        shipped = [paint.name, *(f"{group}/{paint.name}" for group in catalogue.names())]
        # A paint keeps a catalogue's name only with the catalogue's numbers.
        name = next((n for n in shipped if n in shelf and _same(shelf[n], paint)), "")
        if not name:
            name = own_name(paint.name)
            # Another paint of the same name is marked.
            while name in own_paints and not _same(own_paints[name], paint):
                name += "'"
            own_paints[name] = paint
        weights[name] = weights.get(name, 0.0) + weight
    return tuple((weight, name) for name, weight in weights.items())


def _same(first: Pigment, second: Pigment) -> bool:
    """Test whether two paints are one to light."""
    return same_grid(first.wavelengths, second.wavelengths) and all(
        np.array_equal(getattr(first, key), getattr(second, key))
        for key in ("absorption", "scattering")
    )


def parse_stack(text: str) -> Stack:
    """The stack of a JSON text.

    Raises:
        ValueError: no JSON, or none of a stack; the message names the value and the fix.
    """
    try:
        return stack_from_dict(json.loads(text))
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(
            f"not the JSON of a stack ({error}); the studio writes such files"
        ) from None


def stack_from_dict(content: Any) -> Stack:
    """The stack of what `json.loads` gives, checked whole.

    Raises:
        ValueError: something is missing, unknown or out of range; the message names the value and
            the fix.
    """
    if not isinstance(content, dict) or content.get("glazejax") != "stack":
        raise ValueError(
            'this is no stack: it must be an object such as {"glazejax": "stack", "coats": '
            '[{"paint": {"CobaltBlue": 1}, "um": 12}]}'
        )
    if content.get("version", 1) != 1:
        raise ValueError(
            f"the stack is of version {content['version']!r:.60}, and this glazejax reads version "
            "1: update it"
        )
    if unknown := set(content) - _KEYS:
        raise ValueError(
            f"a stack has no {sorted(unknown)[0]!r:.60}; it has {', '.join(sorted(_KEYS))}"
        )
    listed = content.get("coats", [])
    # A file from elsewhere may hold anything: sizes are bounded before its coats are read.
    if not isinstance(listed, list) or len(listed) > MOST_COATS:
        raise ValueError(f'"coats" must be a list of {MOST_COATS} coats at most')
    own_paints = _own(content.get("pigments", {}))
    shelf = {**all_paints(), **own_paints}
    # Paints may be the stack's own, so that these are read first.
    coats = tuple(_coat(i, coat, shelf) for i, coat in enumerate(listed, 1))
    index = _number("refractive_index", content.get("refractive_index", 1.5), 1.0, 2.5)
    geometry = content.get("geometry", "45:0")
    if not isinstance(geometry, str):
        raise ValueError(f"geometry is {geometry!r:.60}; write words such as 45:0 or d:8")
    parse_geometry(geometry)
    hidden = tuple(coat.get("hidden") is True for coat in listed)
    return Stack(
        coats=coats,
        hidden=hidden,
        ground=_ground(content.get("ground", "card"), shelf),
        refractive_index=index,
        instrument=geometry,
        pigments=MappingProxyType(own_paints),
    )


def _coat(number: int, content: Any, shelf: Shelf) -> Coat:
    where = f"coat {number}"
    if not isinstance(content, dict) or not {"paint", "um"} <= set(content):
        raise ValueError(
            f'{where} must have "paint" and "um", such as {{"paint": {{"CobaltBlue": 1}}, "um": '
            f"12}}"
        )
    thickest = MAX_THICKNESS * 1e6
    if (um := _real(content["um"])) is None:
        raise ValueError(
            f'{where}: "um" is {content["um"]!r:.60}; it must be a number of micrometres, '
            "without a unit"
        )
    if not 0 <= um <= thickest:
        raise ValueError(
            f"{where} is {um:g} micrometres thick; it must be between 0 and {thickest:g}"
        )
    return Coat(_parts(where, content["paint"], shelf), um / 1e6, 1)


def _parts(where: str, content: Any, shelf: Shelf) -> WeightedPaints:
    if not isinstance(content, dict) or not 1 <= len(content) <= MOST_PARTS:
        name = content if isinstance(content, str) else "CobaltBlue"
        raise ValueError(
            f"{where} must be of 1 to {MOST_PARTS} paints with their parts by weight, such as "
            f'"paint": {{{json.dumps(name, ensure_ascii=False)[:60]}: 1}}'
        )
    parts = []
    for name, value in content.items():
        if (weight := _real(value)) is None or not 0 <= weight <= 1e9:
            raise ValueError(
                f"{where}: the part of {name:.60} is {value!r:.60}; it must be a number from 0 on"
            )
        try:
            parts.append((weight, find_name(name, shelf)))
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
    # One paint may stand there in two spellings. Parts by weight become shares of one.
    weights = sum_weights(parts)
    total = sum(weights.values())
    if total <= 0:
        raise ValueError(f"{where}: all parts are 0; give one of its paints some weight")
    return tuple((weight / total, name) for name, weight in weights.items())


def _ground(content: Any, shelf: Shelf) -> Ground:
    if content in ("white", "black", "card"):
        return content
    if isinstance(content, dict) and "paint" in content:
        return Hiding(_parts("the ground", content["paint"], shelf))
    if isinstance(content, dict):
        grid, values = (
            _curve(f"{key} of the ground", content.get(key))
            for key in ("wavelengths", "reflectance")
        )
        grid = validate_wavelengths(grid)
        if values.shape != grid.shape or values.min() < 0 or values.max() > 1:
            raise ValueError("the ground needs one reflectance from 0 to 1 for each wavelength")
        return Spectrum(grid, values)
    if isinstance(content, str):
        raise ValueError(
            f"the ground is {content!r:.60}; write a number from 0 to 1, white, black or card"
        )
    # A number from 2 to 100 is most likely in percent.
    if (value := _real(content)) is not None and 2 <= value <= 100:
        raise ValueError(
            f"the ground is {content!r}; it must be a number between 0 and 1: {content!r} percent "
            f"are {value / 100:g}"
        )
    return _number("the ground", content, 0.0, 1.0)


def _own(content: Any) -> dict[str, Pigment]:
    if not isinstance(content, dict) or len(content) > MOST_COATS:
        raise ValueError(f'"pigments" must be {MOST_COATS} own paints at most, by name')
    for name in content:
        if len(name) > 200:
            raise ValueError(f"paint {name!r:.60} has a name of more than 200 characters")
    return {name: pigment_from_dict(name, columns) for name, columns in content.items()}


def pigment_from_dict(name: str, content: Any) -> Pigment:
    """One own paint of a stack.

    Raises:
        ValueError: a column is missing or holds what is no coefficient.
    """
    needed = ("wavelengths", "absorption", "scattering")
    if not isinstance(content, dict) or not {*needed} <= {*content}:
        raise ValueError(
            f"paint {name!r} must have wavelengths (nm), absorption and scattering (1/m)"
        )
    columns = [_curve(f"{key} of {name!r}", content[key]) for key in needed]
    # Errors are optional: a paint typed by hand has none.
    errors = {
        key: _curve(f"{key} of {name!r}", content[key])
        for key in ("absorption_sd", "scattering_sd")
        if key in content
    }
    identifiable = content.get("identifiable")
    return Pigment(
        name,
        *columns,
        **errors,
        identifiable=None if identifiable is None else np.asarray(identifiable, bool),
        provenance=str(content.get("provenance", ""))[:2000],
    )


def pigment_to_dict(paint: Pigment, digits: int = 6) -> dict[str, Any]:
    """A paint as a stack brings it; `pigment_from_dict` reads it. Error modes are not in it."""
    content: dict[str, Any] = {"wavelengths": [*map(float, paint.wavelengths)]}
    for key in ("absorption", "scattering", "absorption_sd", "scattering_sd"):
        values = getattr(paint, key)
        if values is not None:
            content[key] = [float(f"{value:.{digits}g}") for value in np.asarray(values)]
    if paint.identifiable is not None:
        content["identifiable"] = [bool(band) for band in paint.identifiable]
    return content | ({"provenance": paint.provenance} if paint.provenance else {})


def stack_to_dict(stack: Stack, digits: int = 6) -> dict[str, Any]:
    """Dictionary that `json.dumps` takes; `stack_from_dict` reads it.

    Args:
        stack: it.
        digits: of the coefficients of its own paints.
    """
    coats = []
    for coat, hidden in zip(stack.coats, stack.hidden, strict=True):
        entry: dict[str, Any] = {
            "paint": sum_weights(coat.parts),
            # Without the digits that a change of unit leaves behind.
            "um": float(f"{coat.total * 1e6:.12g}"),
        }
        coats.append(entry | ({"hidden": True} if hidden else {}))
    ground: Any = stack.ground
    if isinstance(ground, Spectrum):
        ground = {key: [float(value) for value in getattr(ground, key)] for key in ground._fields}
    elif isinstance(ground, Hiding):
        ground = {"paint": sum_weights(ground.parts)}
    content = {"glazejax": "stack", "version": 1, "coats": coats, "ground": ground}
    content |= {"refractive_index": stack.refractive_index, "geometry": stack.instrument}
    own_paints = {name: pigment_to_dict(paint, digits) for name, paint in stack.pigments.items()}
    return content | ({"pigments": own_paints} if own_paints else {})


def _real(value: Any) -> float | None:
    """A finite number of a file; None for all else, and for one with more digits than fit."""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _number(what: str, value_given: Any, low: float, high: float) -> float:
    if (value := _real(value_given)) is None or not low <= value <= high:
        raise ValueError(
            f"{what} is {value_given!r:.60}; it must be a number between {low:g} and {high:g}"
        )
    return value


def _curve(what: str, numbers: Any) -> Bands:
    if (
        not isinstance(numbers, list)
        or not 1 <= len(numbers) <= _MOST_BANDS
        or None in map(_real, numbers)
    ):
        raise ValueError(f"{what} must be a list of 1 to {_MOST_BANDS} numbers")
    return np.array(numbers, float)
