"""How much of the outer surface's reflection a reading contains.

A smooth film measured with the specular part included adds R_s = 4 % to what comes from the paint. Matte paint can
read less than that: part of the surface's reflection is then lost to the instrument. One number a film, the gloss g,
stands for what is left: R = g R_s + R_body.

Two readings and two unknowns a band leave g open, except that no reading may be less than g R_s. So g is 1 unless a
reading lies below R_s by more than noise explains, and then the largest value that the darkest bands allow; there the
paint itself is taken to be black.
"""

import numpy as np
from jaxtyping import Float

from .films import Films, Instrument, Noise

_NOISES = 3.0
_BANDS = 3


def estimate_gloss(films: Films, instrument: Instrument, noise: Noise) -> Float[np.ndarray, "films"]:
    """Gloss of each film, (films,), in (0, 1]; 1 where the readings do not demand less, or exclude the surface."""
    if instrument.seen_surface == 0:
        return np.ones(len(films))
    lowest = np.minimum(films.over_black, films.over_white)
    # The mean of a few bands, so that one noisy reading does not decide.
    width = min(_BANDS, lowest.shape[1])
    means = np.lib.stride_tricks.sliding_window_view(lowest, width, axis=1).mean(axis=-1).min(axis=1)
    short = instrument.seen_surface - lowest.min(axis=1) > _NOISES * noise.sd(lowest.min(axis=1))
    return np.where(short, np.clip(means / instrument.seen_surface, 1e-3, 1.0), 1.0)
