"""Worst error of the directions of each tolerance over random stacks, against a run with far more
directions.

    python -m benchmarks.solver.calibrate_directions [--stacks 1000] [--arrays] [--out FOLDER]

For tolerances from 1e-2 to 1e-10 and a range of refractive indices: how many directions
`resolve_known` takes, and the largest error of both reflectances as a fraction of the tolerance.
`--arrays` adds the directions that an index gets which is an array or traced, good for a span of
indices; that takes longer.
"""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.results import Results, command_line, quantity
from glazejax.radiative.common.directions import Resolution, half_range, resolve
from glazejax.radiative.common.quadrature import Directions
from glazejax.radiative.ordinates import solver as ordinates
from glazejax.radiative.ordinates.resolution import resolve_known
from glazejax.radiative.stack import INDEX_RANGE

TOLERANCES = tuple(10.0**-k for k in range(2, 11))
INDICES = (1.0, 1.000001, 1.0001, 1.02, 1.1, 1.33, 1.5, 1.7, 1.85, 2.5)
FINEST = Resolution(36, 30, crowded=True)
CHUNK = 50


def random_stacks(count: int, seed: int = 0, layers: int = 5) -> ordinates.StackArrays:
    """Stacks of 1 to 5 layers, D 1e-6 to 1e4, albedo up to 1 - 1e-6, grounds 0-1, cosines .05-1."""
    rng = np.random.default_rng(seed)
    shape = (count, layers)
    pale = rng.uniform(size=shape) < 0.5
    albedo = np.where(pale, 1 - 10 ** rng.uniform(-6, 0, shape), rng.uniform(0, 1, shape))
    thickness = 10 ** rng.uniform(-6, 4, shape)
    present = np.arange(layers) < rng.integers(1, layers + 1, count)[:, None]
    ground = rng.choice([0, 0.2, 0.5, 0.8, 0.95, 1.0], count)
    cosines = rng.uniform(0.05, 1, (2, count))
    given = (albedo, np.where(present, thickness, 0.0), ground)
    q, d, ground, incidence, viewing = map(jnp.asarray, (*given, *cosines))
    return ordinates.StackArrays(q, d, ground, None, incidence, viewing)


def in_chunks(
    reflectance: Callable[[ordinates.StackArrays], jax.Array],
    stacks: ordinates.StackArrays,
    index,
    fixed: float | None,
    size: int,
) -> jax.Array:
    """Reflectance factor and hemispherical reflectance by a solver, (2, stacks), so many at a
    time.
    """

    def chunk(piece):
        array = jnp.broadcast_to(index, piece.ground.shape)
        piece = piece._replace(refractive_index=array if fixed is None else fixed)
        return reflectance(piece), reflectance(piece._replace(cos_viewing=None))

    pieces = jax.tree.map(lambda a: a.reshape(-1, size, *a.shape[1:]), stacks)
    return jnp.stack([a.reshape(-1) for a in jax.lax.map(chunk, pieces)])


@functools.partial(jax.jit, static_argnums=(2, 3))
def both(
    stacks: ordinates.StackArrays,
    index,
    resolution: Resolution | None,
    fixed: float | None = None,
    directions: Directions | None = None,
):
    """Reflectance factor and hemispherical reflectance, (2, stacks).

    One program serves all indices, and with given directions all of as many; only an index of
    exactly one, with no total reflection, needs its own.
    """
    chosen = directions if directions is not None else resolution
    assert chosen is not None
    return in_chunks(
        lambda piece: ordinates.reflectance(piece, chosen), stacks, index, fixed, CHUNK
    )


def known(stacks: ordinates.StackArrays, index: float, tolerance: float) -> tuple[jax.Array, int]:
    """Both reflectances with the directions of a known index, and their number."""
    directions = half_range(index, resolve_known(tolerance, index))
    traced = Directions(*(jnp.asarray(a) for a in directions))
    return both(stacks, index, None, None, traced), directions.cosines.size


def spanned(stacks: ordinates.StackArrays, index: float, tolerance: float) -> tuple[jax.Array, int]:
    """Both reflectances with the directions of a traced index, and their number."""
    resolution = resolve(tolerance, *INDEX_RANGE)
    return both(stacks, index, resolution), resolution.cone + resolution.total


def main() -> None:
    parser = command_line(__doc__, stacks=(1000, 50, "a multiple of 50"))
    parser.add_argument("--arrays", action="store_true", help="also directions for a traced index")
    options = parser.parse_args()
    if options.quick:
        globals().update(INDICES=(1.0, 1.5), TOLERANCES=(1e-3,))
    jax.config.update("jax_enable_x64", True)
    say = Results("calibrate_directions", options.out)
    stacks = random_stacks(options.stacks)
    reference = {n: both(stacks, n, FINEST) for n in INDICES[1:]}
    # At an index of exactly one the finest run, too, must have no totally reflected part.
    reference[1.0] = both(stacks, 1.0, FINEST._replace(total=0), 1.0)
    kinds = [("a known index", known)] + [
        ("a traced index, for all of 1 to 2.5", spanned)
    ] * options.arrays
    worst = 0.0
    for words, solve in kinds:
        say(
            f"\ndirections of {words}: number, worst error / tolerance over {options.stacks} "
            "stacks of the\n"
            "reflectance factor and of the hemispherical reflectance"
        )
        say("tolerance  " + "".join(f"{n:>16}" for n in INDICES))
        for tolerance in TOLERANCES:
            cells = []
            for n in INDICES:
                found, count = solve(stacks, n, tolerance)
                error = jnp.max(jnp.abs(found - reference[n]), axis=1) / tolerance
                worst = max(worst, float(jnp.max(error)))
                cells.append(f"{count:4d}{error[0]:6.2f}{error[1]:6.2f}")
            say(f"{tolerance:<11.0e}" + "".join(cells))
    say.record(worst=quantity(worst, n=options.stacks), stacks=quantity(options.stacks, digits=0))
    say.save()


if __name__ == "__main__":
    main()
