"""Order of convergence of the auxiliary function method on stacks that no step fits, as printed and
corrected.

    python -m benchmarks.papers.auxiliary_order [--out FOLDER] [--stacks 24]

Random stacks of two and three layers under a surface of n = 1.5, so that interfaces lie anywhere
inside a segment and h is no multiple of a step. Error: root mean square and largest over the
stacks, against the default solver at a tolerance of 1e-10, which rests on other numerics
altogether. Writes a table.
"""

import jax
import numpy as np

from benchmarks.results import Results, command_line, quantity
from glazejax import stack_reflectance_factor
from glazejax.radiative.auxiliary.uniform import reflectance_factor

STEPS = (0.32, 0.16, 0.08, 0.04, 0.02, 0.01)
PRINTED, CORRECTED = "fixed step, as printed", "fixed step, corrected"
METHODS = {
    PRINTED: {"variant": "fixed_step", "corrected": False},
    "own step, as printed": {"variant": "decomposed", "corrected": False},
    "own step, corrected": {"variant": "decomposed", "corrected": True},
    CORRECTED: {"variant": "fixed_step", "corrected": True},
}


def stacks(count: int) -> tuple[np.ndarray, ...]:
    """Albedo and optical thickness (count, 3), ground and two cosines; every other stack has two
    layers only.
    """
    rng = np.random.default_rng(20)
    albedo, thickness = rng.uniform(0, 1, (count, 3)), rng.uniform(0.05, 1, (count, 3))
    thickness[::2, 2] = 0.0
    return (
        albedo,
        thickness,
        rng.uniform(0, 1, count),
        rng.uniform(0.1, 1, count),
        rng.uniform(0.1, 1, count),
    )


def main() -> None:
    options = command_line(__doc__, stacks=(24, 4, "how many")).parse_args()
    jax.config.update("jax_enable_x64", True)
    *given, incidence, viewing = stacks(options.stacks)
    angles = {"cos_incidence": incidence, "cos_viewing": viewing}
    truth = np.asarray(stack_reflectance_factor(*given, **angles, tolerance=1e-10))
    results = Results("auxiliary_order", options.out)
    results(
        f"{options.stacks} random stacks of 2 and 3 layers, h = {given[1].sum(axis=1).min():.2f} "
        "to "
        f"{given[1].sum(axis=1).max():.2f}, n = 1.5: error of the reflectance factor\n"
        "order: slope of the root mean square against the step, from row to row and over all"
    )
    square: dict[str, np.ndarray] = {}
    orders: dict[str, float] = {}
    largest: dict[str, float] = {}
    for name, settings in METHODS.items():
        errors = [
            np.abs(np.asarray(reflectance_factor(*given, **angles, step=step, **settings)) - truth)
            for step in STEPS
        ]
        rms = square[name] = np.sqrt(np.mean(np.square(errors), axis=1))
        orders[name] = np.polyfit(np.log(STEPS), np.log(rms), 1)[0]
        largest[name] = errors[-1].max()
        results(
            f"\n{name}: order {orders[name]:.2f}\n"
            f"{'step':>6} {'rms':>9} {'largest':>9} {'order':>6}"
        )
        for k, step in enumerate(STEPS):
            order = f"{np.log(rms[k - 1] / rms[k]) / np.log(STEPS[k - 1] / step):6.2f}" if k else ""
            results(f"{step:6.2f} {rms[k]:9.1e} {errors[k].max():9.1e} {order}")
    finest = square[PRINTED][-1] / square[CORRECTED][-1]
    results.record(
        printed=quantity(orders[PRINTED], digits=1, n=options.stacks),
        corrected=quantity(orders[CORRECTED], digits=1, n=options.stacks),
        times_smaller_rms=quantity(finest, "times", digits=1, form="s"),
        times_smaller_largest=quantity(
            largest[PRINTED] / largest[CORRECTED], "times", digits=1, form="s"
        ),
    )
    results.save()


if __name__ == "__main__":
    main()
