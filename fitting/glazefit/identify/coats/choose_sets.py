"""Choice of the sets of paints that are weighed: those that are most probable in one coat, and
those that come nearest as one paint over another.

A mixture of two paints may be far from a film in which one lies over the other, so that all pairs
are tried as coats, too. For this the lower coat, over its ground, is taken as a Lambertian ground
of the upper one: then two tables of single coats give all pairs at all amounts.
"""

from collections import defaultdict
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ...film.model.errors import whitening
from ...film.model.response import over_ground
from ..result import Identification
from ..search.pool import NOBODY
from .arrangement import PaintNumbers
from .evidence import SPREAD, fixed_covariance
from .readings import LOG_AMOUNTS, CoatedFilms


def best_sets(
    identification: Identification, row: int, max_coats: int, near: Sequence[Sequence[int]] = ()
) -> list[PaintNumbers]:
    """The most probable sets of two paints of a spectrum, however they lie; of three where three
    coats are tried.

    Args:
        identification: in one coat.
        row: of the spectrum.
        max_coats: most coats; no more than paints of a set.
        near: pairs that come nearest as coats, which take part with the most probable one: a film
            of two coats may look like no mixture of its paints.
    """
    likely = np.argsort(-identification.paint_probability[row], kind="stable")
    out = []
    for size in (2, 3)[: max_coats - 1]:
        chances: defaultdict[PaintNumbers, float] = defaultdict(float)
        candidates = zip(identification.members[row], identification.probability[row], strict=True)
        for candidate, chance in candidates:
            paint_set = tuple(sorted(candidate[candidate != NOBODY].tolist()))
            if len(paint_set) == size and chance > 0:
                chances[paint_set] += float(chance)
        if not chances and len(likely) >= size:
            # None was kept: the paints that are most probable, whatever accompanies them.
            chances[tuple(sorted(likely[:size].tolist()))] = 1.0
        # Two pairs, or one beside those that are near, and one set of three, of those with a
        # twentieth of all of their size.
        best = sorted(chances, key=lambda paint_set: -chances[paint_set])
        best = best[: 2 if size == 2 and not near else 1]
        least = 0.05 * sum(chances.values())
        out += [paint_set for paint_set in best if chances[paint_set] >= least]
        if size == 2:
            out += map(tuple, near)
    return list(dict.fromkeys(out))


def nearest_pairs(
    bodies: Float[np.ndarray, "spectra grounds bands"],
    films: CoatedFilms,
    log_prior: Float[np.ndarray, "paints"],
) -> Int[np.ndarray, "spectra pairs 2"]:
    """The two pairs of paints that come nearest to films over one ground or several as one over the
    other, in either order; the nearest first. Of two paints there is one pair.

    Args:
        bodies: readings without the outer surface's part.
        films: of all paints, over the grounds.
        log_prior: of each paint, up to a constant.
    """
    paints = films.coefficients.shape[1]
    grounds = films.grounds
    # Some 1500 single coats in a table, of at most 15 amounts of each paint.
    logs = np.linspace(*LOG_AMOUNTS, int(np.clip(1500 // paints, 2, 15)))
    depths = films.coefficients[:, :, None, None] * np.exp(logs)[:, None, None]
    numbers = [np.asarray(number) for number in films.response.numbers(*depths)]
    covariance = fixed_covariance(films.wavelengths, len(grounds))
    white = whitening(covariance).basis.astype(np.float32)
    target = (bodies.reshape(len(bodies), -1) @ white.T).astype(np.float32)

    # Lower coats as grounds of the upper ones.
    lower = over_ground(*numbers, ground=grounds)
    below = np.clip(np.asarray(films.response.internal(jnp.asarray(lower))), 0.0, 1.0)
    rare = (logs / SPREAD) ** 2
    misfit = np.full((len(bodies), paints, paints), np.inf)
    for upper in range(paints):
        over = over_ground(*(number[upper] for number in numbers), ground=below[:, :, None])
        whitened = over.reshape(-1, len(white)).astype(np.float32) @ white.T
        off = np.sum(whitened**2, axis=-1) - 2.0 * target @ whitened.T
        off = off.reshape(len(bodies), paints, logs.size, logs.size) + rare[:, None] + rare
        misfit[:, upper] = off.min(axis=(2, 3))

    # The better of both orders.
    first, second = np.triu_indices(paints, 1)
    either = np.minimum(misfit[:, first, second], misfit[:, second, first])
    either -= 2.0 * (log_prior[first] + log_prior[second])
    best = np.argsort(either, axis=1, kind="stable")[:, :2]
    return np.stack([first[best], second[best]], axis=-1)
