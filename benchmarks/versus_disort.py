"""Time at equal error beside CDISORT's threaded batch binding (PyPI `nanodisort`) on the same work.

    python -m benchmarks.versus_disort

41 wavelengths x 2 layers, one geometry, warm medians, programs run in turn. CDISORT has no refracting surface, so
it solves the stacks at n = 1; glazejax solves them at n = 1.5, surface and total reflection included, and at n = 1.
Error: the largest relative error over the wavelengths, against each program's own run with far more streams.
"""

import os
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.timing import environment, interleaved
from glazejax import stack_reflectance_factor

WAVELENGTHS = 41
COS_INCIDENCE, COS_VIEWING = 0.83, 0.61
GROUND = 0.7
STREAMS = (4, 6, 8, 12, 16, 20, 24, 32, 40, 48, 64, 96, 128)
TOLERANCES = tuple(10.0**-k for k in range(2, 11))


def stacks() -> tuple[np.ndarray, np.ndarray]:
    """Smooth spectra of two layers: albedo and optical thickness, (41, 2)."""
    x = np.linspace(0, 1, WAVELENGTHS)
    albedo = np.stack([0.55 + 0.4 * np.sin(5 * x), 0.9 - 0.5 * x**2], axis=1)
    thickness = np.stack([0.4 + 0.5 * x, 1.2 + np.cos(4 * x)], axis=1)
    return albedo, thickness


def disort(streams: int):
    """CDISORT's solver, set up once; the function it returns solves and gives the reflectance factor."""
    import nanodisort  # pyright: ignore[reportMissingImports]

    albedo, thickness = stacks()
    solver = nanodisort.BatchSolver(nthreads=os.cpu_count() or 1)
    solver.nstr, solver.nlyr, solver.nmom = streams, 2, streams
    solver.ntau, solver.numu, solver.nphi = 1, 1, 1
    solver.usrtau = solver.usrang = solver.lamber = solver.quiet = True
    solver.onlyfl = False
    solver.umu0, solver.phi0 = COS_INCIDENCE, 0.0
    solver.set_utau(np.zeros(1))
    solver.set_umu(np.array([COS_VIEWING]))
    solver.set_phi(np.zeros(1))
    solver.allocate(WAVELENGTHS)
    solver.set_dtauc(thickness)
    solver.set_ssalb(albedo)
    moments = np.zeros((streams + 1, 2, WAVELENGTHS))
    moments[0] = 1.0
    solver.set_pmom(moments)
    solver.set_fbeam(np.full(WAVELENGTHS, np.pi))
    solver.set_albedo(np.full(WAVELENGTHS, GROUND))

    def run() -> np.ndarray:
        solver.solve()
        return np.asarray(solver.uu).reshape(WAVELENGTHS) / COS_INCIDENCE

    return run


def ours(index: float, tolerance: float, gradient: bool = False):
    albedo, thickness = map(jnp.asarray, stacks())
    ground = jnp.full(WAVELENGTHS, GROUND)

    def spectrum(albedo, thickness, ground):
        return stack_reflectance_factor(
            albedo,
            thickness,
            ground,
            refractive_index=index,
            cos_incidence=COS_INCIDENCE,
            cos_viewing=COS_VIEWING,
            tolerance=tolerance,
        )

    if gradient:
        total = jax.value_and_grad(lambda *a: spectrum(*a).sum(), argnums=(0, 1, 2))
        program = jax.jit(total)
    else:
        program = jax.jit(spectrum)
    return lambda: program(albedo, thickness, ground)


def cheapest(make, settings, reference: np.ndarray, wanted: float):
    """First setting whose largest relative error is small enough, with that error."""
    for setting in settings:
        error = float(np.max(np.abs(np.asarray(make(setting)()) / reference - 1)))
        if error <= wanted:
            return setting, error
    raise RuntimeError(f"no setting reaches a relative error of {wanted:g}")


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    print(f"41 wavelengths x 2 layers, {os.cpu_count()} cores; {environment('nanodisort')}")
    disort_truth = disort(192)()
    print(f"at n = 1 both programs agree to {np.max(np.abs(ours(1.0, 1e-10)() / disort_truth - 1)):.0e}\n")
    print("relative error  program                            setting           error     ms   time/CDISORT")
    for wanted in (1e-4, 1e-8):
        streams, disort_error = cheapest(disort, STREAMS, disort_truth, wanted)
        rows = {"CDISORT, no surface": (f"{streams} streams", disort_error)}
        programs: dict[str, Callable[[], object]] = {"CDISORT, no surface": disort(streams)}
        for index in (1.0, 1.5):
            truth = np.asarray(ours(index, 1e-10)())
            tolerance, error = cheapest(lambda t, n=index: ours(n, t), TOLERANCES, truth, wanted)
            for gradient in (False, True):
                name = f"glazejax n = {index}, value" + (" + gradient" if gradient else "")
                rows[name] = (f"tolerance {tolerance:.0e}", error)
                programs[name] = ours(index, tolerance, gradient)
        seconds = interleaved(programs)
        for name, (setting, error) in rows.items():
            ratio = seconds[name] / seconds["CDISORT, no surface"]
            print(f"{wanted:<15.0e} {name:<34} {setting:<16} {error:.1e} {1e3 * seconds[name]:6.2f} {ratio:8.2f}")


if __name__ == "__main__":
    main()
