"""What many stacks of coats read, and their colour: paints, ground, instrument and light as arrays.

A stack is an array (coats, paints), top first: what each paint takes of each coat's thickness.
Lengths are in micrometres here, k and s in 1/micrometre. While a stack is refined it is a few
slots, each a paint in a coat with the logarithm of a free amount; the thickness of a coat, the sum
of its amounts, is held between bounds by a sigmoid.
"""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from glazejax import Pigment, colour
from glazejax.geometry import Instrument
from glazejax.programs import Program
from glazejax.spectra import as_array, on_numpy_or_jax

from ..film.model.optics import Optics
from ..film.model.response import FilmResponse, film_response
from ..film.numerics.blocks import by_blocks

TOLERANCE = 1e-6
"""Of the solver: an error of 1e-5 in the reading of a black would be a Delta E of a hundredth."""

READ_CHUNK = 128
"""Stacks that are solved at a time."""
_TABLE_CHUNK = 512


class StackModel(NamedTuple):
    """Paints, ground, instrument and light: all that does not change while a recipe is sought."""

    absorption: Float[Array, "paints bands"]  # 1/um
    scattering: Float[Array, "paints bands"]  # 1/um
    ground: Float[Array, "bands"]
    surface: Float[Array, ""]  # what the outer surface adds to a reading
    weights: Float[Array, "bands lights 3"]  # reflectance to XYZ
    white: Float[Array, "lights 3"]
    span: Float[Array, "2"]  # logarithms of the thinnest and thickest coat, um
    film: FilmResponse


class StackSolver(NamedTuple):
    """The solver as recipes ask it.

    Attributes:
        optics: the instrument.
        slots: at least as many as a stack has paints, counted in each coat.
    """

    optics: Optics
    slots: int


class Slots(NamedTuple):
    """Which paint lies in which coat, 0 on top; unused slots fill the array up."""

    paint: Int[Array | np.ndarray, "*batch slots"]
    coat: Int[Array | np.ndarray, "*batch slots"]
    used: Bool[Array | np.ndarray, "*batch slots"]


def make_model(
    pigments: Sequence[Pigment],
    ground: float | Float[np.ndarray, "bands"],
    instrument: Instrument,
    illuminants: Sequence[str],
    observer: str,
    thickness: tuple[float, float],
) -> StackModel:
    """Model of stacks of some paints; thickness in m, k and s in 1/m as everywhere else.

    Args:
        pigments: on one grid.
        ground: internal reflectance, scalar or (bands,).
        instrument: with the index of all coats.
        illuminants, observer: full names.
        thickness: of the thinnest and the thickest coat, m.
    """
    grid = pigments[0].wavelengths
    weights = np.stack(
        [colour.colour_weights(grid, name, observer) for name in illuminants], axis=1
    )
    return StackModel(
        absorption=jnp.asarray(np.stack([np.asarray(p.absorption) for p in pigments]) * 1e-6),
        scattering=jnp.asarray(np.stack([np.asarray(p.scattering) for p in pigments]) * 1e-6),
        ground=jnp.asarray(np.broadcast_to(np.asarray(ground, float), grid.shape)),
        surface=jnp.asarray(instrument.seen_surface),
        weights=jnp.asarray(weights),
        white=jnp.asarray(weights.sum(axis=0)),
        span=jnp.asarray(np.log(np.asarray(thickness) * 1e6)),
        film=film_response(instrument),
    )


def lab_of(
    model: StackModel, spectra: Float[Array | np.ndarray, "*batch bands"]
) -> Float[Array, "*batch lights 3"]:
    """L*a*b* of readings under every light of the model."""
    return colour.xyz_to_lab(
        on_numpy_or_jax(_xyz_of, as_array(spectra), model.weights), model.white
    )


def _xyz_of(xp: Any, spectra: Any, weights: Any) -> Any:
    # One dot product a light and component; full precision also on an accelerator.
    more = {} if xp is np else {"precision": "highest"}
    return xp.tensordot(spectra, weights, axes=1, **more)


