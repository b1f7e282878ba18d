"""Scattering where a film is too opaque to tell k from s: continued from the bands where it is known."""

import numpy as np
from jaxtyping import Bool, Float

# A factor of e either way: holds where the data are silent, yields where they still say something.
PRIOR_SD = 1.0


def neighbours_scattering(
    wavelengths: Float[np.ndarray, "bands"],
    log_scattering: Float[np.ndarray, "films bands"],
    known: Bool[np.ndarray, "films bands"],
    least: Float[np.ndarray, "films bands"],
) -> tuple[Float[np.ndarray, "films bands"], Float[np.ndarray, "films bands"]]:
    """Mean and weight of a prior on log(s d): nothing at known bands, continuity with them elsewhere.

    Between known bands log(s d) is interpolated, beyond them continued as a constant, and never less than the data
    allow. A film without any known band gets one value, the least that all its bands allow: as thin as it can be.

    Args:
        wavelengths: (bands,), nm.
        log_scattering: log(s d) as fitted, (films, bands).
        known: whether k and s are both determined, (films, bands).
        least: smallest log(s d) that the data allow, (films, bands).
    """
    mean = np.zeros_like(log_scattering)
    for row in range(len(mean)):
        held = known[row]
        if held.any():
            line = np.interp(wavelengths, wavelengths[held], log_scattering[row, held])
            mean[row] = np.maximum(line, least[row])
        else:
            mean[row] = least[row].max()
    return mean, np.where(known, 0.0, 1.0 / PRIOR_SD)
