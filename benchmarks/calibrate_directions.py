"""Worst error of each tolerance's directions over random stacks, against a run with far more directions.

    python -m benchmarks.calibrate_directions [--stacks 2000]

Prints (1) the search for the crowding of graded nodes, (2) for every row of `glazejax.radiative.resolution` and a
range of refractive indices the largest error of both reflectances as a fraction of the tolerance.
"""

import argparse
import functools

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import expn

from glazejax.radiative import ordinates
from glazejax.radiative.directions import Resolution, conserve, graded_gauss
from glazejax.radiative.resolution import _ROWS, resolve
from glazejax.radiative.stack import INDEX_RANGE

INDICES = (1.0, 1.000001, 1.0001, 1.005, 1.05, 1.1, 1.2, 1.33, 1.5, 1.7, 2.0, 2.5)
FINEST = Resolution(36, 30, crowded=True)
CHUNK = 50


def random_stacks(count: int, seed: int = 0, layers: int = 5) -> ordinates.Stack:
    """Stacks of 1 to 5 layers, D .003-30, albedo up to 1 - 1e-6, grounds 0-1, cosines .05-1."""
    rng = np.random.default_rng(seed)
    shape = (count, layers)
    pale = rng.uniform(size=shape) < 0.5
    albedo = np.where(pale, 1 - 10 ** rng.uniform(-6, 0, shape), rng.uniform(0, 1, shape))
    thickness = 10 ** rng.uniform(np.log10(0.003), np.log10(30), shape)
    present = np.arange(layers) < rng.integers(1, layers + 1, count)[:, None]
    ground = rng.choice([0, 0.2, 0.5, 0.8, 0.95, 1.0], count)
    cosines = rng.uniform(0.05, 1, (2, count))
    given = (albedo, np.where(present, thickness, 0.0), ground)
    q, d, ground, incidence, viewing = map(jnp.asarray, (*given, *cosines))
    return ordinates.Stack(q, d, ground, None, incidence, viewing)


@functools.partial(jax.jit, static_argnums=(2, 3))
def both(stacks: ordinates.Stack, index, resolution: Resolution, fixed: float | None = None):
    """Reflectance factor and hemispherical reflectance, (2, stacks).

    One program serves all indices; only an index of exactly one, with no total reflection, needs its own.
    """

    def chunk(piece):
        array = jnp.broadcast_to(index, piece.ground.shape)
        piece = piece._replace(refractive_index=array if fixed is None else fixed)
        flux = piece._replace(cos_viewing=None)
        return ordinates.reflectance(piece, resolution), ordinates.reflectance(flux, resolution)

    pieces = jax.tree.map(lambda a: a.reshape(-1, CHUNK, *a.shape[1:]), stacks)
    return jnp.stack([a.reshape(-1) for a in jax.lax.map(chunk, pieces)])


def crowding_search() -> None:
    depth = np.r_[0, np.geomspace(1e-5, 40, 600)]
    exact = expn(3, depth)

    def error(count, c):
        x, w = graded_gauss(count, c)
        return np.abs(np.exp(-depth[:, None] / x) @ (conserve(x, w) * x) - exact).max()

    print("graded nodes: best crowding c, largest error of E3(D), and the same for x = y^2")
    for count in range(2, 25):
        candidates = np.round(np.arange(0, 6, 0.1), 1)
        errors = [error(count, c) for c in candidates]
        best = int(np.argmin(errors))
        print(f"  {count:3d}  c = {candidates[best]:.1f}  {errors[best]:.1e}  {errors[0]:.1e}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--stacks", type=int, default=1000, help="a multiple of 50")
    count = parser.parse_args().stacks
    jax.config.update("jax_enable_x64", True)
    crowding_search()
    stacks = random_stacks(count)
    reference = {n: both(stacks, n, FINEST) for n in INDICES}
    # At an index of exactly one the finest run, too, must have no totally reflected part.
    reference[1.0] = both(stacks, 1.0, FINEST._replace(total=0), 1.0)
    for known in (True, False):
        print(f"\nworst error / tolerance over {count} stacks (reflectance factor, hemispherical),")
        print(f"refractive index {'known' if known else 'traced: directions for all of 1 to 2.5'}")
        print("tolerance  " + "".join(f"{n:>16}" for n in INDICES))
        for row in _ROWS:
            cells = []
            for n in INDICES:
                span = (n, n) if known else INDEX_RANGE
                fixed = n if known and n == 1.0 else None
                found = both(stacks, n, resolve(row.tolerance, *span), fixed)
                error = jnp.max(jnp.abs(found - reference[n]), axis=1) / row.tolerance
                cells.append(f"{error[0]:8.2f}{error[1]:8.2f}")
            print(f"{row.tolerance:<11.0e}" + "".join(cells), flush=True)


if __name__ == "__main__":
    main()
