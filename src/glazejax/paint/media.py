"""Paint as a painter describes it: pigments, their mixtures, coats and glazes.

All of them are equinox modules, hence pytrees: they pass through jit, vmap and grad. Values are
checked when an object is built from concrete numbers; inside a traced function only shapes are.

Coefficients are those of radiative transfer, k (absorption) and s (scattering) in 1/m. They are not
Kubelka-Munk's K and S: K = 2k and, for isotropic scattering, S is about 3s/4. Scattering is
isotropic unless a phase function is given.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float

from ..spectra import (
    Bands,
    Grid,
    Numbers,
    Spectra,
    as_array,
    as_float_array,
    concrete,
    describe_grid,
    interpolation_matrix,
    matmul,
    numpy_or_jax,
    on_numpy_or_jax,
    same_grid,
    validate_wavelengths,
)
from .describe import MAX_THICKNESS, Coat
from .phase import Known, legal_phase, mix_moments, stack_moments


def _check_range(name: str, values: Numbers, low: float, high: float, hint: str = "") -> None:
    """Refuse concrete values that are not numbers in [low, high]."""
    if isinstance(values, float) and low <= values <= high and values < np.inf:
        return
    try:
        array = concrete(values)
    except ValueError:
        if isinstance(values, np.ma.MaskedArray):
            raise
        raise ValueError(
            f"{name} must be an array of numbers, but its rows differ in length"
        ) from None
    if array is None:
        return
    if not (jnp.issubdtype(array.dtype, jnp.floating) or jnp.issubdtype(array.dtype, jnp.integer)):
        received = repr(array.item()) if array.ndim == 0 else f"an array of {array.dtype}"
        raise ValueError(f"{name} must be real numbers, not {received}")
    wrong = array[~((array >= low) & (array <= high) & np.isfinite(array))]
    if wrong.size:
        bounds = f"finite and at least {low:g}" if high == np.inf else f"in [{low:g}, {high:g}]"
        value = float(wrong.flat[0])
        raise ValueError(f"{name} must be {bounds}, not {value:g}{hint if value > high else ''}")


# Largest thickness or share, and what a larger one is likely to be.
_LIMITS = {
    "thickness": (MAX_THICKNESS, ": thickness is in metres (20 micrometres are 20e-6)"),
    "fraction": (1.0, ""),
    "ground": (1.0, ", which looks like percent: divide it by 100"),
}
_SHAPES = ("a number", "a spectrum (bands,)", "a map (h, w)", "a map of spectra (h, w, bands)")


def check_quantity(kind: str, values: Numbers, of: str = "", hint: str = "") -> None:
    """Refuse concrete values that no coat or ground has.

    Args:
        kind: "thickness" in m, "fraction" or "ground".
        values: in any shape.
        of: what the error says behind the kind, such as "of 'Eosin'".
        hint: of the error, in place of what a larger value is likely to be.

    Raises:
        ValueError: the message names the first value that is out of range, and the fix.
    """
    most, usual_hint = _LIMITS[kind]
    _check_range(f"{kind} {of}" if of else kind, values, 0.0, most, hint or usual_hint)


def check_map(
    kind: str, values: Numbers, of: str = "", axes: Sequence[int] = (2,)
) -> Float[np.ndarray, "..."]:
    """A map as an array of legal numbers.

    Args:
        kind, of: see `check_quantity`.
        values: of the map, its first row on top.
        axes: how many axes it may have: 0 for one number, 1 for a spectrum, 2, or 3 for a map of
            spectra.

    Raises:
        ValueError: values that JAX traces, another number of axes, no values, or one out of range.
    """
    array = concrete(values)
    name = f"{kind} {of}" if of else kind
    if array is None:
        raise ValueError(
            f"{name} is traced by JAX, but a map is looked at: make it outside jit and grad"
        )
    if array.ndim not in axes or array.size == 0:
        shapes = " or ".join(_SHAPES[count] for count in axes)
        raise ValueError(f"{name} has shape {array.shape}; it must be {shapes}, not empty")
    array = np.asarray(array, float)
    check_quantity(kind, array, of)
    return array


def shared_shape(maps: Sequence[tuple[str, Float[np.ndarray, "..."]]]) -> tuple[int, ...]:
    """The shape of maps, given with their names.

    Raises:
        ValueError: they differ in shape; the message lists them.
    """
    if len({values.shape for _, values in maps}) > 1:
        listing = ", ".join(f"{name} {values.shape}" for name, values in maps)
        raise ValueError(f"maps differ in shape: {listing}")
    return maps[0][1].shape


def _describe_value(value: Any) -> str:
    """Description of a value in a word: a text as it is, else its type."""
    return repr(value) if isinstance(value, str) else f"a {type(value).__name__}"


def _legal_modes(name: str, modes: Numbers, bands: int) -> Float[Array, "modes 2 bands"]:
    values = as_array(modes)
    if values.ndim != 3 or values.shape[1:] != (2, bands):
        raise ValueError(
            f"error_modes of {name!r} have shape {values.shape}; they must be (modes, 2, {bands})"
        )
    numbers = concrete(values)
    if numbers is not None and not np.all(np.isfinite(numbers)):
        raise ValueError(f"error_modes of {name!r} must be finite")
    return as_float_array(values)


@dataclass(frozen=True, eq=False, repr=False)
class _Labels:
    """Labels of a paint that nothing is computed from: each equals all others, so that a program
    compiled for one paint serves all of its shape.
    """

    name: str
    provenance: str = ""
    family: str = ""
    source: str = ""
    binder: str = ""
    identifiable: tuple[bool, ...] | None = None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Labels)

    def __hash__(self) -> int:
        return hash(_Labels)

    def __repr__(self) -> str:
        return "labels"


class _PlainMeta(type(eqx.Module)):
    """Makes objects as `type` does: Equinox looks afterwards whether each field is set, of every
    class that the object is of, which takes as long as everything else in a coat.
    """

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        made = object.__new__(cls)
        made.__init__(*args, **kwargs)
        return made


class _PlainModule(eqx.Module, metaclass=_PlainMeta):
    """Base whose attributes are read as those of other objects: Equinox asks of each whether it is
    a method to bind, and of each that is set whether it may be. That takes a microsecond or two
    each time, so that `__init__` sets all at once.
    """

    if not TYPE_CHECKING:
        __getattribute__ = object.__getattribute__


class _Labelled(_PlainModule):
    """Base of what has a name and wavelengths."""

    _labels: eqx.AbstractVar[_Labels]
    _grid: eqx.AbstractVar[tuple[float, ...]]

    @property
    def name(self) -> str:
        """Name of it."""
        return self._labels.name

    @property
    def wavelengths(self) -> Bands:
        """Wavelengths in nm, (bands,)."""
        return np.asarray(self._grid)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {describe_grid(self.wavelengths)})"


class Pigment(_Labelled):
    """One paint: how strongly it absorbs and scatters at every wavelength.

    Args:
        name: name of the paint.
        wavelengths: (bands,), nm, ascending. Static: the grid belongs to the program, not to its
            data.
        absorption: (..., bands), k in 1/m, >= 0.
        scattering: (..., bands), s in 1/m, >= 0.
        identifiable: (bands,), booleans: where the data that k and s were fitted to determine both;
            where not, only their ratio is known. None if not stated.
        absorption_sd: (..., bands), standard deviation of k in 1/m, or None.
        scattering_sd: (..., bands), standard deviation of s in 1/m, or None.
        error_modes: (modes, 2, bands), what the data leave open in log k and log s: with z standard
            normal, k exp(z error_modes[:, 0]) and s exp(z error_modes[:, 1]) are as likely as k and
            s. Pigments of the same provenance share z: their errors are correlated. None if not
            stated.
        phase: Legendre moments of the phase function (`glazejax.radiative.phase`), (terms,) or
            (bands, terms); None is isotropic scattering.
        provenance: where the numbers come from, and the assumed thickness if they rest on one.
        family: the pigment that it is a paint of, such as "azurite"; empty if not stated.
        source: whose paint it is; empty if not stated.
        binder: of the paint, in words; empty if not stated.

    Raises:
        ValueError: shapes do not match, a coefficient is negative or not finite, or moments are no
            phase function's.
    """

    absorption: Float[Array, "*batch bands"]
    scattering: Float[Array, "*batch bands"]
    absorption_sd: Float[Array, "*batch bands"] | None
    scattering_sd: Float[Array, "*batch bands"] | None
    error_modes: Float[Array, "modes 2 bands"] | None
    phase: Float[Array, "*bands terms"] | None
    _labels: _Labels = eqx.field(static=True)
    # A tuple, because what is static must be hashable.
    _grid: tuple[float, ...] = eqx.field(static=True)

    def __init__(
        self,
        name: str,
        wavelengths: Grid,
        absorption: Spectra,
        scattering: Spectra,
        *,
        identifiable: Grid | None = None,
        absorption_sd: Spectra | None = None,
        scattering_sd: Spectra | None = None,
        error_modes: Numbers | None = None,
        phase: Numbers | None = None,
        provenance: str = "",
        family: str = "",
        source: str = "",
        binder: str = "",
    ):
        grid = validate_wavelengths(wavelengths)

        def spectrum(what: str, values: Numbers | None) -> Any:
            if values is None:
                return None
            what = f"{what} of {name!r}"
            values = as_array(values)
            if values.shape[-1:] != grid.shape:
                raise ValueError(
                    f"{what} has shape {values.shape}, which does not end in the {grid.size} "
                    "bands of its wavelengths"
                )
            _check_range(what, values, 0.0, np.inf)
            return as_float_array(values)

        mask = None if identifiable is None else np.asarray(identifiable)
        if mask is not None and (mask.shape != grid.shape or mask.dtype != bool):
            raise ValueError(f"identifiable of {name!r} must be {grid.size} booleans, one a band")
        labels = _Labels(
            name=name,
            provenance=provenance,
            family=family,
            source=source,
            binder=binder,
            identifiable=None if mask is None else tuple(mask.tolist()),
        )
        vars(self).update(
            absorption=spectrum("absorption", absorption),
            scattering=spectrum("scattering", scattering),
            absorption_sd=spectrum("absorption_sd", absorption_sd),
            scattering_sd=spectrum("scattering_sd", scattering_sd),
            error_modes=None if error_modes is None else _legal_modes(name, error_modes, grid.size),
            phase=None if phase is None else legal_phase(repr(name), phase, grid.size),
            _labels=labels,
            _grid=tuple(grid.tolist()),
        )

    @property
    def provenance(self) -> str:
        """Source of the numbers, and the assumed thickness if they rest on one."""
        return self._labels.provenance

    @property
    def family(self) -> str:
        """The pigment that it is a paint of; empty if not stated."""
        return self._labels.family

    @property
    def source(self) -> str:
        """Whose paint it is; empty if not stated."""
        return self._labels.source

    @property
    def binder(self) -> str:
        """Of the paint, in words; empty if not stated."""
        return self._labels.binder

    @property
    def identifiable(self) -> Bool[np.ndarray, "bands"] | None:
        """Mask of bands where the data determine both k and s, (bands,), or None if not stated."""
        mask = self._labels.identifiable
        return None if mask is None else np.asarray(mask)

    def resample(self, wavelengths: Grid) -> "Pigment":
        """The same paint on another grid (nm), by linear interpolation.

        A new band counts as identifiable if the old bands that it is interpolated from are.

        Raises:
            ValueError: the new grid is not legal or reaches beyond the old one.
        """
        if same_grid(self.wavelengths, validate_wavelengths(wavelengths)):
            return self
        matrix = interpolation_matrix(self.wavelengths, wavelengths)

        def at(values: Any) -> Any:
            if values is None:
                return None
            return on_numpy_or_jax(matmul, values, matrix.astype(values.dtype))

        phase = self.phase
        # Moments of each band are resampled as a spectrum is; moments for all bands stay.
        if phase is not None and phase.ndim == 2 and phase.shape[0] > 1:
            phase = on_numpy_or_jax(matmul, matrix.T.astype(phase.dtype), phase)
        mask = self.identifiable
        resampled = None if mask is None else ~np.any(matrix[~mask] > 0, axis=0)
        return type(self)(
            wavelengths=wavelengths,
            absorption=at(self.absorption),
            scattering=at(self.scattering),
            absorption_sd=at(self.absorption_sd),
            scattering_sd=at(self.scattering_sd),
            error_modes=at(self.error_modes),
            phase=phase,
            **{**vars(self._labels), "identifiable": resampled},
        )

    def renamed(
        self,
        name: str,
        *,
        family: str | None = None,
        source: str | None = None,
        binder: str | None = None,
        provenance: str | None = None,
    ) -> "Pigment":
        """The same paint under another name, and with another family, source, binder or provenance
        where these are given.
        """
        changes = {"family": family, "source": source, "binder": binder, "provenance": provenance}
        new = {key: value for key, value in changes.items() if value is not None}
        renamed = copy(self)
        object.__setattr__(renamed, "_labels", replace(self._labels, name=name, **new))
        return renamed


class Mixture(_Labelled):
    """Paints mixed in known proportions; coefficients add: k = sum c_i k_i, s = sum c_i s_i.

    Phase functions are averaged by the light that each paint scatters, c_i s_i.

    Args:
        pigments: one or more paints on the same wavelengths.
        weights: (..., pigments), fractions >= 0 that sum to 1 within 1e-6.
        name: name of the mixture; made of its parts if left out.

    Raises:
        ValueError: no pigments, another number of weights, a negative weight, a sum that is not 1,
            or pigments on different grids.

    Source: the linear law of Duncan (1940) for Kubelka-Munk coefficients, which radiative transfer
    shares.
    """

    pigments: tuple[Pigment, ...]
    weights: Float[Array, "*batch pigments"]
    _labels: _Labels = eqx.field(static=True)

    def __init__(
        self,
        pigments: Sequence[Pigment],
        weights: Numbers,
        name: str | None = None,
    ):
        pigments = (pigments,) if isinstance(pigments, Pigment) else tuple(pigments)
        for pigment in pigments:
            if not isinstance(pigment, Pigment):
                raise ValueError(f"a mixture is of Pigments, not of {_describe_value(pigment)}")
        if not pigments:
            raise ValueError("a mixture needs at least one pigment")
        _check_grids(pigments)
        fractions = as_array(weights)
        if fractions.shape[-1:] != (len(pigments),):
            raise ValueError(
                f"weights of shape {fractions.shape} do not end in one for each of "
                f"{len(pigments)} pigments"
            )
        _check_range("weights", fractions, 0.0, np.inf)
        values = concrete(fractions)
        if values is not None:
            # In double precision: many single-precision weights would not sum to 1 within 1e-6.
            totals = values.astype(np.float64).sum(axis=-1).ravel()
            # The sum farthest from 1 is the one to name.
            furthest = totals[np.abs(totals - 1.0).argmax()] if totals.size else 1.0
            if abs(furthest - 1.0) > 1e-6:
                fix = (
                    "divide them by their sum" if furthest > 0 else "at least one must be positive"
                )
                raise ValueError(f"weights must sum to 1, but sum to {furthest:.7g}: {fix}")
        vars(self).update(
            pigments=pigments,
            weights=as_float_array(fractions),
            _labels=_Labels(" + ".join(p.name for p in pigments) if name is None else name),
        )

    @property
    def _grid(self) -> tuple[float, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.pigments[0]._grid

    @property
    def absorption(self) -> Float[Array, "*batch bands"]:
        """Absorption k in 1/m, (..., bands)."""
        return jnp.asarray(_coefficient(self, "absorption"))

    @property
    def scattering(self) -> Float[Array, "*batch bands"]:
        """Scattering s in 1/m, (..., bands)."""
        return jnp.asarray(_coefficient(self, "scattering"))

    @property
    def phase(self) -> Float[Array, "*batch bands terms"] | None:
        """Legendre moments of the phase function, (..., bands, terms), or None if all paints
        scatter isotropically.
        """
        scattered = [self.weights[..., i, None] * p.scattering for i, p in enumerate(self.pigments)]
        return mix_moments([p.phase for p in self.pigments], scattered)

    def resample(self, wavelengths: Grid) -> "Mixture":
        """The same mixture on another grid (nm); see `Pigment.resample`."""
        return type(self)([p.resample(wavelengths) for p in self.pigments], self.weights, self.name)


class Layer(_PlainModule):
    """A homogeneous coat of paint.

    Args:
        medium: what it is made of.
        thickness: scalar or (...), m, in [0, 0.01]; 0 is exactly no layer.
        phase: Legendre moments of its phase function, (terms,) or (bands, terms), in place of those
            of the medium.

    Raises:
        ValueError: moments are no phase function's, or the thickness is negative, not finite, or so
            large that it cannot be in metres.
    """

    medium: Pigment | Mixture
    thickness: Float[Array, "*batch"]
    _phase: Float[Array, "*bands terms"] | None

    def __init__(self, medium: Pigment | Mixture, thickness: Numbers, phase: Numbers | None = None):
        if not isinstance(medium, Pigment | Mixture):
            raise ValueError(
                f"a layer is of a Pigment or a Mixture, not {_describe_value(medium)}; "
                "the catalogue's paints are glazejax.catalogue.load()[NAME]"
            )
        check_quantity("thickness", thickness, f"of {medium.name!r}")
        if phase is not None:
            phase = legal_phase(f"layer of {medium.name!r}", phase, medium.wavelengths.size)
        vars(self).update(medium=medium, thickness=as_float_array(thickness), _phase=phase)

    @property
    def phase(self) -> Float[Array, "*bands terms"] | None:
        """Legendre moments of the phase function, (..., bands or nothing, terms), or None for
        isotropic scattering.
        """
        return self.medium.phase if self._phase is None else self._phase

    def __repr__(self) -> str:
        return f"Layer({self.medium.name!r}, {_short(self.thickness, 1e6, ' um')})"


class Glaze(_PlainModule):
    """Coats of paint on a ground, under one smooth surface.

    ::

            air
        ~~~~~~~~~~~~  smooth surface, refractive index n below it
         coats[0]
         coats[1]
        ============  Lambertian ground

    Args:
        coats: top first, all on the same wavelengths; empty for bare ground.
        ground: its reflectance inside the medium, scalar or (..., bands), in [0, 1].
        refractive_index: of all coats, scalar or (..., bands), in [1, 2.5]. A Python number stays
            one and is a constant under equinox's filtered transformations: the solver's fast path.

    Raises:
        ValueError: coats on different grids, shapes that do not match, or values out of range.
    """

    coats: tuple[Layer, ...]
    ground: Float[Array, "*batch"]
    refractive_index: float | Float[Array, "*batch"]

    def __init__(self, coats: Sequence[Layer], ground: Numbers, refractive_index: Numbers = 1.5):
        if isinstance(coats, Layer):
            raise ValueError("coats must be a list, top first: write [layer] for a single one")
        coats = tuple(coats)
        for coat in coats:
            if not isinstance(coat, Layer):
                raise ValueError(
                    f"coats must each be a Layer, not {_describe_value(coat)}: "
                    "write Layer(paint, thickness in m)"
                )
        _check_grids([coat.medium for coat in coats])
        check_quantity("ground", ground)
        _check_range("refractive_index", refractive_index, 1.0, 2.5)
        below = as_array(ground)
        index = as_array(refractive_index)
        if coats:
            bands = len(coats[0].medium._grid)
            for name, value in (("ground", below), ("refractive_index", index)):
                if value.shape[-1:] not in ((), (1,), (bands,)):
                    raise ValueError(
                        f"{name} has shape {value.shape}: its last axis must be the {bands} "
                        "bands of the coats"
                    )
        _check_batches(coats, below.shape[:-1])
        # A number stays one, a constant of the compiled program.
        constant = index.ndim == 0 and isinstance(index, np.ndarray)
        index = float(index) if constant else as_float_array(index)
        vars(self).update(coats=coats, ground=as_float_array(ground), refractive_index=index)

    @property
    def wavelengths(self) -> Bands:
        """Wavelengths of the coats in nm, (bands,).

        Raises:
            ValueError: there are no coats.
        """
        if not self.coats:
            raise ValueError(
                "a glaze without coats has no wavelengths of its own: use those of its ground"
            )
        return self.coats[0].medium.wavelengths

    @property
    def albedo(self) -> Float[Array, "*batch bands layers"]:
        """Single-scattering albedo s / (k + s), (..., bands, layers), top layer first.

        Where k + s = 0 it is 0, with zero gradient: there a layer's derivative with respect to s is
        that with respect to k, since the albedo of nothing has no limit.
        """
        return jnp.asarray(stack_of(self)[0])

    @property
    def optical_thickness(self) -> Float[Array, "*batch bands layers"]:
        """Optical thickness (k + s) d, (..., bands, layers), top layer first."""
        return jnp.asarray(stack_of(self)[1])

    @property
    def phase(self) -> Float[Known, "*batch bands layers terms"] | None:
        """Legendre moments of the coats' phase functions, (..., bands or 1, layers, terms); None:
        all isotropic.
        """
        return stack_moments([coat.phase for coat in self.coats])

    def __repr__(self) -> str:
        ground, index = (_short(value) for value in (self.ground, self.refractive_index))
        return f"Glaze([{', '.join(map(repr, self.coats))}], ground {ground}, n = {index})"


def amounts(tree: Any) -> Any:
    """A filter of what is fitted by an optimiser: True for thicknesses of coats and fractions of
    mixtures, False for all other leaves, such as k and s and their errors.

    Args:
        tree: a `Glaze`, or anything that holds some; `equinox.partition` takes both.
    """

    fitted = ("thickness", "weights")
    return jax.tree_util.tree_map_with_path(
        lambda path, _: any(getattr(key, "name", "") in fitted for key in path), tree
    )


# ---- what the solver takes -------------------------------------------------------------------
#
# NumPy arrays where all is known and small: the way to JAX and back costs more than the sums do.
# Functions and no methods, since equinox binds each method as a module of its own, which costs more
# still.


def stack_of(glaze: Glaze) -> tuple[Float[Known, "..."], Float[Known, "..."], Numbers]:
    """Albedo and optical thickness of all coats, each (..., bands, layers), top layer first, and
    the ground.
    """
    if "_stack" in vars(glaze):
        return vars(glaze)["_stack"]
    if not glaze.coats:
        shape = np.broadcast_shapes(np.shape(glaze.ground), np.shape(glaze.refractive_index), (1,))
        nothing = jnp.zeros((*shape, 0))
        return nothing, nothing, glaze.ground
    coefficients = [
        _coefficient(coat.medium, what)
        for what in ("absorption", "scattering")
        for coat in glaze.coats
    ]
    # Each for all coats at once; albedo apart, for it is known where only thickness is traced.
    albedo, extinction = numpy_or_jax(_albedo_and_extinction, *coefficients)
    depth = numpy_or_jax(_depth, extinction, *(coat.thickness for coat in glaze.coats))
    ground = numpy_or_jax(lambda _, values: values, glaze.ground)
    # What NumPy computed is computed once: no glaze ever changes.
    if isinstance(depth, np.ndarray) and isinstance(ground, np.ndarray):
        ground = ground if ground.ndim else float(ground)
        vars(glaze)["_stack"] = albedo, depth, ground
    return albedo, depth, ground


def _coefficient(medium: Pigment | Mixture, what: str) -> Float[Known, "*batch bands"]:
    """Absorption or scattering in 1/m, (..., bands): of a mixture the weighted sum."""
    if isinstance(medium, Pigment):
        return getattr(medium, what)

    def total(_: Any, weights: Any, *spectra: Any) -> Any:
        return functools.reduce(
            operator.add, [weights[..., i, None] * spectrum for i, spectrum in enumerate(spectra)]
        )

    return numpy_or_jax(total, medium.weights, *(getattr(p, what) for p in medium.pigments))


def _albedo_and_extinction(xp: Any, *coefficients: Any) -> tuple[Any, Any]:
    """s / (k + s) and k + s of coats side by side, from the k of all, then their s."""
    count = len(coefficients) // 2
    s = _side_by_side(xp, *coefficients[count:])
    extinction = _side_by_side(xp, *coefficients[:count]) + s
    # Below this extinction (1/m) a centimetre of paint is clear to 1e-14, and squares still fit in
    # float32.
    clear = extinction <= 1e-12
    return xp.where(clear, 0.0, s) / xp.where(clear, 1.0, extinction), extinction


def _depth(xp: Any, extinction: Any, *thickness: Any) -> Any:
    """(k + s) d of coats side by side, from k + s of all, (..., layers), and each d."""
    return extinction * _side_by_side(xp, *thickness)[..., None, :]


def _side_by_side(xp: Any, *arrays: Any) -> Any:
    """Arrays of coats on a last axis."""
    if len({array.shape for array in arrays}) > 1:
        arrays = xp.broadcast_arrays(*arrays)
    return xp.stack(arrays, axis=-1)


def _check_batches(coats: Sequence[Layer], ground: tuple[int, ...]) -> None:
    """Refuse coats, or a ground, that are batches of different sizes."""
    shapes = [getattr(coat.thickness, "shape", ()) for coat in coats]
    if not any((*shapes, ground)):
        return
    try:
        np.broadcast_shapes(*shapes, ground)
    except ValueError:
        listed = ", ".join(map(str, shapes))
        raise ValueError(
            f"thicknesses of shapes {listed} over grounds of shape {ground} are no one batch: give "
            "as many of each, or one; thickness[:, None] pairs each with each"
        ) from None


def check_glaze(glaze: Any) -> None:
    """Refuse what is no glaze.

    Raises:
        TypeError: says what was given, and how a glaze is written.
    """
    if not isinstance(glaze, Glaze):
        raise TypeError(
            f"glaze must be a Glaze, not {_describe_value(glaze)}: "
            "write Glaze([Layer(paint, thickness in m)], ground)"
        )


def _short(value: Any, scale: float = 1.0, unit: str = "") -> str:
    """A number as it was typed, without the digits of single precision; of an array its shape, and
    whatever else stands in its place as it is.
    """
    number = isinstance(value, float | int | np.ndarray | jax.Array)
    if not number or isinstance(value, bool | Tracer):
        return f"{getattr(value, 'shape', value)}"
    return f"{np.shape(value)}" if np.ndim(value) else f"{float(value) * scale:g}{unit}"


def _check_grids(media: Sequence[Pigment | Mixture]) -> None:
    """Refuse media that do not share their wavelengths."""
    for medium in media[1:]:
        first = media[0]
        if medium._grid != first._grid and not same_grid(first.wavelengths, medium.wavelengths):
            raise ValueError(
                f"wavelengths differ: {first.name!r} has {describe_grid(first.wavelengths)}, "
                f"{medium.name!r} has {describe_grid(medium.wavelengths)}; bring them to one grid "
                "with .resample(wavelengths)"
            )


Shelf: TypeAlias = Mapping[str, Pigment]
"""Paints by name."""


def make_media(
    coats: Sequence[Coat], shelf: Shelf, grid: Bands | None = None
) -> list[Pigment | Mixture]:
    """Media of the coats, on the wavelengths of their pigments or, if given, of a grid (nm).

    Raises:
        KeyError: a pigment that the shelf does not have under that very name.
        ValueError: pigments of one mixture on different wavelengths, or a grid that one does not
            cover.
    """
    media: list[Pigment | Mixture] = []
    for coat in coats:
        paints = [shelf[name] for _, name in coat.parts]
        if grid is not None:
            paints = [paint.resample(grid) for paint in paints]
        weights = [weight for weight, _ in coat.parts]
        media.append(paints[0] if len(paints) == 1 else Mixture(paints, weights, coat.name))
    return media
