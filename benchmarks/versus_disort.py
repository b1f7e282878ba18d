"""Time at equal error beside CDISORT's threaded batch binding (PyPI `nanodisort`) on the same work.

    python -m benchmarks.versus_disort [--out FOLDER]

41 wavelengths x 2 layers, one geometry, warm medians, programs run in turn. CDISORT has no refracting surface, so
it solves the stacks at n = 1; glazejax solves them at n = 1.5, surface and total reflection included, and at n = 1.
Error: the largest relative error over the wavelengths, against a converged run of glazejax. `benchmarks.frontier`
does the same for more programs and every error.
"""

import argparse
from collections.abc import Callable

import jax
import numpy as np

from benchmarks.peers import cdisort, ours, two_layers
from benchmarks.results import Results, add_option
from benchmarks.timing import environment, interleaved


def cheapest(make, settings, reference: np.ndarray, wanted: float):
    """First setting whose largest relative error is small enough, with that error."""
    for setting in settings:
        error = float(np.max(np.abs(np.asarray(make(setting)()) / reference - 1)))
        if error <= wanted:
            return setting, error
    raise RuntimeError(f"no setting reaches a relative error of {wanted:g}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_option(parser)
    say = Results("versus_disort", parser.parse_args().out)
    jax.config.update("jax_enable_x64", True)
    work = two_layers()
    truth = {index: ours.converged(work, index) for index in (1.0, 1.5)}
    finest = cdisort.reflectance(work, cdisort.SETTINGS[-1])()
    say(f"41 wavelengths x 2 layers; {environment(cdisort.PACKAGE)}")
    say(f"at n = 1 both programs agree to {np.max(np.abs(finest / truth[1.0] - 1)):.0e}\n")
    say("relative error  program                            setting           error     ms   time/CDISORT")
    for wanted in (1e-4, 1e-8):
        streams, disort_error = cheapest(lambda s: cdisort.reflectance(work, s), cdisort.SETTINGS, truth[1.0], wanted)
        rows = {"CDISORT, no surface": (f"{streams} streams", disort_error)}
        programs: dict[str, Callable[[], object]] = {"CDISORT, no surface": cdisort.reflectance(work, streams)}
        for index in (1.0, 1.5):
            tolerance, error = cheapest(
                lambda t, n=index: ours.reflectance(work, n, t), ours.TOLERANCES, truth[index], wanted
            )
            for gradient in (False, True):
                name = f"glazejax n = {index}, value" + (" + gradient" if gradient else "")
                rows[name] = (f"tolerance {tolerance:.0e}", error)
                programs[name] = ours.reflectance(work, index, tolerance, gradient=gradient)
        seconds = interleaved(programs)
        for name, (setting, error) in rows.items():
            ratio = seconds[name] / seconds["CDISORT, no surface"]
            say(f"{wanted:<15.0e} {name:<34} {setting:<16} {error:.1e} {1e3 * seconds[name]:6.2f} {ratio:8.2f}")
    say.save()


if __name__ == "__main__":
    main()