def coat_thickness(model: StackModel, total: Float[Array, "*coats"]) -> Float[Array, "*coats"]:
    """Thickness of coats, um, within the bounds, from free totals, > 0; they agree in the middle of
    the range.
    """
    low, high = model.span
    room = jnp.maximum(high - low, 1e-9)
    return jnp.exp(low + room * jax.nn.sigmoid(4.0 / room * (jnp.log(total) - 0.5 * (low + high))))


def free_total(
    model: StackModel, thickness: Float[np.ndarray, "*coats"]
) -> Float[np.ndarray, "*coats"]:
    """The inverse of `coat_thickness`, with bounds moved inwards a little, where the sigmoid has a
    slope.
    """
    low, high = np.asarray(model.span)
    room = max(high - low, 1e-9)
    share = np.clip((np.log(thickness) - low) / room, 0.02, 0.98)
    return np.exp(0.5 * (low + high) + room / 4.0 * (np.log(share) - np.log1p(-share)))


def amounts(
    model: StackModel, slots: Slots, logs: Float[Array, "slots"], coats: int
) -> Float[Array, "coats slots"]:
    """What each paint takes of its coat's thickness, um, from logarithms of free amounts; for one
    candidate.
    """
    member = slots.used & (slots.coat == jnp.arange(coats)[:, None])
    free = jnp.where(member, jnp.exp(logs), 0.0)
    total = jnp.where(member.any(axis=1), free.sum(axis=1), 1.0)
    return free * (coat_thickness(model, total) / total)[:, None]


def fill_slots(
    model: StackModel, sizes: Float[np.ndarray, "n coats paints"], count: int
) -> tuple[Slots, Float[np.ndarray, "n count"]]:
    """Slots and logarithms of free amounts of stacks.

    Args:
        model: its bounds hold.
        sizes: what each paint takes of each coat's thickness, um, 0 where it is not there.
        count: number of slots, at least the number of amounts above 0.
    """
    flat = sizes.reshape(len(sizes), -1)
    most = int((flat > 0).sum(axis=1).max(initial=0))
    if most > count:
        raise ValueError(f"a stack of {most} amounts does not go into {count} slots")
    # Amounts above 0 first, in the order of coats and paints.
    order = np.argsort(flat <= 0, axis=1, kind="stable")[:, :count]
    order = np.pad(order, ((0, 0), (0, max(0, count - order.shape[1]))))
    used = np.arange(count) < (flat > 0).sum(axis=1)[:, None]
    coat, paint = np.divmod(np.where(used, order, 0), sizes.shape[2])
    total = sizes.sum(axis=2)
    scale = free_total(model, np.maximum(total, 1e-9)) / np.maximum(total, 1e-9)
    free = np.take_along_axis(
        (sizes * scale[:, :, None]).reshape(len(sizes), -1), np.where(used, order, 0), axis=1
    )
    return Slots(paint, coat, used), np.where(used, np.log(np.where(used, free, 1.0)), 0.0)


def empty_slots(
    slots: Slots, amounts: Float[np.ndarray, "n coats slots"], paints: int
) -> Float[np.ndarray, "n coats paints"]:
    """The inverse of `fill_slots`, from amounts in um."""
    return np.einsum(
        "ncs,nsp->ncp",
        amounts,
        np.eye(paints)[np.asarray(slots.paint)] * np.asarray(slots.used)[:, :, None],
    )


def quick_reading(
    model: StackModel,
    kd: Float[Array, "*batch coats bands"],
    sd: Float[Array, "*batch coats bands"],
) -> Float[Array, "*batch bands"]:
    """What the instrument reads, by the table: exact for one coat.

    A lower coat counts as the Lambertian ground that would read the same when bare, so that two
    coats are right to about one Delta E. It serves to choose what to look at more closely.
    """
    ground = model.ground
    body = ground
    for coat in reversed(range(kd.shape[-2])):
        body = model.film.body(kd[..., coat, :], sd[..., coat, :], ground)
        if coat:
            ground = internal(model, body)
    return body + model.surface


def internal(model: StackModel, body: Float[Array, "*batch bands"]) -> Float[Array, "*batch bands"]:
    """The coat below as a ground: the Lambertian one that, bare, reads `body` without the outer
    surface's part.
    """
    return jnp.clip(model.film.internal(body), 0.0, 1.0)


