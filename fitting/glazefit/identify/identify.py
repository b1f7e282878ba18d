"""Identify the paints in a film: from its spectrum, over one ground or several, and a catalogue.

Sets of one, two and three paints compete, and with them the hypothesis that none of the catalogue's
paints explain the film; `search.screen` says which sets are looked at, `film.model.errors` what
counts as an error, and `search.fit` how a set's probability follows. Sets that are not looked at
count as impossible; the search keeps far more than ever come near the best.
"""

from collections.abc import Iterator, Sequence
from typing import Unpack

import numpy as np
from jaxtyping import ArrayLike

from glazejax import Hemispherical
from glazejax.geometry import resolve_instrument

from ..film.films import Films, Noise, card_readings, check_ground, ground_from_air
from ..film.model.mixing import Pigments, listed_pigments
from .families.expected import has_families
from .result import Identification
from .search.options import IdentificationKeywords, IdentificationOptions, check_keywords
from .search.searcher import Searcher


def identify_chunks(
    wavelengths: ArrayLike,
    spectra: ArrayLike,
    pigments: Pigments,
    options: IdentificationOptions,
    *,
    ground: ArrayLike | None,
    opaque: bool,
    names: Sequence[str] | None,
) -> Iterator[Identification]:
    """Identify as `identify` does, a few spectra at a time, so that progress can be shown and an
    interrupt loses little.

    Args and errors are those of `identify`.
    """
    check_ground(ground, opaque=opaque)
    paints = listed_pigments(pigments)
    # Weighing coats and families imports parts of scipy, and most searches need neither.
    if has_families(paints) and not options.own_films:
        from .coats.weigh_coats import coats_of_families
        from .families.identify_pigments import identify_families

        for identification in identify_families(
            wavelengths, spectra, paints, options, ground=ground, opaque=opaque, names=names
        ):
            if options.max_coats > 1:
                identification = coats_of_families(identification, options)
            yield identification
        return
    options.refuse_facts()
    searcher = Searcher.of(wavelengths, pigments, options, opaque=opaque)
    measured = searcher.measure(spectra, ground, names)
    for batch, pool, odds in searcher.search(measured):
        identification = Identification.of(
            batch,
            pool,
            odds,
            paints=searcher.paints,
            opaque=opaque,
            keep=options.keep,
            spread=searcher.spread,
        )
        if options.max_coats > 1:
            from .coats.weigh_coats import weigh_coats

            identification = weigh_coats(identification, paints, options, searcher.task, pool)
        yield identification


def identify(
    wavelengths: ArrayLike,
    spectra: ArrayLike,
    pigments: Pigments,
    *,
    ground: ArrayLike | None = None,
    opaque: bool = False,
    names: Sequence[str] | None = None,
    **options: Unpack[IdentificationKeywords],
) -> Identification:
    """Paints, fractions and thickness of films from their spectra, as ranked lists with
    probabilities.

    Args:
        wavelengths: (bands,), nm.
        spectra: reflectance as fractions, (bands,), (spectra, bands), or (spectra, grounds, bands)
            for one film over several grounds.
        pigments: the catalogue, a mapping as `glazejax.catalogue.load` gives it or a list, on any
            grids that cover the spectra's.
        ground: internal reflectance (that under paint) of the ground: a number, (bands,), or for
            several (grounds, bands), or one for each spectrum, (spectra, grounds, bands).
        opaque: the films hide their ground; their thickness is then unknown.
        names: of the spectra.
        options: the fields of `IdentificationOptions`: instrument, noise, discrepancy, prior,
            max_paints, max_coats, keep, thorough, own_films, elements, without_elements, painted,
            varnish.

    Pigments that have a family and a source, as ``catalogue.load("pigments")`` gives them, are
    searched by family: ``families(row)`` are the pigments in anybody's paint, with the most
    similar exemplars as candidates. ``own_films=True`` searches them as paints.

    Returns:
        `Identification`; ``ranked(row)`` lists the explanations of a spectrum, ``none[row]`` is the
        probability that no paints of the catalogue explain it.

    Raises:
        ValueError: shapes that do not match, values that are not reflectances, neither a ground nor
            `opaque`, an empty catalogue, repeated names.
    """
    check_keywords("identify", options, IdentificationKeywords)
    chunks = identify_chunks(
        wavelengths,
        spectra,
        pigments,
        IdentificationOptions(**options),
        ground=ground,
        opaque=opaque,
        names=names,
    )
    return Identification.join(list(chunks))


def identify_films(
    films: Films, pigments: Pigments, **options: Unpack[IdentificationKeywords]
) -> Identification:
    """Identify as `identify` does films over a black and a white card that were measured bare.

    Args:
        films: such as `read_films` reads; their bare cards say what is below the paint.
        pigments, options: see `identify`.

    Returns:
        `Identification`, a row for each film.

    Raises:
        ValueError: as `identify`, a film that was not read over both cards and does not hide them,
            a card that was not measured, or one that is not possible (see `ground_from_air`).
    """
    check_keywords("identify_films", options, IdentificationKeywords)
    lacking = (~films.seen | films.assumed).any(axis=1) & ~films.opaque
    if lacking.any():
        raise ValueError(
            f"film {films.names[lacking.argmax()]!r} lacks a reading over a card, or of a bare "
            "one: give all four as read_films reads them, or give identify its reading and ground"
        )
    seen_by = resolve_instrument(options.get("instrument"))
    if isinstance(seen_by.geometry, Hemispherical):
        measured = card_readings(films, seen_by, options.get("noise") or Noise())
        ground = np.moveaxis(measured.ground, -1, 1)
    else:
        ground = ground_from_air(films.bare_cards, seen_by)
    options["instrument"] = seen_by
    return identify(
        films.wavelengths, films.over_cards, pigments, ground=ground, names=films.names, **options
    )
