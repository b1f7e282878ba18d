"""Share of the outer surface's reflection that a reading contains.

A smooth film measured with the specular part included adds R_s = 4 % to what comes from the paint.
Matte paint can read less than that: part of the surface's reflection is then lost to the
instrument. One number a film, the gloss g, stands for what is left: R = g R_s + R_body.

Two readings and two unknowns a band leave g open, except that no reading may be less than g R_s. So
g is 1 unless a reading lies below R_s by more than noise explains, and then the largest value that
the darkest bands allow; there the paint itself is taken to be black.
"""

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view

from glazejax.spectra import describe_grid

from .films import Films, Instrument, Noise

GLOSS_SD = 0.01
"""Standard deviation of the log of a gloss that was measured."""


def estimate_gloss(
    films: Films, instrument: Instrument, noise: Noise
) -> Float[np.ndarray, "films"]:
    """Gloss of each film, (films,), in (0, 1]; 1 where the readings do not demand less, or exclude
    the surface.
    """
    if instrument.seen_surface == 0:
        return np.ones(len(films))
    lowest = np.minimum(films.over_black, films.over_white)
    # The mean of a few bands, so that one noisy reading does not decide.
    width = min(3, lowest.shape[1])
    means = sliding_window_view(lowest, width, axis=1).mean(axis=-1).min(axis=1)
    darkest = lowest.min(axis=1)
    short = instrument.seen_surface - darkest > 3.0 * noise.sd(darkest)
    return np.where(short, np.clip(means / instrument.seen_surface, 1e-3, 1.0), 1.0)


def measure_gloss(films: Films, excluded: Films, instrument: Instrument) -> dict[str, float]:
    """Gloss of films that were read with the specular part and without it: their mean difference
    over R_s.

    Args:
        films: with the specular part.
        excluded: without it; films that are in both, by name, are compared.
        instrument: of `films`.

    Raises:
        ValueError: an instrument that does not see the specular part, other wavelengths, no film in
            common, or a film whose two readings differ by no more than a hundredth of R_s or by
            more than half as much again as R_s.
    """
    surface = instrument.seen_surface
    if surface == 0:
        raise ValueError(
            "the films' own geometry leaves the specular part out; read them with it too (d:8)"
        )
    if not np.array_equal(films.wavelengths, excluded.wavelengths):
        raise ValueError(
            f"readings without the specular part are at {describe_grid(excluded.wavelengths)}, "
            f"those with it at {describe_grid(films.wavelengths)}: export both on one grid"
        )
    shares = {}
    readings, excluded_readings = films.over_cards, excluded.over_cards
    for row, name in enumerate(films.names):
        if name not in excluded.names:
            continue
        excluded_row = excluded.names.index(name)
        measured = films.seen[row] & excluded.seen[excluded_row]
        off = (readings[row] - excluded_readings[excluded_row])[measured]
        share = float(np.mean(off)) / surface if off.size else np.nan
        if not 0.01 < share < 1.5:
            raise ValueError(
                f"film {name!r} reads {share * surface:+.4f} more with the specular part than "
                f"without it; a smooth surface adds {surface:.4f}: are the files swapped?"
            )
        shares[name] = share
    if not shares:
        raise ValueError(
            f"no film was read both ways: with the specular part {', '.join(films.names[:5])}; "
            f"without it {', '.join(excluded.names[:5])}"
        )
    return shares