def true_reading(
    model: StackModel,
    kd: Float[Array, "*batch coats bands"],
    sd: Float[Array, "*batch coats bands"],
    optics: Optics,
) -> Float[Array, "*batch bands"]:
    """What the instrument reads, by the solver."""
    body = optics.body(jnp.swapaxes(kd, -1, -2), jnp.swapaxes(sd, -1, -2), model.ground, TOLERANCE)
    return body + model.surface


def readings(
    model: StackModel, sizes: Float[np.ndarray, "n coats paints"], solver: StackSolver | None
) -> Float[np.ndarray, "n bands"]:
    """What the instrument reads on each of many stacks: by the solver, or without one by the
    table.
    """
    if len(sizes) == 0:
        return np.zeros((0, model.ground.size))
    if solver is None:
        return by_blocks(len(sizes), _TABLE_CHUNK, lambda rows: _quick_readings(model, sizes[rows]))
    # The program of the last steps serves here too: its slopes take a sixth of its time.
    slots, _ = fill_slots(model, sizes, solver.slots)
    amount = sizes[np.arange(len(sizes))[:, None], slots.coat, slots.paint]
    return solve(model, solver, slots, np.where(slots.used, amount, 0.0), sizes.shape[1])[0]


def solve(
    model: StackModel,
    solver: StackSolver,
    slots: Slots,
    amount: Float[np.ndarray, "n slots"],
    coats: int,
) -> tuple[
    Float[np.ndarray, "n bands"],
    Float[np.ndarray, "n slots bands"],
    Float[np.ndarray, "n lights 3"],
    Float[np.ndarray, "n lights 3 bands"],
]:
    """Readings by the solver and their slopes by the amounts in um; L*a*b* and their slopes by the
    readings.
    """

    def run(rows: Int[np.ndarray, "block"]) -> Any:
        some = Slots(*(np.asarray(values)[rows] for values in slots))
        return _solve(model, some, amount[rows], solver.optics, coats=coats)

    return by_blocks(len(amount), READ_CHUNK, run)


def readings_ahead(model: StackModel, solver: StackSolver, coats: int) -> None:
    """Begin to compile what reads stacks of so many coats, by the solver and by the table."""
    none = np.zeros((READ_CHUNK, solver.slots), int)
    slots = Slots(none, none, none > 0)
    _solve.ahead(model, slots, np.zeros(none.shape), solver.optics, coats=coats)
    _quick_readings.ahead(model, np.ones((_TABLE_CHUNK, coats, len(model.absorption))))


@Program
def _quick_readings(
    model: StackModel, sizes: Float[Array | np.ndarray, "n coats paints"]
) -> Float[Array, "n bands"]:
    kd, sd = (jnp.asarray(sizes) @ each for each in (model.absorption, model.scattering))
    return quick_reading(model, kd, sd)


@functools.partial(Program, fixed=("optics", "coats"))
def _solve(
    model: StackModel,
    slots: Slots,
    amount: Float[Array | np.ndarray, "n slots"],
    optics: Optics,
    *,
    coats: int,
) -> tuple[
    Float[Array, "n bands"],
    Float[Array, "n slots bands"],
    Float[Array, "n lights 3"],
    Float[Array, "n lights 3 bands"],
]:
    """Readings by the solver and their slopes by the amounts in um; L*a*b* and their slopes by the
    readings.
    """
    # (n, slots, bands)
    absorption = model.absorption[slots.paint]
    scattering = model.scattering[slots.paint]
    member = slots.used[:, None] & (slots.coat[:, None] == jnp.arange(coats)[:, None])
    share = jnp.where(member, amount[:, None], 0.0)
    reading, back = jax.vjp(
        lambda kd, sd: true_reading(model, kd, sd, optics), share @ absorption, share @ scattering
    )
    # A band's reading follows from that band alone, so that one pull-back of ones holds every
    # slope.
    by_kd, by_sd = (
        jnp.take_along_axis(v, slots.coat[..., None], axis=1) for v in back(jnp.ones_like(reading))
    )
    by_amount = jnp.where(slots.used[..., None], by_kd * absorption + by_sd * scattering, 0.0)
    by_reading = jax.vmap(jax.jacfwd(lambda spectrum: lab_of(model, spectrum)))(reading)
    return reading, by_amount, lab_of(model, reading), by_reading
