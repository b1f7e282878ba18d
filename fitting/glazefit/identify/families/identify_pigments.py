"""Films of anybody's paint: which families of pigments are in them, with the exemplars that look
most like them as evidence.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import ArrayLike

from glazejax import Pigment
from glazejax.geometry import resolve_instrument
from glazejax.progress import Progress, no_progress
from glazejax.radiative.common.chunks import pieces_of
from glazejax.spectra import Bands, describe_grid, validate_wavelengths

from ...film.films import Noise
from ...film.model.mixing import digest
from ...film.shared_bands import SEARCHED
from ..result import Identification
from ..search.options import IdentificationOptions
from ..search.pool import NOBODY
from ..search.searcher import check_spectra
from ..search.task import Measured
from .evidence import log_odds_of_elements, with_facts
from .expected import EXPECTED
from .misfit import UsualMisfit, misfit_of_right_answers
from .naming import name_sets
from .search import FamilySearch
from .set_up import search_families
from .templates import usual_coat

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
    if np.sum((grid >= first) & (grid <= last)) < 3:
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
        groups = [np.arange(len(batch))] if opaque else batch.by_grounds()
        identifications = []
        for rows in groups:
            below = None if opaque else batch.grounds[rows[0], 0]
            search = prepare_search(batch.wavelengths, pigments, options, below)
            identifications.append(_identification(search, batch.take(rows), options, opaque))
        order = np.argsort(np.concatenate(groups))
        yield Identification.join(identifications).take(order)


def usual_misfit(
    identification: Identification, pigments: Sequence[Pigment], options: IdentificationOptions
) -> UsualMisfit | None:
    """Usual misfit of films of right answers to readings like those of an identification.

    Args:
        identification: by `identify_families`; of several grounds the first one counts.
        pigments, options: of that.
    """
    ground = None if identification.opaque else identification.measured.grounds[0, 0]
    # What is known of one painting is not of the exemplars.
    alone = replace(options, elements=(), without_elements=(), painted=None)
    search = prepare_search(identification.measured.wavelengths, pigments, alone, ground)
    return misfit_of_right_answers(search)


_SEARCHES: dict[tuple[object, ...], FamilySearch] = {}
"""The last searches that were set up, since that takes some seconds."""
_MOST_SEARCHES = 4


def prepare_search(
    grid: Bands,
    pigments: Sequence[Pigment],
    options: IdentificationOptions,
    ground: Bands | None,
    progress: Progress = no_progress,
) -> FamilySearch:
    """The search among the families of some exemplars, set up or of those that were set up last.

    Args:
        grid: wavelengths of the readings, (bands,), nm, in steps of `SEARCHED` or more.
        pigments, options: of `identify_families`.
        ground: internal reflectance below the films, (bands,), or None for films that hide it.
        progress: called as it is set up.
    """
    instrument = resolve_instrument(options.instrument)
    prior = options.prior or EXPECTED
    varnish = options.varnish or "none"
    arrays = [
        values
        for paint in pigments
        for values in (paint.wavelengths, paint.absorption, paint.scattering)
    ]
    key = (
        tuple(grid.tolist()),
        tuple((paint.name, paint.family, paint.source) for paint in pigments),
        digest(*arrays),
        instrument,
        prior,
        min(options.max_paints, 2),
        varnish,
    )
    # How sure a search may be does not hang on the ground: it is learnt over the first one.
    similar = [search for (*settings, _), search in _SEARCHES.items() if tuple(settings) == key]
    key = (*key, None if ground is None else tuple(ground.tolist()))
    if key not in _SEARCHES:
        if len(_SEARCHES) >= _MOST_SEARCHES:
            _SEARCHES.pop(next(iter(_SEARCHES)))
        _SEARCHES[key] = search_families(
            grid,
            pigments,
            ground=ground,
            instrument=instrument,
            prior=prior,
            max_paints=min(options.max_paints, 2),
            varnish=varnish,
            sureness=similar[0].sureness if similar and ground is not None else None,
            progress=progress,
        )
    return with_facts(
        _SEARCHES[key],
        elements=options.elements,
        absent=options.without_elements,
        painted=options.painted,
    )


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
    templates = search.compared.templates
    grid = search.wavelengths[search.compared.bands]
    # The best sets of each spectrum as candidates, each by its best film.
    shape = best.shape
    template = odds.best[at]
    pair = templates.members[template]
    present = pair != NOBODY
    members = np.full((*shape, 3), NOBODY)
    members[..., :2] = pair
    # A film that hides its ground is of no thickness: shown as a usual coat.
    coat = templates.thickness[template]
    depth = usual_coat(search.exemplars) * np.where(np.isinf(coat), 1.0, coat)
    share = np.where(present[..., 1], odds.fraction[at], 1.0)
    amounts = np.zeros((*shape, 3))
    amounts[..., :2] = depth[..., None] * np.stack([share, 1.0 - share], axis=-1)
    # Half of the variance of the log odds of the fractions to each log amount.
    spread = odds.fraction_sd[at] / np.maximum(share * (1.0 - share), 1e-6)
    variance = np.where(present[..., 1], 0.5 * spread**2, 0.0)
    covariance = np.zeros((*shape, 3, 3))
    covariance[..., :2, :2] = variance[..., None, None] * np.eye(2)
    # Between the bands that are compared, and a little beyond them.
    near = (search.wavelengths >= grid[0] - _EDGE) & (search.wavelengths <= grid[-1] + _EDGE)
    between = [np.interp(search.wavelengths[near], grid, row) for row in np.eye(grid.size)]
    fitted = np.full((*shape, 1, readings.shape[1]), np.nan)
    fitted[:, :, 0, near] = search.films(template, readings) @ np.array(between)
    # Each paint's probability is the sum over the candidates that hold it.
    probability = odds.sets[at]
    paint_probability = np.zeros((len(measured), len(search.exemplars)))
    row, column, index = np.nonzero(present)
    np.add.at(paint_probability, (row, pair[row, column, index]), probability[row, column])
    return Identification(
        measured=measured,
        paints=tuple(paint.name for paint in search.exemplars),
        members=members,
        coats=np.zeros(members.shape, dtype=int),
        amounts=amounts,
        log_covariance=covariance,
        probability=probability,
        none=odds.none,
        misfit=-odds.evidence,
        # Other people's paint differs by eye from every exemplar; the evidence decides.
        rejected=np.broadcast_to(odds.unlike[:, None], shape).copy(),
        paint_probability=np.minimum(paint_probability, 1.0),
        gloss=np.broadcast_to(search.gloss(readings)[:, None], shape).copy(),
        fitted=fitted,
        condition=np.zeros(shape, dtype=int),
        opaque=opaque,
        family_sets=tuple(tuple(name_sets(search, chances)) for chances in odds.sets),
        paint_families=tuple(paint.family for paint in search.exemplars),
    )
