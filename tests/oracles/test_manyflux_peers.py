"""PythonicDISORT finds the same radiance at its own directions, where neither program
interpolates.
"""

import warnings

import numpy as np
import pytest

from glazejax.radiative.common.phase import henyey_greenstein
from glazejax.radiative.manyflux.reflectance import brdf_table

pytestmark = [pytest.mark.optimised, pytest.mark.slow]

ALBEDO = np.array([0.5, 0.5, 0.9, 0.9999, 0.99, 0.8])
THICKNESS = np.array([0.01, 1.0, 100.0, 1.0, 10.0, 0.1])
GROUND, INCIDENCE = 0.3, 0.6
AZIMUTH = np.array([0.0, 45.0, 90.0, 180.0])


def theirs(g: float, streams: int) -> tuple[np.ndarray, np.ndarray]:
    """Cosines of their upward directions and the reflectance factor, (stacks, directions,
    azimuths).
    """
    pydisort = pytest.importorskip("PythonicDISORT").pydisort
    moments = g ** np.arange(2 * streams)
    found, mu = [], np.zeros(0)
    peak: dict = {} if abs(g) < 0.7 else {"f_arr": moments[streams], "NT_cor": True}
    for q, depth in zip(ALBEDO, THICKNESS, strict=True):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mu, *_, radiance = pydisort(
                np.array([depth]),
                np.array([q]),
                streams,
                moments[None],
                INCIDENCE,
                np.pi,
                0.0,
                NLeg=streams,
                NFourier=streams,
                BDRF_Fourier_modes=[GROUND],
                **peak,
            )
        found.append(np.asarray(radiance(0.0, np.deg2rad(AZIMUTH)))[mu > 0])
    up = mu[mu > 0]
    return up, np.reshape(found, (len(ALBEDO), up.size, AZIMUTH.size)) / INCIDENCE


@pytest.mark.parametrize(
    ("g", "streams", "tolerance"),
    [
        (-0.5, 48, 1e-7),
        (0.0, 48, 1e-7),
        (0.5, 48, 1e-7),
        (0.9, 96, 1e-5),
    ],
)
def test_same_radiance(g, streams, tolerance):
    """Albedo .5 to .9999, thickness .01 to 100, all azimuths. What is left are their grazing
    directions.
    """
    mu, expected = theirs(g, streams)
    seen = mu > 0.15
    table = brdf_table(
        ALBEDO[:, None],
        THICKNESS[:, None],
        GROUND,
        phase=henyey_greenstein(g),
        refractive_index=1.0,
        cos_incidence=[INCIDENCE],
        cos_viewing=mu[seen],
        azimuth=AZIMUTH,
        tolerance=tolerance,
    )
    np.testing.assert_allclose(np.pi * table[:, :, 0], expected[:, seen], rtol=0, atol=1e-6)
