"""The auxiliary function method on a uniform grid of optical depth, as paper A has it and better.

The diffuse field enters by its auxiliary function f(tau) = int (omega+ + omega-) dmu/mu (eq. (3)),
for which light scattered, reflected inside by the surface and by the ground is a linear integral
equation in depth alone (21). Cut into Q segments it is (1/2 A P - E) f = -b (31), with A = H + U +
c M M': H symmetric Toeplitz, U Hankel (4.1).

Variants of the assembly:

- ``direct``: every entry of A by its own quadrature, dh of every stack's own so that Q dh = h; the
conventional method.
- ``decomposed``: the same A from Q and 2Q - 1 numbers.
- ``fixed_step``: one dh, so that one H and one U, tabulated once (`KernelTable`), serve all stacks.

The paper's version has errors of first order in dh where an interface lies inside a segment or h is
not a multiple of dh. ``corrected`` removes both. With a step of the stack's own it takes means over
a segment of q and of the beam in place of the values at the midpoint. With a fixed step it is
Galerkin's method: f constant in a segment, but q, the end of the glaze and the interfaces exact.
Integrating by parts leaves the kernel at the edges of segments and layers,

    int int z E_1(|s - s'|) z' ds ds' = -sum u u' E_3(|s - s'|) + 2 int z z' ds,

u being the jumps of the source z, and likewise int int z J_0(s + s') z' = sum u u' J_2(s + s') for
the surface: between the edges of the uniform grid that is a Toeplitz and a Hankel matrix for all
stacks, and only the few rows of interfaces are a stack's own.
"""

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ..common.inputs import (
    Numbers,
    batch_of_stacks,
    check_choice,
    check_given,
    check_values,
    concrete,
    flat_batch,
)
from ..common.split import Split
from .kernel_table import MOST_SEGMENTS, KernelTable
from .uniform_solver import Batch, GridSettings, Product, Variant, solve

# Stacks are gathered by number of segments where that saves so many matrix elements (stacks x Q^2):
# by a fixed step, where all share one matrix and a call costs the more, and by steps of their own.
_WORTH_A_BUCKET = {"fixed_step": 2**18, "decomposed": 2**15, "direct": 2**15}
# Elements of one vector over all stacks of a call.
_CHUNK_ELEMENTS = 2**20
# By transforms a stack costs as its segments, not their square: vector elements that are worth a
# program more.
_WORTH_A_TRANSFORM = 2**16
# From so many segments on transforms are faster than the matrix
# (benchmarks/results/auxiliary_products.txt).
_TRANSFORMED = {"fixed_step": 1024, "decomposed": 16, "direct": np.inf}
# From so many segments on, stacks with steps of their own are called one by one: one program serves
# any number of them.
_ALONE = 64
# Tables grow while they are kept.
_kept_table = functools.lru_cache(maxsize=8)(KernelTable)


def reflectance_factor(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: float = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    step: float = 0.01,
    variant: Variant = "fixed_step",
    corrected: bool = True,
    table: KernelTable | None = None,
    product: Product = "auto",
    segments: int | None = None,
) -> Float[Array, "*batch"]:
    """Reflectance factor pi L_out / E_in by the auxiliary function method: the sum of
    `split_reflectance_factor`.

    Arguments, errors, notes and source are those of `split_reflectance_factor`.
    """
    settings = GridSettings(
        variant=variant,
        corrected=corrected,
        refractive_index=refractive_index,
        step=step,
        product=product,
    )
    stack = (albedo, optical_thickness, substrate_reflectance, cos_incidence, cos_viewing)
    terms = _evaluate(stack, settings, table, segments)
    return jnp.asarray(terms.ground + terms.single + terms.multiple)


