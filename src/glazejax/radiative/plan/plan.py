"""Omission of what a set of stacks does not need: decided once, on known numbers, before anything
compiled runs.

A plan knows arrays only. It drops empty layers, merges equal neighbours, cuts what lies below an
opaque layer, finds equal stacks and pairs of exchanged directions, takes the closed form where
scattering is negligible, leaves out bands that cannot move the weighted sums asked for, and sends
what remains to the solver in groups of equal depth and blocks of few shapes. Each of these can be
switched off; none changes a result by more than its share of the tolerance.
"""

import functools
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int

from ..common.inputs import (
    BatchOfStacks,
    Numbers,
    batch_of_stacks,
    check_given,
    check_mask,
    check_tolerance,
)
from ..stack import stack_hemispherical_reflectance, stack_reflectance_factor
from . import reduction
from .bounds import count_filled
from .reduction import Rows

# Stacks go to the solver in blocks of these sizes and, if grouped, these numbers of layers: few
# programs to compile.
_BLOCKS = (4096, 512, 64)
_DEPTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
# A block at least this full is padded rather than cut into smaller ones; a call costs what some
# hundred stacks do.
_FILLED = (0.85, 0.5, 0.0)
# Optical thicknesses of the white medium that bounds every reflectance; between them it changes by
# less than a margin.
_WHITE = np.concatenate([[0.0], np.geomspace(1e-3, 1e4, 63)])


class Savings(NamedTuple):
    """One switch for each thing that may be left out."""

    layers: bool = True
    """Layers without thickness are dropped, neighbours of equal albedo merged."""
    hidden: bool = True
    """Layers and ground below what is opaque are not followed."""
    scattering: bool = True
    """Closed form where scattering in the layers, or all of it but the first, is negligible."""
    equal: bool = True
    """Equal stacks are computed once."""
    reciprocity: bool = True
    """Incidence and viewing exchanged count as equal; of use together with `equal`."""
    bands: bool = True
    """Bands that cannot move the weighted sums asked for are interpolated between the others."""
    unwanted: bool = True
    """Entries not asked for are not computed; off, they are computed and then discarded."""
    groups: bool = True
    """Stacks of few layers are not padded to the number of layers of the deepest."""


ALL = Savings()
"""Everything that may be left out is."""


class Report(NamedTuple):
    """Numbers of stacks and layers that a plan leaves out, and why."""

    stacks: int
    """Entries of the full result."""
    unwanted: int
    """Entries not asked for."""
    bands: int
    """Entries left out with their band."""
    equal: int
    """Entries that equal another one, once simplified."""
    closed: int
    """Distinct stacks by closed form."""
    solved: int
    """Distinct stacks that go to the solver."""
    layers: int
    """Layers, empty ones too, of all distinct stacks as given."""
    hidden_layers: int
    """Layers hidden below others."""
    hidden_grounds: int
    """Grounds that no light reaches and leaves again."""
    solved_layers: int
    """Layers that go to the solver, padding included."""
    groups: tuple[tuple[int, int], ...]
    """(number of layers, number of stacks) of each group."""


