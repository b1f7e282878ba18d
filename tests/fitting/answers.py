"""Identifications that nothing was searched for."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from glazefit.identify.result import Identification
from glazefit.identify.search.pool import NOBODY
from glazefit.identify.search.task import Measured


def made_up(
    measured: Measured,
    paints: Sequence[str],
    sets: Sequence[tuple[dict[str, float], float]],
    fitted: Any,
    **changed: Any,
) -> Identification:
    """Of each spectrum the same sets of paints.

    Args:
        sets: of each the amount of each paint in m, and its probability.
        fitted: readings of each set.
        changed: other fields; all of usual size or nought without them.
    """
    shape = len(measured), len(sets)
    members, amounts = np.full((*shape, 3), NOBODY), np.zeros((*shape, 3))
    present = np.zeros((len(measured), len(paints)))
    for n, (thickness, probability) in enumerate(sets):
        rows = [paints.index(name) for name in thickness]
        members[:, n, : len(rows)] = rows
        amounts[:, n, : len(rows)] = [*thickness.values()]
        present[:, rows] += probability
    chances = np.tile([probability for _, probability in sets], (len(measured), 1))
    usual: dict[str, Any] = dict(
        coats=np.zeros_like(members),
        log_covariance=np.zeros((*shape, 3, 3)),
        none=1.0 - chances.sum(axis=1),
        misfit=np.ones(len(measured)),
        rejected=np.zeros(shape, bool),
        paint_probability=present,
        gloss=np.ones(shape),
        condition=np.zeros(shape, int),
        opaque=False,
    )
    return Identification(
        measured=measured,
        paints=tuple(paints),
        members=members,
        amounts=amounts,
        probability=chances,
        fitted=np.broadcast_to(fitted, (*shape, *measured.readings.shape[1:])),
        **usual | changed,
    )