def split_reflectance_factor(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: float = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    step: float = 0.01,
    variant: Variant = "fixed_step",
    corrected: bool = True,
    table: KernelTable | None = None,
    product: Product = "auto",
    segments: int | None = None,
) -> Split:
    """Reflectance factor of a stack of layers in its three parts: ground, single and multiple
    scattering.

    The same quantity as `glazejax.stack_reflectance_factor`, which gives one to an accuracy asked
    for; here the step decides.

    Args:
        refractive_index: n of all layers, one number in [1, 2.5].
        step: dh, optical thickness of a segment, a number. A stack gets h/dh segments, rounded;
            with a step of its own dh is then changed so that they fit.
        variant: "direct", "decomposed" or "fixed_step", see the module.
        corrected: whether interfaces and the glaze's end may lie inside a segment without an error
            of first order; False is the paper as printed, in which a fixed step changes h to a
            multiple of dh.
        table: of kernels, for "fixed_step"; it grows as needed. By default one for each index and
            step is kept from call to call, the last eight.
        product: how H + U acts while the equation is solved: "matrix", made for one stack after the
            other where each has its own; "matrices", made for all stacks at once; "fft", never
            made, by fast transforms of its Toeplitz and Hankel numbers (`structured`), all stacks
            at once. "auto" takes the fastest for the number of segments.
        segments: for steps of a stack's own, how many segments a program has room for: needed under
            `jax.jit` with a traced thickness, where the thickest stack is not known.
        The others as in `glazejax.stack_reflectance_factor`.

    Returns:
        `Split`, each part of the shape of the broadcast batch. Where only the angles vary along an
        axis, the stacks' matrices are made once for all of them.

    Raises:
        ValueError: a value out of range, shapes that do not broadcast, an unknown variant, a table
            of another index or step, a stack of more than `kernel_table.MOST_SEGMENTS` segments, or
            an optical thickness that is traced by `jax.jit` without a table, or segments, to say
            how many segments there may be.

    Notes:
        The error is of second order in dh where ``corrected``: at most 0.04 (dh/mu)^2, mu the
        smaller cosine inside, on the shared references, and mostly far less. Without, it is of
        first order (`python -m benchmarks.papers.auxiliary_order` shows both).
        Differentiable by albedo, thickness, ground and the cosines at a fixed number of segments,
        forward and reverse; as printed, the result by a fixed step is piecewise constant in the
        thickness, so only the corrected one has a derivative worth the name. Under `jax.jit` with a
        traced thickness give a table (segments, for own steps) that is long enough: a stack beyond
        it stops the program with an error that names both.
        Stacks of unlike thickness are gathered in a few groups of about as many segments and filled
        up with segments of albedo 0, which scatter nothing and so change nothing.

    Source: paper A (Shinozawa et al. 2013), eqs (3)-(5), (17)-(34), sections 4.1 and 4.2.
    """
    settings = GridSettings(
        variant=variant,
        corrected=corrected,
        refractive_index=refractive_index,
        step=step,
        product=product,
    )
    stack = (albedo, optical_thickness, substrate_reflectance, cos_incidence, cos_viewing)
    terms = _evaluate(stack, settings, table, segments)
    return jax.tree.map(jnp.asarray, terms)