@dataclass(frozen=True)
class Plan:
    """Stacks that have to be computed, and how the full result follows from them. Made by
    `plan_stacks`.
    """

    _rows: Rows
    _groups: list[tuple[int, Int[np.ndarray, "_"]]]
    _closed: Int[np.ndarray, "closed"]
    _inverse: Int[np.ndarray, "computed"]  # for each computed entry, its row
    _computed: Int[np.ndarray, "computed"]  # the entries, of the flattened batch
    _wanted: Bool[np.ndarray, "entries"]
    _kept_bands: Bool[np.ndarray, "bands"] | None
    _shape: tuple[int, ...]
    _tolerance: float
    _report: Report

    def __repr__(self) -> str:
        return f"Plan({self.describe()})"

    def run(self) -> Float[Array, "*batch"]:
        """Compute what has to be and put every result in its place.

        Returns:
            Reflectances, the broadcast batch shape of the inputs; NaN where not wanted.
        """
        distinct = np.empty(self._rows.stacks)
        pending = []
        for layers, members in self._groups:
            for block, size in _blocks(members):
                # The last block is filled up with copies of its stacks.
                padded = np.resize(block, size)
                pending.append((block, self._solve(self._rows.take(padded), layers)))
        # The solver's programs may still run: the closed form needs none.
        closed = reduction.by_closed_form(self._rows.take(self._closed))
        distinct[self._closed] = closed.reflectance
        for members, values in pending:
            distinct[members] = np.asarray(values)[: members.size]
        # Each entry has the value of its distinct stack.
        full = np.full(int(np.prod(self._shape)), np.nan)
        full[self._computed] = distinct[self._inverse]
        full[~self._wanted] = np.nan
        full = full.reshape(self._shape)
        if self._kept_bands is not None:
            full = _fill_bands(full, self._kept_bands)
        return jnp.asarray(full, jnp.result_type(float))

    def _solve(self, rows: Rows, layers: int) -> Array:
        first = rows.refractive_index[0]
        index = (
            float(first) if np.all(self._rows.refractive_index == first) else rows.refractive_index
        )
        arrays = (rows.albedo[:, :layers], rows.optical_thickness[:, :layers], rows.ground)
        common = {
            "refractive_index": index,
            "cos_incidence": rows.cos_incidence,
            "tolerance": self._tolerance,
        }
        if rows.cos_viewing is None:
            return stack_hemispherical_reflectance(*arrays, **common)
        return stack_reflectance_factor(*arrays, **common, cos_viewing=rows.cos_viewing)

    def report(self) -> Report:
        """Numbers of what is left out."""
        return self._report

    def describe(self) -> str:
        """Describe what is left out."""
        r = self._report
        groups = ", ".join(
            f"{stacks} of {layers} layer{'s' * (layers > 1)}" for layers, stacks in r.groups
        )
        lines = [
            (r.unwanted, f"{r.unwanted} were not asked for"),
            (r.bands, f"{r.bands} belong to bands that cannot move the weighted sums"),
            (r.equal, f"{r.equal} equal another one"),
            (r.hidden_layers, f"{r.hidden_layers} layers are hidden below others"),
            (r.hidden_grounds, f"{r.hidden_grounds} grounds are hidden"),
            (
                r.closed,
                f"{r.closed} follow from a closed form, their multiple scattering being negligible",
            ),
            (True, f"{r.solved} are solved" + (f": {groups}" if groups else "")),
        ]
        return "; ".join([f"{r.stacks} stacks", *(line for count, line in lines if count)])


