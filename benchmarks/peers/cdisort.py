"""CDISORT through its threaded batch binding (PyPI `nanodisort`): discrete ordinates, no refracting
surface.

Above about 100 streams its error grows again.
"""

import os
from collections.abc import Callable

import numpy as np

from benchmarks.peers import Work

PACKAGE = "nanodisort"
SETTINGS = (4, 6, 8, 12, 16, 20, 24, 32, 40, 48, 64, 80, 96)


def reflectance(work: Work, streams: int) -> Callable[[], np.ndarray]:
    """The solver set up once with all cores; a call solves all wavelengths."""
    import nanodisort  # pyright: ignore[reportMissingImports]

    wavelengths, layers = work.albedo.shape
    solver = nanodisort.BatchSolver(nthreads=os.cpu_count() or 1)
    solver.nstr, solver.nlyr, solver.nmom = streams, layers, streams
    solver.ntau, solver.numu, solver.nphi = 1, 1, 1
    solver.usrtau = solver.usrang = solver.lamber = solver.quiet = True
    solver.onlyfl = False
    solver.umu0, solver.phi0 = work.cos_incidence, 0.0
    solver.set_utau(np.zeros(1))
    solver.set_umu(np.array([work.cos_viewing]))
    solver.set_phi(np.zeros(1))
    solver.allocate(wavelengths)
    solver.set_dtauc(work.optical_thickness)
    solver.set_ssalb(work.albedo)
    moments = np.zeros((streams + 1, layers, wavelengths), order="F")
    moments[0] = 1.0
    solver.set_pmom(moments)
    solver.set_fbeam(np.full(wavelengths, np.pi))
    solver.set_albedo(np.full(wavelengths, work.ground))

    def run() -> np.ndarray:
        solver.solve()
        return np.asarray(solver.uu).reshape(wavelengths) / work.cos_incidence

    return run
