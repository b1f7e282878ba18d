"""sasktran2 (PyPI): discrete ordinates with analytic derivatives, no refracting surface.

Isotropic scattering needs one azimuth mode. sasktran2 solves all of them unless it is asked for fewer, so
both are offered:
`modes=1` is its best, `modes=0` its default. A layer of zero thickness ends the process;
the derivative by an albedo of zero comes out as zero.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from benchmarks.peers import Streams, Work, one_or_all_cores

PACKAGE = "sasktran2"
SETTINGS = one_or_all_cores(4, 8, 12, 16, 24, 32, 40, 64)


class Gradient(NamedTuple):
    """Derivatives of each wavelength's reflectance factor."""

    albedo: np.ndarray  # (wavelengths, layers)
    optical_thickness: np.ndarray  # (wavelengths, layers)
    ground: np.ndarray  # (wavelengths,)


def _set_up(work: Work, setting: Streams, derivatives: bool, modes: int) -> Callable[[], Any]:
    import sasktran2 as sk  # pyright: ignore[reportMissingImports]

    wavelengths, layers = work.albedo.shape
    config = sk.Config()
    config.num_threads = setting.threads
    config.num_streams = config.num_singlescatter_moments = setting.streams
    config.multiple_scatter_source = sk.MultipleScatterSource.DiscreteOrdinates
    config.single_scatter_source = sk.SingleScatterSource.DiscreteOrdinates
    config.num_forced_azimuth = modes
    # Layers one metre thick; each takes the properties of the grid point at its lower end.
    geometry = sk.Geometry1D(
        work.cos_incidence,
        0.0,
        6371000.0,
        np.arange(layers + 1.0),
        sk.InterpolationMethod.LowerInterpolation,
        sk.GeometryType.PlaneParallel,
    )
    view = sk.ViewingGeometry()
    view.add_ray(sk.GroundViewingSolar(work.cos_incidence, 0.0, work.cos_viewing, 10.0 * layers))
    engine = sk.Engine(config, geometry, view)
    atmosphere = sk.Atmosphere(
        geometry,
        config,
        numwavel=wavelengths,
        calculate_derivatives=derivatives,
        legendre_derivative=False,
    )
    upwards = slice(None, None, -1)
    atmosphere.storage.total_extinction[:layers] = work.optical_thickness.T[upwards]
    atmosphere.storage.ssa[:layers] = work.albedo.T[upwards]
    # The uppermost grid point belongs to no layer but must hold valid numbers.
    atmosphere.storage.total_extinction[layers] = work.optical_thickness[:, 0]
    atmosphere.storage.ssa[layers] = work.albedo[:, 0]
    atmosphere.storage.leg_coeff[:] = 0.0
    atmosphere.storage.leg_coeff[0] = 1.0
    atmosphere.surface.albedo[:] = work.ground
    return lambda: engine.calculate_radiance(atmosphere)


def reflectance(work: Work, setting: Streams, modes: int = 1) -> Callable[[], np.ndarray]:
    """Engine and atmosphere set up once, threads as the setting says; a call solves all
    wavelengths.
    """
    solve = _set_up(work, setting, False, modes)
    return lambda: _factor(solve().radiance, work)


def reflectance_and_gradient(
    work: Work, setting: Streams, modes: int = 1
) -> Callable[[], tuple[np.ndarray, Gradient]]:
    """The same with its analytic derivatives by albedo, optical thickness and ground, wavelength by
    wavelength.
    """
    solve = _set_up(work, setting, True, modes)
    layers = work.albedo.shape[1]

    def run() -> tuple[np.ndarray, Gradient]:
        found = solve()
        by_layer = (
            np.asarray(found[name])[:layers][::-1].reshape(layers, -1).T
            for name in ("wf_ssa", "wf_extinction")
        )
        albedo, thickness = (np.pi / work.cos_incidence * slope for slope in by_layer)
        return _factor(found.radiance, work), Gradient(
            albedo, thickness, _factor(found["wf_albedo"], work)
        )

    return run


def _factor(radiance: Any, work: Work) -> np.ndarray:
    """Reflectance factor from radiance under a beam of unit flux."""
    return np.pi / work.cos_incidence * np.asarray(radiance).reshape(-1)
