"""Other programs on the same work, one adapter a module, and the work itself.

Every adapter has a `PACKAGE` (its name on PyPI), `SETTINGS` from coarse to fine, and a function
``reflectance(work, setting)`` that sets the program up once and returns a function without
arguments: it solves the whole work and gives the reflectance factor pi L_out / E_in of each
wavelength. Peers are imported when set up, not when the module is.
"""

import importlib.util
import os
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float


class Work(NamedTuple):
    """A spectrum of stacks seen in one geometry."""

    albedo: Float[np.ndarray, "wavelengths layers"]  # top layer first
    optical_thickness: Float[np.ndarray, "wavelengths layers"]
    ground: float  # reflectance of the Lambertian ground
    cos_incidence: float  # in air, as is the next
    cos_viewing: float


def two_layers(wavelengths: int = 41) -> Work:
    """Smooth spectra of two layers over a light ground, away from any symmetry of the geometry."""
    x = np.linspace(0, 1, wavelengths)
    albedo = np.stack([0.55 + 0.4 * np.sin(5 * x), 0.9 - 0.5 * x**2], axis=1)
    thickness = np.stack([0.4 + 0.5 * x, 1.2 + np.cos(4 * x)], axis=1)
    return Work(albedo, thickness, ground=0.7, cos_incidence=0.83, cos_viewing=0.61)


def installed(module: str) -> bool:
    """Whether a module of that name can be imported."""
    return importlib.util.find_spec(module) is not None


class Streams(NamedTuple):
    """Setting of a program with threads of its own."""

    streams: int
    threads: int

    def __str__(self) -> str:
        return f"{self.streams} streams/{self.threads}"


def one_or_all_cores(*streams: int) -> tuple[Streams, ...]:
    """Each number of streams with one thread and with one a core: threads that wait for a busy core
    can cost more.
    """
    threads = sorted({1, os.cpu_count() or 1})
    return tuple(Streams(number, count) for number in streams for count in threads)


def without_blas_threads() -> Any:
    """Keep BLAS, which all peers call with small matrices, to one thread from now on; None if that
    cannot be done.

    On matrices of about 100 rows its threads cost the peers up to ten times the time. Call it when
    they are loaded.
    """
    if not installed("threadpoolctl"):
        return None
    from threadpoolctl import threadpool_limits  # pyright: ignore[reportMissingImports]

    return threadpool_limits(limits=1, user_api="blas")
