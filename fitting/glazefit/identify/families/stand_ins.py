"""Coefficients of exemplars at bands at which they were not read.

What is known of a paint in the visible alone is compared with a reading of the near infrared, too:
there its family stands in for it. Compared on fewer bands it would win against a paint that is
known at all of them and fits as well.
"""

import numpy as np

from .templates import Coefficients, PerExemplar


def with_stand_ins(k_and_s: Coefficients, family_of: PerExemplar) -> Coefficients:
    """k and s of exemplars, continued beyond the bands at which they are known: log k/s and log s
    go on as they do, in the median, for the others of the family that are known there, or for all
    exemplars where none of the family is.

    Args:
        k_and_s: 1/m, NaN where one is not known; each is known from one band to another.
        family_of: number of each exemplar's family.

    Returns:
        The same shape; NaN for exemplars that are known at no band, and where nobody is known.
    """
    known = np.isfinite(k_and_s[0])
    absorption, scattering = np.log(k_and_s)
    courses = np.stack([absorption - scattering, scattering])
    out = courses.copy()
    for row in np.flatnonzero(known.any(axis=1) & ~known.all(axis=1)):
        first, last = np.flatnonzero(known[row])[[0, -1]]
        for end, beyond in ((first, np.arange(first)), (last, np.arange(last + 1, known.shape[1]))):
            # Relatives that are known there, or all where none of these is; what nobody knows stays
            # unknown.
            there = known[:, np.append(beyond, end)].all(axis=1)
            relatives = there & (family_of == family_of[row])
            models = relatives if relatives.any() else there
            if not models.any():
                continue
            # From the last known band on, as much lower or higher as theirs are.
            change = courses[:, models][..., beyond] - courses[:, models, end, None]
            out[:, row, beyond] = courses[:, row, end, None] + np.median(change, axis=1)
    ratio, scattering = out
    return np.exp(np.stack([ratio + scattering, scattering]))
