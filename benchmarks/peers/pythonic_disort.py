"""PythonicDISORT (PyPI): discrete ordinates in numpy, one stack a call, no refracting surface.

An albedo of one and a layer of zero thickness raise. It gives the field in its own directions; the
viewing direction is interpolated between them, with the package's own routine, and this decides its
accuracy.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.peers import Work

PACKAGE = "PythonicDISORT"
SETTINGS = (8, 12, 16, 32, 40, 64, 96)


def reflectance(work: Work, streams: int) -> Callable[[], np.ndarray]:
    """A call solves all wavelengths, one after the other, for the azimuth mode that isotropic
    scattering has.
    """
    from PythonicDISORT import pydisort  # pyright: ignore[reportMissingImports]
    from PythonicDISORT.subroutines import interpolate  # pyright: ignore[reportMissingImports]

    depth = np.cumsum(work.optical_thickness, axis=1)
    legendre = np.zeros((work.albedo.shape[1], streams))
    legendre[:, 0] = 1.0

    def one(depth: np.ndarray, albedo: np.ndarray) -> float:
        *_, field = pydisort(
            depth,
            albedo,
            streams,
            legendre,
            work.cos_incidence,
            np.pi,
            0.0,
            NLeg=1,
            NFourier=1,
            only_flux=True,
            BDRF_Fourier_modes=[work.ground],
            cache_asso_leg="mu0",
        )
        seen: Any = interpolate(field)
        return float(np.squeeze(seen(work.cos_viewing, 0.0)))

    return lambda: (
        np.array([one(*stack) for stack in zip(depth, work.albedo, strict=True)])
        / work.cos_incidence
    )