def plan_stacks(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers | None = 1.0,
    tolerance: float = 1e-6,
    savings: Savings = ALL,
    band_weights: Numbers | None = None,
    wanted: Numbers | None = None,
) -> Plan:
    """Decide what of a batch of stacks has to be computed.

    Args:
        albedo, optical_thickness: of each layer, top first, (..., layers); as
            `stack_reflectance_factor`.
        substrate_reflectance: of the Lambertian ground, from inside the medium, (...).
        refractive_index: of all layers, (...); one value for all stacks is the fast path, as a
            number or not.
        cos_incidence, cos_viewing: cosines in air, (...); cos_viewing None asks for the
            hemispherical reflectance.
        tolerance: absolute error wanted of the solver. All savings together change a result by no
            more than that.
        savings: which savings to make.
        band_weights: if only the sums over the last batch axis times these weights matter, such as
            illuminant times colour matching functions, (bands, channels). No channel then moves, by
            bands left out, by more than half the tolerance times the sum of its weights'
            magnitudes.
        wanted: which entries are asked for, (...); the others are NaN in the result. All by
            default.

    Returns:
        `Plan`; its ``run()`` gives the reflectances in the broadcast shape of the batch.

    Raises:
        ValueError: an input is traced by JAX, out of range, or does not broadcast, or
            `band_weights` do not match.

    Notes:
        The bounds are those of `bounds`. A band is weighed by the highest reflectance there is in
        this geometry: of a medium that absorbs nothing on a white ground, whatever its thickness.
    """
    check_tolerance(tolerance)
    arguments = {
        "albedo": albedo,
        "optical_thickness": optical_thickness,
        "substrate_reflectance": substrate_reflectance,
        "refractive_index": refractive_index,
        "cos_incidence": cos_incidence,
        "cos_viewing": cos_viewing,
    }
    # No viewing direction: all of them together.
    check_given({name: value for name, value in arguments.items() if name != "cos_viewing"})
    known = {name: _check_known(name, v) for name, v in arguments.items() if v is not None}
    checked = batch_of_stacks(known, xp=np, dtype=float)
    shape = checked.batch
    size = int(np.prod(shape))
    ask = True if wanted is None else _check_known("wanted", wanted, bool)
    ask = np.broadcast_to(ask, shape).reshape(-1)
    # Entries that nobody asked for, and those of bands that cannot move the sums.
    compute = ask if savings.unwanted else np.ones(size, bool)
    due = int(compute.sum())
    bands = None
    if band_weights is not None:
        weights = _check_known("band_weights", band_weights)
        if weights.ndim != 2 or weights.shape[:1] != shape[-1:]:
            raise ValueError(
                f"band_weights {weights.shape} do not fit bands as the last axis of the batch "
                f"{shape}"
            )
        by_stack = ask.reshape(shape)
        # Where a band is wanted of one stack and not of another, its neighbours may not be there to
        # fill it in.
        if savings.bands and size and np.array_equal(by_stack.all(axis=-1), by_stack.any(axis=-1)):
            # Bands have half of the tolerance; what hides and multiple scattering a quarter each.
            bands = _needed_bands(weights, tolerance * 0.5, checked.arrays)
            compute = compute & np.broadcast_to(bands, shape).reshape(-1)
    computed = np.flatnonzero(compute)
    rows = _flat(checked, computed)
    # The smaller cosine first, so that exchanged directions are equal stacks.
    if savings.reciprocity and rows.cos_viewing is not None:
        low = np.minimum(rows.cos_incidence, rows.cos_viewing)
        high = np.maximum(rows.cos_incidence, rows.cos_viewing)
        rows = rows._replace(cos_incidence=low, cos_viewing=high)
    rows, inverse = reduction.once(rows) if savings.equal else (rows, np.arange(rows.stacks))
    given_layers = rows.albedo.size
    # Simpler stacks: no empty layers, no neighbours of equal albedo, nothing below what is opaque.
    if savings.layers:
        rows = reduction.simplify(rows)
    before = count_filled(rows.optical_thickness)
    hidden = np.zeros(rows.stacks, bool)
    if savings.hidden:
        rows, hidden = reduction.cut_below_opaque(rows, tolerance * 0.25)
    hidden_layers = int((before - count_filled(rows.optical_thickness)).sum())
    # Stacks that differed in what has gone are equal now.
    if savings.equal and (savings.layers or savings.hidden):
        rows, again = reduction.once(rows)
        inverse = again[inverse]
    # What needs no solver; the rest goes to it in groups of as many layers.
    closed = np.zeros(rows.stacks, bool)
    if savings.scattering:
        closed = reduction.closes(rows, tolerance * 0.25)
    groups = _group(
        count_filled(rows.optical_thickness), np.flatnonzero(~closed), grouped=savings.groups
    )
    report = Report(
        stacks=size,
        unwanted=size - due,
        bands=due - computed.size,
        equal=computed.size - rows.stacks,
        closed=int(closed.sum()),
        solved=int((~closed).sum()),
        layers=given_layers,
        hidden_layers=hidden_layers,
        hidden_grounds=int(hidden.sum()),
        solved_layers=sum(depth * members.size for depth, members in groups),
        groups=tuple((depth, members.size) for depth, members in groups),
    )
    return Plan(
        _rows=rows,
        _groups=groups,
        _closed=np.flatnonzero(closed),
        _inverse=inverse,
        _computed=computed,
        _wanted=ask,
        _kept_bands=bands,
        _shape=shape,
        _tolerance=tolerance,
        _report=report,
    )


def _check_known(name: str, value: Any, dtype: type = float) -> np.ndarray:
    if isinstance(value, Tracer):
        raise ValueError(
            f"{name} is traced by JAX, but a plan looks at numbers: make it outside jit, vmap and "
            "grad, or call stack_reflectance_factor, which needs no plan"
        )
    check_mask(name, value)
    return np.asarray(value, dtype)


def _flat(checked: BatchOfStacks, computed: np.ndarray) -> Rows:
    """The entries to compute, one row each."""
    flat = {name: array[computed] for name, array in checked.flat().items()}
    # The albedo of an absent layer says nothing; zeros make such stacks equal.
    albedo = np.where(flat["optical_thickness"] > 0, flat.pop("albedo"), 0.0)
    thickness, ground, index, incidence, *viewing = flat.values()
    return Rows(
        albedo=albedo,
        optical_thickness=thickness,
        ground=ground,
        refractive_index=index,
        cos_incidence=incidence,
        cos_viewing=viewing[0] if viewing else None,
    )


