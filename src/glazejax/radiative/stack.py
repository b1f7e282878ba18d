"""The two reflectances of a stack of layers and their split: validation, batching, derivatives,
choice of method.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from ..programs import Program
from .auxiliary.method import Auxiliary
from .common.chunks import in_chunks, on_all_cores, on_cpu, on_its_devices
from .common.inputs import (
    INDEX_RANGE,
    OF_LAYERS,
    BatchShape,
    Numbers,
    batch_of_stacks,
    batch_shape,
    check_choice,
    check_given,
    check_tolerance,
    check_values,
    concrete,
    flat_batch,
    plain_number,
)
from .common.rounding import FINEST_SINGLE, warn_of_rounding, warn_user
from .common.solver import Request, Solver
from .common.split import Split
from .common.stack_arrays import LeafNames, StackArrays, ValueAndGradient, with_its_gradient
from .manyflux.method import ManyFlux
from .ordinates.method import Ordinates

Method = Literal["ordinates", "auxiliary", "manyflux"]
"""Ways to compute the same quantity."""

LEAST_SLOPING_INDEX = 1.0 + 1e-4
"""Nearer to one a slope by the index drowns in the quadrature's error, but for the
default method.
"""

# So many known stacks go to all cores at once.
_MANY = 2**13

_SOLVERS: dict[str, Solver] = {
    "ordinates": Ordinates(),
    "auxiliary": Auxiliary(),
    "manyflux": ManyFlux(),
}


class _StackSettings(NamedTuple):
    """Settings fixed when the program is compiled."""

    method: str
    resolution: Any  # the solver's own
    refractive_index: float | None  # None where the index is an array of the stack
    chunk: int
    near_one: bool  # whether an index of (almost) one may come


def stack_reflectance_factor(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    tolerance: float = 1e-6,
    method: Method = "ordinates",
) -> Float[Array, "*batch"]:
    """Reflectance factor pi L_out / E_in of a stack of layers under a smooth interface.

    Collimated unpolarised light falls on a smooth dielectric surface, is refracted, scattered
    isotropically in homogeneous layers that share one refractive index, reflected by a Lambertian
    ground and seen, refracted out again, from one direction. The part reflected by the surface
    itself is not included. Isotropic scattering makes the result independent of azimuth, and the
    same with incidence and viewing exchanged.

    Args:
        albedo: single-scattering albedo s/(k + s) of each layer, top first, (..., layers), in [0,
            1].
        optical_thickness: (k + s) times thickness, (..., layers), >= 0. Zero is an absent layer,
            exactly.
        substrate_reflectance: of the Lambertian ground, as seen from inside the medium, (...), in
            [0, 1].
        refractive_index: of all layers, (...), in [1, 2.5]. A Python number is the fast path:
            directions are then chosen for it. Under `jax.jit` an index that is traced gets
            directions good for the whole range.
        cos_incidence: cosine of the angle of incidence in air, (...), in (0, 1].
        cos_viewing: cosine of the viewing angle in air, (...), in (0, 1].
        tolerance: absolute error wanted, a Python number; see Notes.
        method: "ordinates" (discrete ordinates in even-parity form, `glazejax.radiative.ordinates`)
            or "auxiliary" (paper A's integral equation on a graded mesh,
            `glazejax.radiative.auxiliary.graded`: slower, but it shares no approximation with the
            other, so that each checks the other) or "manyflux" (paper C's layer operators by
            doubling, `glazejax.radiative.manyflux`, which also takes other phase functions: slower
            too).

    Returns:
        Reflectance factor, shape of the broadcast batch. float64 if x64 is enabled in JAX, else
        float32.

    Raises:
        ValueError: a value out of range, NaN, shapes that do not broadcast, or an unknown method;
            the message names the argument and the value. Where a value that is traced is out of
            its range, the result is NaN.

    Notes:
        `tolerance` picks the number of directions: for an index that is a number by their error in
        the sums they have to make (`ordinates.resolution`), for an array of indices from a table.
        Both were calibrated on random stacks of 1 to 5 layers with optical thickness 0.003 to 30,
        albedo up to 1 - 1e-6, grounds 0 to 1 and cosines 0.05 to 1 at indices from 1 to 2.5 against
        a run with more than twice the directions, so that the worst of them stays below the
        tolerance (`python -m benchmarks.solver.calibrate_directions` repeats it). Where light and
        view both graze a medium of an index near one, inside too, or light alone where all that
        leaves is counted, there are more directions, for cosines down to 1e-4; a cosine that is
        traced counts as that. A tolerance below 1e-10 (1e-8 by "auxiliary") is met as that, and a
        warning says so. In float32, rounding leaves about 1e-5: the default is met as that, and
        anything below it with a warning.

        The derivative by an index of exactly one is the one from above, for there is none below. It
        is the limit in closed form (method "ordinates"). Just above one, it holds to some
        hundredths where directions do not follow the surface's rise: up to 1 + 1e-6 at a tolerance
        of 1e-6, 1 + 1e-8 at 1e-8. The other methods give the derivative at 1.0001 from one up to
        there.

    Source: paper A (Shinozawa et al. 2013), eqs (4)-(22), solved as described in
    `glazejax.radiative.ordinates.solver`.
    """
    check_given({"cos_viewing": cos_viewing})
    inputs = _Inputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        refractive_index=refractive_index,
        cos_incidence=cos_incidence,
        cos_viewing=cos_viewing,
    )
    return _evaluate(inputs, tolerance, method, _reflect)


def stack_hemispherical_reflectance(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    tolerance: float = 1e-6,
    method: Method = "ordinates",
) -> Float[Array, "*batch"]:
    """Directional-hemispherical reflectance of a stack of layers under a smooth interface.

    Flux that leaves over flux that falls on the surface as a collimated beam, without the part
    reflected by the surface itself. By reciprocity it is also the hemispherical-directional
    reflectance factor of a diffusely lit sample seen at the same angle (an integrating sphere d:8
    is ``cos_incidence = cos(8 deg)``).

    Arguments as in `stack_reflectance_factor`, errors and notes too; there is no viewing direction.

    Returns:
        Reflectance, shape of the broadcast batch.

    Source: paper A (Shinozawa et al. 2013), eqs (4)-(22), solved as described in
    `glazejax.radiative.ordinates.solver`.
    """
    inputs = _Inputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        refractive_index=refractive_index,
        cos_incidence=cos_incidence,
    )
    return _evaluate(inputs, tolerance, method, _reflect)


def split_reflectance_factor(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    cos_viewing: Numbers = 1.0,
    tolerance: float = 1e-6,
    method: Method = "ordinates",
) -> Split:
    """Reflectance factor by what the light did last: ground reflection, single and multiple
    scattering.

    Arguments as in `stack_reflectance_factor`, whose value is the sum of the three; errors too.

    Returns:
        `Split` of arrays in the shape of the broadcast batch.

    Source: paper A (Shinozawa et al. 2013), eqs (19), (22), (32)-(34).
    """
    check_given({"cos_viewing": cos_viewing})
    inputs = _Inputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        refractive_index=refractive_index,
        cos_incidence=cos_incidence,
        cos_viewing=cos_viewing,
    )
    return _evaluate_split(inputs, tolerance, method)


def split_hemispherical_reflectance(
    albedo: Numbers,
    optical_thickness: Numbers,
    substrate_reflectance: Numbers,
    *,
    refractive_index: Numbers = 1.5,
    cos_incidence: Numbers = 1.0,
    tolerance: float = 1e-6,
    method: Method = "ordinates",
) -> Split:
    """Directional-hemispherical reflectance by what the light did last; see
    `split_reflectance_factor`.

    Arguments as in `stack_reflectance_factor`, without a viewing direction; errors too.
    `stack_hemispherical_reflectance` is the sum of the three.

    Returns:
        `Split` of arrays in the shape of the broadcast batch.

    Source: paper A (Shinozawa et al. 2013), eqs (19), (22), (32)-(34).
    """
    inputs = _Inputs(
        albedo=albedo,
        optical_thickness=optical_thickness,
        substrate_reflectance=substrate_reflectance,
        refractive_index=refractive_index,
        cos_incidence=cos_incidence,
    )
    return _evaluate_split(inputs, tolerance, method)


class _Inputs(NamedTuple):
    """The arguments as given."""

    albedo: Numbers
    optical_thickness: Numbers
    substrate_reflectance: Numbers
    refractive_index: Numbers
    cos_incidence: Numbers
    cos_viewing: Numbers | None = None  # None: all viewing directions together


def _evaluate(inputs: _Inputs, tolerance: float, method: str, run: Any) -> Any:
    def evaluate(arguments: Mapping[str, Any]) -> Any:
        stack, settings, batch = _prepare(_Inputs(**arguments), tolerance, method)
        return jax.tree.map(lambda term: _shaped(term, batch), run(stack, settings))

    return on_its_devices(evaluate, inputs._asdict(), OF_LAYERS)


def _reflect(stack: StackArrays, settings: _StackSettings) -> Array:
    # Outside a compiled program the parts of a large batch are programs of their own, one a core.
    return (_run if stack.ground.shape[0] < _MANY else _reflectance)(stack, settings)


def _shaped(values: Array, batch: BatchShape) -> Array:
    """Results in the shape of the batch; where they are known and small, without a program."""
    if values.shape == batch:
        return values
    if isinstance(values, Tracer) or not on_cpu(values):
        return values.reshape(batch)
    return jax.device_put(np.asarray(values).reshape(batch))


def _evaluate_split(inputs: _Inputs, tolerance: float, method: str) -> Split:
    check_choice("method", method, Method)
    if not _SOLVERS[method].splits:
        raise ValueError(
            f"method {method!r} does not split the reflectance; use 'ordinates' or 'auxiliary'"
        )
    return _evaluate(inputs, tolerance, method, _run_split)


def _prepare(
    inputs: _Inputs, tolerance: float, method: str
) -> tuple[StackArrays, _StackSettings, BatchShape]:
    """Checked arguments as a flat batch of stacks, what is fixed in the program, and the batch's
    shape.
    """
    arrays, numbers = inputs[:3], inputs[3:]
    if (
        method != "ordinates"
        or not all(isinstance(number, float | None) for number in numbers)
        or not all(isinstance(a, float | np.ndarray) and 0 < np.size(a) < _MANY for a in arrays)
        # Small arrays may broadcast to many stacks, and a plan keeps an array of all of them.
        or _stacks(*map(np.shape, arrays)) >= _MANY
    ):
        return _prepare_any(inputs, tolerance, method)
    # Shapes alone plan the rest, once; arrays are new each time.
    check_tolerance(tolerance)
    check_values(dict(zip(_Inputs._fields, arrays, strict=False)))
    dtype = jax.dtypes.canonicalize_dtype(float)
    tolerance = _within_reach(tolerance, method, single=dtype == np.float32)
    device = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    stack, settings, batch = _plan(tuple(map(np.shape, arrays)), numbers, tolerance, dtype, device)
    flat = (
        flat_batch(np.asarray(array, dtype), batch, *planned.shape[1:])
        for array, planned in zip(arrays, stack, strict=False)
    )
    return StackArrays(*flat, *stack[3:]), settings, batch


def _stacks(albedo: BatchShape, optical_thickness: BatchShape, ground: BatchShape) -> int:
    """Number of stacks that arrays of these shapes make."""
    shapes = {
        "albedo": albedo[:-1],
        "optical_thickness": optical_thickness[:-1],
        "substrate_reflectance": ground,
    }
    return math.prod(batch_shape(shapes))


@functools.lru_cache(maxsize=256)
def _plan(shapes: Any, numbers: Any, tolerance: float, *_: Any) -> Any:
    """What `_prepare_any` returns for any arrays of these shapes, in JAX's precision and on its
    device, which come last.
    """
    return _prepare_any(_Inputs(*map(np.zeros, shapes), *numbers), tolerance, "ordinates")


def _prepare_any(
    inputs: _Inputs, tolerance: float, method: str
) -> tuple[StackArrays, _StackSettings, BatchShape]:
    """What `_prepare` returns, with nothing planned before."""
    check_choice("method", method, Method)
    check_tolerance(tolerance)
    # No viewing direction: all of them together. `batch_of_stacks` checks the rest.
    check_given({name: getattr(inputs, name) for name in ("refractive_index", "cos_incidence")})
    check_values({"refractive_index": inputs.refractive_index})
    fixed = plain_number(inputs.refractive_index)
    checked = batch_of_stacks(
        inputs._asdict() | ({} if fixed is None else {"refractive_index": None})
    )
    flat = checked.flat()
    dtype = checked.arrays["albedo"].dtype
    index = concrete(inputs.refractive_index)
    # The range of indices that one set of directions must serve.
    if index is None or index.size == 0:
        low, high = INDEX_RANGE
    else:
        low = float(index.min())
        high = float(index.max())
    if fixed is None and high == 1.0:
        high = 1.001  # an array may be differentiated by, and slopes at one are those just above it
    solver = _SOLVERS[method]
    single = dtype == jnp.float32
    if single and solver.rounding is not None:
        warn_of_rounding(
            solver.rounding,
            inputs.albedo,
            inputs.optical_thickness,
            tolerance,
            advice="take method 'ordinates', or ",
        )
    resolution, chunk = solver.resolve(
        Request(
            tolerance=_within_reach(tolerance, method, single=single),
            indices=(low, high),
            fixed_index=fixed,
            optical_thickness=inputs.optical_thickness,
            cos_incidence=inputs.cos_incidence,
            cos_viewing=inputs.cos_viewing,
            stacks=math.prod(checked.batch),
            layers=checked.layers,
            itemsize=dtype.itemsize,
            inputs=inputs,
        )
    )
    stack = StackArrays(
        albedo=flat["albedo"],
        optical_thickness=flat["optical_thickness"],
        ground=flat["substrate_reflectance"],
        refractive_index=flat.get("refractive_index"),
        cos_incidence=flat["cos_incidence"],
        cos_viewing=flat.get("cos_viewing"),
    )
    return (
        stack,
        _StackSettings(
            method=method,
            resolution=resolution,
            refractive_index=fixed,
            chunk=chunk,
            near_one=low < LEAST_SLOPING_INDEX,
        ),
        checked.batch,
    )


def _within_reach(tolerance: float, method: str, *, single: bool) -> float:
    """The tolerance that is met; a warning where a finer one is asked for.

    In single precision the default tolerance counts as not asked for.
    """
    finest = FINEST_SINGLE if single else _SOLVERS[method].finest
    # The default.
    if tolerance < min(finest, 1e-6) * (1 - 1e-9):
        limit = (
            "in single precision; enable x64 in JAX for less"
            if single
            else f"with method {method!r}"
        )
        warn_user(f"tolerance is {tolerance:g}, but {finest:g} is the least there is {limit}")
    return max(float(tolerance), finest)


@functools.partial(Program, fixed=("settings",))
def _run(stack: StackArrays, settings: _StackSettings) -> Array:
    return _reflectance(stack, settings)


@functools.partial(jax.jit, static_argnums=1)
def _run_split(stack: StackArrays, settings: _StackSettings) -> Split:
    def one(chunk: StackArrays) -> Split:
        return _SOLVERS[settings.method].split(_with_index(chunk, settings), settings.resolution)

    return in_chunks(one, stack, settings.chunk)


@with_its_gradient
def _reflectance(stack: StackArrays, settings: _StackSettings, leaf_names: LeafNames | None) -> Any:
    """By the stationary form: the gradient of each stack comes with its value, chunk by chunk."""
    return on_all_cores(_some_stacks, stack, settings, leaf_names, least=_MANY)


def _some_stacks(stack: StackArrays, settings: _StackSettings, leaf_names: LeafNames | None) -> Any:
    """Reflectance of stacks, with its gradient by what is wanted, chunk by chunk."""

    def one(chunk: StackArrays) -> Any:
        indexed = _with_index(chunk, settings)
        if leaf_names is None:
            return _SOLVERS[settings.method].reflectance(indexed, settings.resolution)
        return _with_gradient(indexed, settings, leaf_names)

    return in_chunks(one, stack, settings.chunk)


def _with_gradient(
    stack: StackArrays, settings: _StackSettings, leaf_names: LeafNames
) -> ValueAndGradient:
    """Reflectance and gradient; but for the default method, slopes by an index of (almost) one are
    those above it.
    """
    solver = _SOLVERS[settings.method]
    solve = functools.partial(solver.reflectance_and_gradient, leaf_names=leaf_names)
    if "refractive_index" not in leaf_names or not settings.near_one or solver.slopes_at_index_one:
        return solve(stack, settings.resolution)
    near = stack.refractive_index < LEAST_SLOPING_INDEX
    nothing = (
        jnp.zeros_like(stack.ground),
        {name: jnp.zeros_like(getattr(stack, name)) for name in leaf_names},
    )

    def at(lifted: Array):
        # Lifted to the least index whose slope stands out from the quadrature's error.
        index = jnp.where(near & lifted, LEAST_SLOPING_INDEX, stack.refractive_index)
        shifted = stack._replace(refractive_index=index)
        # The second run is left out where no index is near one.
        return jax.lax.cond(
            jnp.any(near) | ~lifted, lambda: solve(shifted, settings.resolution), lambda: nothing
        )

    # One program run twice, not two programs: compilation takes longer than either.
    value, slopes = jax.lax.map(at, jnp.array([False, True]))
    plain = {name: slope[0] for name, slope in slopes.items()}
    return value[0], plain | {
        "refractive_index": jnp.where(near, *slopes["refractive_index"][::-1])
    }


def _with_index(stack: StackArrays, settings: _StackSettings) -> StackArrays:
    return (
        stack
        if settings.refractive_index is None
        else stack._replace(refractive_index=settings.refractive_index)
    )
