"""Worst error of the auxiliary method's mesh at each tolerance, against discrete ordinates with
errors below 1e-10.

    python -m benchmarks.solver.calibrate_auxiliary [--stacks 1000] [--tolerances 1e-4 1e-6] [--out FOLDER]

The two share no approximation: here kernels are exponential integrals on a graded mesh in depth,
there directions are discrete and depth is exact. Prints for each row of
`glazejax.radiative.auxiliary.graded` the largest and the median difference of both reflectances
over random stacks, by refractive index and by the thickest layer.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.results import Results, command_line
from benchmarks.solver.calibrate_directions import in_chunks, known, random_stacks
from glazejax.radiative.auxiliary import graded as auxiliary_graded
from glazejax.radiative.auxiliary.panels import PanelMesh
from glazejax.radiative.common.stack_arrays import StackArrays

INDICES = (1.0, 1.02, 1.33, 1.5, 2.5)
THICKEST = (2.0, 8.0, 40.0, 1e4)
CHUNK = 10


def stacks_of(count: int, thickest: float, layers: int = 2) -> StackArrays:
    """Random stacks whose optical thickness ends at the given value, at which a quarter of the
    first layers are.
    """
    stacks = random_stacks(count, seed=int(thickest), layers=layers)
    scale = np.log(thickest / 0.003) / np.log(30 / 0.003)
    given = np.array(stacks.optical_thickness)
    thickness = np.where(given > 0, 0.003 * (given / 0.003) ** scale, 0.0)
    thickness[: count // 4, 0] = thickest
    return stacks._replace(optical_thickness=jnp.asarray(thickness))


@functools.partial(jax.jit, static_argnums=(2, 3))
def auxiliary(stacks: StackArrays, index, mesh: PanelMesh, fixed: float | None):
    """Reflectance factor and hemispherical reflectance, (2, stacks)."""
    return in_chunks(
        lambda piece: auxiliary_graded.reflectance(piece, mesh), stacks, index, fixed, CHUNK
    )


def main() -> None:
    quick = {"tolerances": [1e-4], "thickest": [2.0], "indices": [1.0, 1.5]}
    stacks = (1000, 50, "for each thickness; a multiple of 50")
    parser = command_line(__doc__, quick, stacks=stacks)
    parser.add_argument("--tolerances", type=float, nargs="*", help="of all rows if not given")
    parser.add_argument("--thickest", type=float, nargs="*", default=THICKEST)
    parser.add_argument("--indices", type=float, nargs="*", default=INDICES)
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    say = Results("calibrate_auxiliary", given.out)
    say(
        f"{given.stacks} stacks of 1 or 2 layers a cell; worst error / tolerance of the "
        "reflectance factor and of\n"
        "the hemispherical reflectance, then the median error of the first"
    )
    rows = given.tolerances or [row.tolerance for row in auxiliary_graded._ROWS]
    for thickest in given.thickest:
        stacks = stacks_of(given.stacks, thickest)
        say(
            f"\nlayers up to D = {thickest:g}\ntolerance  "
            + "".join(f"{n:>26}" for n in given.indices)
        )
        finest = {n: known(stacks, n, 1e-10)[0] for n in given.indices}
        for tolerance in rows:
            cells = []
            for n in given.indices:
                mesh = auxiliary_graded.resolve(tolerance, thickest, n)
                found = auxiliary(stacks, n, mesh, n if n == 1.0 else None)
                error = jnp.abs(found - finest[n])
                worst = jnp.max(error, axis=1) / tolerance
                cells.append(f"{worst[0]:9.3f}{worst[1]:8.3f}{jnp.median(error[0]):9.0e}")
            say(f"{tolerance:<11.0e}" + "".join(cells))
    say.save()


if __name__ == "__main__":
    main()
