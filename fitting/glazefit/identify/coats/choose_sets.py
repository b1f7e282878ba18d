"""Choice of the sets of paints that are weighed: those that are most probable in one coat, and
those that come nearest as one paint over another.

A mixture of two paints may be far from a film in which one lies over the other, so that all pairs
are tried as coats, too. For this the lower coat, over its ground, is taken as a Lambertian ground
of the upper one: then two tables of single coats give all pairs at all amounts.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from glazejax.spectra import Bands

from ...film.model.errors import whitening
from ...film.model.response import over_ground
from ..result import Identification
from ..search.pool import NOBODY
from .arrangement import PaintNumbers
from .evidence import SPREAD, fixed_covariance
from .readings import LOG_AMOUNTS, CoatedFilms


def best_sets(identification: Identification, row: int, max_coats: int) -> list[PaintNumbers]:
    """The most probable sets of two paints of a spectrum, however they lie; of three where three
    coats are tried.
    """
    chances: dict[PaintNumbers, float] = {}
    candidates = identification.members[row]
    for candidate, chance in zip(candidates, identification.probability[row], strict=True):
        paint_set = tuple(sorted(candidate[candidate != NOBODY].tolist()))
        if len(paint_set) > 1 and chance > 0:
            chances[paint_set] = chances.get(paint_set, 0.0) + float(chance)
    likely = np.argsort(-identification.paint_probability[row], kind="stable")
    out = []
    for size in (2, 3)[: max_coats - 1]:
        of_size = {
            paint_set: chance for paint_set, chance in chances.items() if len(paint_set) == size
        }
        if not of_size and len(likely) >= size:
            # None was kept: the paints that are most probable, whatever accompanies them.
            of_size = {tuple(sorted(likely[:size].tolist())): 1.0}
        total = sum(of_size.values())
        best = sorted(of_size, key=lambda paint_set: -of_size[paint_set])
        # Two pairs, or one set of three, of those with a twentieth of all of their size.
        most = 2 if size == 2 else 1
        out += [paint_set for paint_set in best[:most] if of_size[paint_set] >= 0.05 * total]
    return out


def nearest_pairs(
    bodies: Float[np.ndarray, "spectra grounds bands"],
    films: CoatedFilms,
    wavelengths: Bands,
    log_prior: Float[np.ndarray, "paints"],
) -> Int[np.ndarray, "spectra pairs 2"]:
    """The two pairs of paints that come nearest to films over one ground or several as one over the
    other, in either order; the nearest first. Of two paints there is one pair.

    Args:
        bodies: readings without the outer surface's part.
        films: of all paints, over the grounds.
        wavelengths: of the bands, nm.
        log_prior: of each paint, up to a constant.
    """
    paints = films.coefficients.shape[1]
    grounds = films.grounds
    # Some 1500 single coats in a table, of at most 15 amounts of each paint.
    logs = np.linspace(*LOG_AMOUNTS, int(np.clip(1500 // paints, 2, 15)))
    amounts = np.exp(logs)[:, None]
    depths = (films.coefficients[:, :, None] * amounts).reshape(2, -1, wavelengths.size)
    numbers = [np.asarray(a)[:, None] for a in films.response.numbers(*depths)]
    white = whitening(fixed_covariance(wavelengths, len(grounds))).basis.astype(np.float32)
    target = (bodies.reshape(len(bodies), -1) @ white.T).astype(np.float32)

    # Lower coats as grounds of the upper ones.
    lower = over_ground(*numbers, ground=grounds)
    below = np.clip(np.asarray(films.response.internal(jnp.asarray(lower))), 0.0, 1.0)
    rare = (logs / SPREAD) ** 2
    misfit = np.full((len(bodies), paints, paints), np.inf)
    for upper in range(paints):
        rows = slice(upper * logs.size, (upper + 1) * logs.size)
        over = over_ground(*(number[rows] for number in numbers), ground=below[:, None])
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
