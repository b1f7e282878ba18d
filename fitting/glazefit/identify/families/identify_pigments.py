"""Films of anybody's paint: which families of pigments are in them, with the exemplars that look
most like them as evidence.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import ArrayLike

from glazejax import Pigment
from glazejax.radiative.common.chunks import pieces_of
from glazejax.spectra import describe_grid, lie_between, validate_wavelengths

from ...film.films import Noise
from ...film.shared_bands import SEARCHED
from ..result import Identification
from ..search.options import IdentificationOptions
from ..search.pool import NOBODY
from ..search.searcher import check_spectra
from ..search.task import Measured
from .evidence import log_odds_of_elements
from .naming import name_sets
from .search import FamilySearch
from .set_up import prepare_search

# Spectra that are answered together, so that progress can be shown.
_CHUNK = 256
# What is computed of a film is shown this far beyond the bands that its exemplars are known at, nm.
_EDGE = 30.0


def identify_families(
    wavelengths: ArrayLike,
    spectra: ArrayLike,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    *,
    ground: ArrayLike | None,
    opaque: bool,
    names: Sequence[str] | None,
) -> Iterator[Identification]:
    """Identifications by family, some spectra at a time.

    Args and errors are those of `glazefit.identify`; each film is read over one ground.
    """
    # A wrong symbol is said before a search is set up, which takes some seconds.
    log_odds_of_elements([], options.elements, options.without_elements)
    grid = validate_wavelengths(wavelengths)
    measured = check_spectra(grid, spectra, ground, names, options.noise or Noise())
    first = min(float(paint.wavelengths[0]) for paint in pigments)
    last = max(float(paint.wavelengths[-1]) for paint in pigments)
    if lie_between(grid, first, last).sum() < 3:
        raise ValueError(
            f"the spectra have {describe_grid(grid)} and the pigments are known from {first:g} to "
            f"{last:g} nm: no three bands lie there"
        )
    grounds = measured.readings.shape[1]
    if grounds != 1:
        raise ValueError(
            f"families of pigments are searched by one reading of a film, not {grounds}: give the "
            "reading over one ground, or own_films=True"
        )
    measured = measured.in_steps(SEARCHED)
    for some in pieces_of(np.arange(len(measured)), _CHUNK):
        batch = measured.take(some)
        # Films that hide their ground share one that is not seen.
        groups = batch.by_grounds()
        identifications = []
        for rows in groups:
            below = None if opaque else batch.grounds[rows[0], 0]
            search = prepare_search(batch.wavelengths, pigments, options, below)
            identifications.append(_identification(search, batch.take(rows), options, opaque))
        order = np.argsort(np.concatenate(groups))
        yield Identification.join(identifications).take(order)


def _identification(
    search: FamilySearch, measured: Measured, options: IdentificationOptions, opaque: bool
) -> Identification:
    """Odds of a search as an identification: a candidate is a set of families, shown by the
    exemplars that look most like the film.
    """
    readings = measured.readings[:, 0]
    odds = search.odds(readings)
    best = np.argsort(-odds.sets, axis=1, kind="stable")[:, : options.keep]
    at = np.arange(len(measured))[:, None], best
    templates = search.templates
    grid = search.grid
    # The best sets of each spectrum as candidates, each by its best film.
    shape = best.shape
    template = odds.best[at]
    members = np.insert(templates.members[template], 2, NOBODY, axis=-1)
    mixed = members[..., 1] != NOBODY
    # A film that hides its ground is of no thickness: shown as a usual coat.
    coat = templates.thickness[template]
    depth = search.usual_coat * np.where(np.isinf(coat), 1.0, coat)
    share = np.where(mixed, odds.fraction[at], 1.0)
    shares = np.stack([share, 1.0 - share, np.zeros(shape)], axis=-1)
    # Half of the variance of the log odds of the fractions to each log amount.
    spread = odds.fraction_sd[at] / np.maximum(share * (1.0 - share), 1e-6)
    variance = np.where(mixed, 0.5 * spread**2, 0.0)
    # Between the bands that are compared, and a little beyond them.
    near = lie_between(search.wavelengths, grid[0] - _EDGE, grid[-1] + _EDGE)
    between = [np.interp(search.wavelengths[near], grid, row) for row in np.eye(grid.size)]
    fitted = np.full((*shape, 1, readings.shape[1]), np.nan)
    fitted[:, :, 0, near] = search.films(template, readings) @ np.array(between)
    # Each paint's probability is the sum over the candidates that hold it.
    probability = odds.sets[at]
    present = members[..., None] == np.arange(len(search.exemplars))
    paint_probability = np.einsum("sc,scmp->sp", probability, present)
    return Identification(
        measured=measured,
        paints=tuple(paint.name for paint in search.exemplars),
        members=members,
        coats=np.zeros_like(members),
        amounts=depth[..., None] * shares,
        log_covariance=variance[..., None, None] * np.diag([1.0, 1.0, 0.0]),
        probability=probability,
        none=odds.none,
        misfit=-odds.evidence,
        # Other people's paint differs by eye from every exemplar; the evidence decides.
        rejected=np.broadcast_to(odds.unlike[:, None], shape),
        paint_probability=np.minimum(paint_probability, 1.0),
        gloss=np.broadcast_to(search.gloss(readings)[:, None], shape),
        fitted=fitted,
        condition=np.zeros(shape, dtype=int),
        opaque=opaque,
        family_sets=tuple(tuple(name_sets(search, chances)) for chances in odds.sets),
        paint_families=tuple(paint.family for paint in search.exemplars),
    )