@functools.lru_cache(maxsize=256)
def _ceiling(index: float, cos_incidence: float, cos_viewing: float | None) -> float:
    """Highest reflectance of any stack: that of a medium that absorbs nothing on a white ground.

    Reflectance grows with every albedo and with the ground's, and layers of albedo one are one
    layer.
    """
    if cos_viewing is None:
        return 1.0
    values = stack_reflectance_factor(
        np.ones((64, 1)),
        _WHITE[:, None],
        1.0,
        refractive_index=index,
        cos_incidence=cos_incidence,
        cos_viewing=cos_viewing,
        tolerance=1e-3,
    )
    # Between the optical thicknesses that are tried it changes by less than this margin.
    return 1.05 * float(np.max(values))


def _needed_bands(
    weights: np.ndarray, tolerance: float, arrays: dict[str, np.ndarray]
) -> Bool[np.ndarray, "bands"]:
    """Bands without which a channel could be off by more than the tolerance, relative to its
    perfect white.
    """
    directions = (
        arrays["refractive_index"],
        arrays["cos_incidence"],
        arrays.get("cos_viewing", 1.0),
    )
    rows = np.stack([np.ravel(a) for a in np.broadcast_arrays(*directions)], axis=1)
    geometries = np.unique(rows, axis=0)
    keep = np.ones(weights.shape[0], bool)
    # Each geometry is solved: with many that costs more than it saves.
    if len(geometries) > 32:
        return keep
    ceiling = max(
        _ceiling(n, i, v if "cos_viewing" in arrays else None) for n, i, v in geometries.tolist()
    )
    magnitude = np.abs(weights)
    total = magnitude.sum(axis=0)
    share = magnitude / np.where(total > 0, total, 1.0)
    # Bands with the smallest share in any channel go first.
    order = np.argsort(share.max(axis=1), kind="stable")
    # Any value between zero and the ceiling has an error of at most the ceiling.
    fits = np.max(ceiling * np.cumsum(share[order], axis=0), axis=1) <= tolerance
    left_out = min(int(np.count_nonzero(fits)), fits.size - 1)  # the sums only grow; one band stays
    keep[order[:left_out]] = False
    return keep


def _fill_bands(values: np.ndarray, computed: np.ndarray) -> np.ndarray:
    """Bands left out, from the two nearest that were not, by their number."""
    numbers = np.flatnonzero(computed)
    # The next band that was computed, and the one before.
    upper = np.clip(np.searchsorted(numbers, np.arange(computed.size)), 0, numbers.size - 1)
    lower = np.where(computed, upper, np.clip(upper - 1, 0, None))
    a = numbers[lower]
    b = numbers[upper]
    share = np.clip((np.arange(computed.size) - a) / np.maximum(b - a, 1), 0.0, 1.0)
    out = values[..., a] * (1.0 - share) + values[..., b] * share
    # What was computed stays to the last digit.
    out[..., computed] = values[..., computed]
    return out


def _group(
    depth: np.ndarray, members: np.ndarray, *, grouped: bool
) -> list[tuple[int, np.ndarray]]:
    """Stacks to solve by padded number of layers, thin ones first."""
    deepest = int(depth[members].max(initial=1))
    steps = [step for step in _DEPTHS if grouped and step < deepest] + [deepest]
    padded = np.searchsorted(steps, np.maximum(depth[members], 1))
    groups = []
    waiting = np.zeros(0, int)
    for k, step in enumerate(steps):
        waiting = np.concatenate([waiting, members[padded == k]])
        # A group smaller than this joins the next deeper one.
        if waiting.size >= 256 or (k == len(steps) - 1 and waiting.size):
            groups.append((step, waiting))
            waiting = waiting[:0]
    return groups


def _blocks(members: np.ndarray) -> list[tuple[np.ndarray, int]]:
    """Stacks in pieces, each with its padded size: a size is padded where it is mostly filled."""
    pieces = []
    start = 0
    for size, filled in zip(_BLOCKS, _FILLED, strict=True):
        while start < members.size and members.size - start >= filled * size:
            pieces.append((members[start : start + size], size))
            start += size
    return pieces