def _evaluate(
    stack: tuple[Numbers, ...],
    settings: GridSettings,
    table: KernelTable | None,
    segments: int | None,
) -> Split:
    """The parts, as NumPy arrays where all arguments are known."""
    _check(settings, table, segments)
    names = ("albedo", "optical_thickness", "substrate_reflectance", "cos_incidence", "cos_viewing")
    batch, restore = _flatten(dict(zip(names, stack, strict=True)))
    settings = settings._replace(
        corrected=bool(settings.corrected),
        refractive_index=float(settings.refractive_index),
        step=float(settings.step),
    )
    step = settings.step
    thickness = concrete(batch.thickness)
    if thickness is None:
        return restore(_solve_traced(batch, settings, table, segments))
    # How many segments each stack needs; too many are refused before anything is computed.
    count = np.asarray(_segments(np.sum(np.asarray(thickness, np.float64), axis=1), settings))
    most = int(count.max(initial=1))
    if most > MOST_SEGMENTS:
        thickest = float(np.sum(thickness, axis=1).max())
        raise ValueError(
            f"an optical thickness of {thickest:g} at step {step:g} needs {most} segments, more "
            f"than {MOST_SEGMENTS}; use a step of {thickest / MOST_SEGMENTS:.2g} or more, or "
            "stack_reflectance_factor, which has no steps"
        )
    if segments is not None and most > segments:
        raise ValueError(
            f"a stack needs {most} segments of step {step:g}, more than the segments={segments} "
            "given"
        )
    settings = settings._replace(product=_chosen(settings, segments or most))
    at_once = settings.product != "matrix"
    vectors = _vectors(_table(table, settings, most), settings)
    angles = max(int(np.prod(batch.cos_incidence.shape[1:])), 1)
    results = []
    order = []
    # Stacks of about as many segments go together, filled up to few sizes, so that few programs are
    # compiled.
    for rows, most in _groups(count, settings, segments):
        alone = settings.variant != "fixed_step" and most >= _ALONE and not at_once
        chunk = 1 if alone else max(1, _CHUNK_ELEMENTS // (most * (angles + 1)))
        for start in range(0, rows.size, chunk):
            chosen = rows[start : start + chunk]
            size = min(
                chunk, _rounded_up(chosen.size) if at_once else 1 << (chosen.size - 1).bit_length()
            )
            filled = np.resize(chosen, size)
            piece = jax.tree.map(lambda leaf, index=filled: leaf[index], batch)
            results.append(solve(piece, count[filled], vectors(most), settings._replace(most=most)))
            order.append(chosen)
    if not results:
        shape = (
            0,
            *np.broadcast_shapes(batch.cos_incidence.shape[1:], batch.cos_viewing.shape[1:]),
        )
        return restore(Split(*(jnp.zeros(shape, batch.albedo.dtype),) * 3))
    # Back into the caller's order, without what was filled up.
    back = np.argsort(np.concatenate(order), kind="stable")
    xp = jnp if any(isinstance(leaf, Tracer) for leaf in results[0]) else np

    def together(*leaves: Any) -> Any:
        cut = [xp.asarray(leaf)[: rows.size] for leaf, rows in zip(leaves, order, strict=True)]
        return xp.concatenate(cut)[back] if len(cut) > 1 else cut[0]

    return restore(jax.tree.map(together, *results))


def _check(settings: GridSettings, table: KernelTable | None, segments: int | None) -> None:
    variant, _, refractive_index, step, _, product = settings
    check_choice("variant", variant, Variant)
    check_choice("product", product, Product)
    if variant == "direct" and product in ("fft", "matrices"):
        raise ValueError(
            f"product {product!r} needs the numbers of H and U, which 'direct' has not; use "
            "'decomposed'"
        )
    if variant == "fixed_step" and product == "matrices":
        raise ValueError(
            "product 'matrices' is no use to variant 'fixed_step', whose stacks share one; use "
            "'matrix'"
        )
    if segments is not None and variant == "fixed_step":
        raise ValueError(
            "segments is for own steps; give variant 'fixed_step' a table=KernelTable(...) that "
            "is long"
        )
    if segments is not None and not (
        isinstance(segments, int | np.integer) and 1 <= segments <= MOST_SEGMENTS
    ):
        raise ValueError(
            f"segments is {segments}; it must be a whole number from 1 to {MOST_SEGMENTS}"
        )
    if not (np.ndim(step) == 0 and 0 < step < np.inf):
        raise ValueError(f"step is {step}; it must be a positive optical thickness, such as 0.01")
    if isinstance(refractive_index, Tracer) or np.ndim(refractive_index) > 0:
        raise ValueError(
            "refractive_index must be one number here; stack_reflectance_factor takes arrays"
        )
    check_values({"refractive_index": refractive_index})
    if table is None:
        return
    if variant != "fixed_step":
        raise ValueError(
            f"a table is for variant 'fixed_step'; {variant!r} has a step for every stack"
        )
    if (table.refractive_index, table.step) != (float(refractive_index), float(step)):
        raise ValueError(
            f"{table!r} does not fit refractive_index {refractive_index:g} and step {step:g}; "
            "make one that does"
        )


def _flatten(arguments: dict[str, Any]):
    """One axis of stacks, then axes of angles; and the function that gives a result its
    shape back.
    """
    check_given(arguments)
    # Known arrays are gathered and cut by NumPy, which starts far faster.
    xp = jnp if any(isinstance(value, Tracer) for value in arguments.values()) else np
    arrays, full, layers = batch_of_stacks(arguments, xp=xp)
    of_media = (arrays["albedo"].shape[:-1], arrays["optical_thickness"].shape[:-1])
    matter = np.broadcast_shapes(*of_media, arrays["substrate_reflectance"].shape)
    matter = (1,) * (len(full) - len(matter)) + matter
    # Axes along which only the angles vary: the stacks' matrices serve all of them.
    angular = [axis for axis, size in enumerate(full) if matter[axis] == 1 and size != 1]
    of_stacks = [axis for axis in range(len(full)) if axis not in angular]
    order = [*of_stacks, *angular]
    size = int(np.prod([full[axis] for axis in of_stacks]))

    def of_angles(array: Any) -> Any:
        array = array.reshape((1,) * (len(full) - array.ndim) + array.shape)
        shape = [array.shape[axis] if axis in angular else full[axis] for axis in range(len(full))]
        array = xp.broadcast_to(array, shape).transpose(*order)
        return array.reshape(size, *array.shape[len(of_stacks) :])

    batch = Batch(
        albedo=flat_batch(arrays["albedo"], matter, layers),
        thickness=flat_batch(arrays["optical_thickness"], matter, layers),
        ground=flat_batch(arrays["substrate_reflectance"], matter),
        cos_incidence=of_angles(arrays["cos_incidence"]),
        cos_viewing=of_angles(arrays["cos_viewing"]),
    )

    def restore(result: Split) -> Split:
        shape = [full[axis] for axis in order]
        back = np.argsort(order).tolist()
        return jax.tree.map(lambda leaf: leaf.reshape(shape).transpose(*back), result)

    return batch, restore


def _segments(depth, settings: GridSettings):
    """Number of segments of stacks of this optical thickness; for numpy and JAX arrays."""
    xp = jnp if isinstance(depth, jax.Array) else np
    count = xp.round(depth / settings.step)
    if settings.variant == "fixed_step" and settings.corrected:
        return xp.maximum(count, 1).astype(int)
    # The paper asks for two at least; nothing at all needs none.
    return xp.where(depth > 0, xp.maximum(count, 2), 1).astype(int)


def _chosen(settings: GridSettings, most: int) -> Product:
    """The product asked for, or the fastest for so many segments."""
    if settings.product != "auto":
        return settings.product
    return "fft" if most >= _TRANSFORMED[settings.variant] else "matrix"


def _groups(
    count: np.ndarray, settings: GridSettings, segments: int | None
) -> list[tuple[np.ndarray, int]]:
    """Row numbers of the stacks of a program, and its padded number of segments."""
    if segments is not None:
        return [(np.arange(count.size), segments)]
    if settings.product == "fft":
        return _buckets(count, _WORTH_A_TRANSFORM, power=1)
    return _buckets(count, _WORTH_A_BUCKET[settings.variant])


def _buckets(count: np.ndarray, worth: int, power: int = 2) -> list[tuple[np.ndarray, int]]:
    """Stacks (row numbers) of about equal segment counts, each with its padded count."""
    distinct, which = np.unique(count, return_inverse=True)
    padded = np.array([_rounded_up(int(c)) for c in distinct], dtype=int)[which]
    sizes = np.unique(padded)
    waiting = np.zeros(0, int)
    buckets: list[tuple[np.ndarray, int]] = []
    for k, size in enumerate(sizes):
        waiting = np.concatenate([waiting, np.flatnonzero(padded == size)])
        # What these stacks would cost in the next bucket up.
        if k + 1 == sizes.size or waiting.size * (sizes[k + 1] ** power - size**power) > worth:
            buckets.append((np.sort(waiting), int(size)))
            waiting = np.zeros(0, int)
    return buckets


def _rounded_up(count: int) -> int:
    """To 1, 2, 3, 4, 6, 8, 12, 16, ..., so that few programs are compiled."""
    size = 1 << max(count - 1, 0).bit_length()
    return size * 3 // 4 if size > 2 and count <= size * 3 // 4 else size


def _table(table: KernelTable | None, settings: GridSettings, most: int) -> KernelTable | None:
    """The table to use, long enough; None where stacks have steps of their own."""
    if settings.variant != "fixed_step":
        return None
    if table is None:
        table = _kept_table(settings.refractive_index, settings.step)
    table.grow(min(_rounded_up(most), MOST_SEGMENTS))
    return table


def _vectors(table: KernelTable | None, settings: GridSettings):
    """Vectors of the table for the compiled program: a function of the number of segments."""
    if table is None:
        return lambda most: ()
    if settings.corrected:
        return lambda most: (table.e3[:most], table.j2[: 2 * most - 1])
    toeplitz = table.toeplitz
    hankel = table.hankel

    def print_step(most: int):
        m = (table.e2[:most], table.j1[: 2 * most], table.e3[: most + 1], table.j2[: 2 * most + 1])
        return toeplitz[:most], hankel[: 2 * most - 1], *m

    return print_step


def _solve_traced(
    batch: Batch, settings: GridSettings, table: KernelTable | None, segments: int | None
) -> Split:
    """Under `jax.jit`: as many segments as the table has, or as the caller says."""
    if settings.variant == "fixed_step":
        if table is None or table.segments == 0:
            raise ValueError(
                "optical_thickness is traced by jax.jit, so the number of segments is not known; "
                "give variant 'fixed_step' a table=KernelTable(refractive_index, step, segments) "
                "that is long enough, or do not jit"
            )
        most = table.segments
        reach = repr(table)
        longer = "make a table of more segments"
    else:
        if segments is None:
            raise ValueError(
                "optical_thickness is traced by jax.jit, so the number of segments is not known; "
                "give segments=, as many as the thickest stack needs at this step, or do not jit "
                f"(variant {settings.variant!r})"
            )
        most = segments
        reach = f"segments={segments}"
        longer = "give more segments"
    # The program has room for that many; a thicker stack is known only when it runs.
    vectors = _vectors(table, settings)(most)
    settings = settings._replace(most=most, product=_chosen(settings, most))
    count = _segments(jax.lax.stop_gradient(jnp.sum(batch.thickness, axis=1)), settings)
    count = eqx.error_if(
        count,
        count > most,
        f"a stack is thicker than {most * settings.step:g}, all that {reach} reaches under "
        f"jax.jit; {longer}, or call "
        "without jit, where it grows by itself",
    )
    return solve(batch, count, vectors, settings)
