"""Which paints are in a film: from its spectrum, over one ground or several, and a catalogue.

Sets of one, two and three paints compete, and with them the hypothesis that none of the catalogue's
paints explain the film; `search.screen` says which sets are looked at, `film.model.errors` what
counts as an error, and `search.fit` how a set's probability follows. Sets that are not looked at
count as impossible; the search keeps far more than ever come near the best.
"""

from collections.abc import Iterator, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float

from glazejax import Hemispherical
from glazejax.former_names import accept_former_grounds, accept_former_keywords
from glazejax.geometry import Geometry, resolve_instrument

from ..film.films import Films, Instrument, Noise, cards
from ..film.model.errors import ModelError, Prior
from ..film.model.mixing import Pigments
from ..film.model.response import film_response
from .result import Identification
from .search.searcher import IdentificationOptions, Searcher


def identify_chunks(
    wavelengths: ArrayLike,
    spectra: ArrayLike,
    pigments: Pigments,
    options: IdentificationOptions | None = None,
    *,
    ground: ArrayLike | None = None,
    opaque: bool = False,
    names: Sequence[str] | None = None,
) -> Iterator[Identification]:
    """As `identify`, a few spectra at a time, so that progress can be shown and an interrupt loses
    little.

    Args and errors are those of `identify`.
    """
    options = options or IdentificationOptions()
    _check_order(wavelengths, spectra)
    if (ground is None) != opaque:
        raise ValueError(
            "opaque films show no ground: leave out ground, or leave out opaque"
            if opaque
            else "what is under the paint? Give ground, its internal reflectance such as 0.9, or "
            "opaque=True for films that hide it"
        )
    searcher = Searcher.of(wavelengths, pigments, options, opaque=opaque)
    measured = searcher.check(spectra, ground, names)
    for batch, pool, odds in searcher.search(measured):
        yield Identification.of(
            batch, pool, odds, paints=searcher.paints, opaque=opaque, keep=options.keep
        )


def _check_order(wavelengths: ArrayLike, spectra: ArrayLike) -> None:
    """Refuse spectra before wavelengths, as was the order before version 0.2."""
    first = np.asarray(wavelengths, dtype=np.float64)
    second = np.asarray(spectra, dtype=np.float64)
    if first.size and second.ndim == 1 and second.size and first.max() < 10.0 < second.min():
        raise ValueError(
            "wavelengths come first, in nm, then spectra: the order of these two arguments has "
            "changed, and what was given first looks like reflectances"
        )


@accept_former_grounds
@accept_former_keywords(geometry="instrument", layers="max_coats")
def identify(
    wavelengths: ArrayLike,
    spectra: ArrayLike,
    pigments: Pigments,
    *,
    ground: ArrayLike | None = None,
    opaque: bool = False,
    instrument: Instrument | Geometry | str | None = None,
    noise: Noise | None = None,
    discrepancy: ModelError | None = None,
    prior: Prior | None = None,
    max_paints: int = 3,
    max_coats: int = 1,
    keep: int = 20,
    thorough: bool = False,
    names: Sequence[str] | None = None,
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
        instrument: a `glazejax.Instrument`, a geometry, or words such as "45:0" for one without a
            sphere; by default d:8 with the specular part, index 1.5.
        noise: of a reading; where the spectra themselves are rougher, their roughness counts.
        discrepancy: of the model; by default `film.model.errors.BETWEEN_FILMS`.
        prior: what is expected beforehand.
        max_paints: largest set, 1 to 3.
        max_coats: 2 tries the best sets as two coats too, in both orders.
        keep: candidates kept for each spectrum.
        thorough: fit every pair, and give every set errors of its own: some four times as long for
            the same first answer in most cases.
        names: of the spectra.

    Returns:
        `Identification`; ``ranked(row)`` lists the explanations of a spectrum, ``none[row]`` is the
        probability that no paints of the catalogue explain it.

    Raises:
        ValueError: shapes that do not match, values that are not reflectances, neither a ground nor
            `opaque`, an empty catalogue, repeated names.
    """
    options = IdentificationOptions(
        instrument=instrument,
        noise=noise,
        discrepancy=discrepancy,
        prior=prior,
        max_paints=max_paints,
        max_coats=max_coats,
        keep=keep,
        thorough=thorough,
    )
    parts = identify_chunks(
        wavelengths, spectra, pigments, options, ground=ground, opaque=opaque, names=names
    )
    return Identification.join(list(parts))


@accept_former_keywords(geometry="instrument", layers="max_coats")
def identify_films(
    films: Films,
    pigments: Pigments,
    *,
    instrument: Instrument | Geometry | str | None = None,
    noise: Noise | None = None,
    discrepancy: ModelError | None = None,
    prior: Prior | None = None,
    max_paints: int = 3,
    max_coats: int = 1,
    keep: int = 20,
    thorough: bool = False,
) -> Identification:
    """As `identify`, for films over a black and a white card that were measured bare.

    Args:
        films: such as `read_films` reads; their bare cards say what is below the paint.
        pigments, instrument, noise, discrepancy, prior: see `identify`.
        max_paints, max_coats, keep, thorough: see `identify`.

    Returns:
        `Identification`, a row for each film.

    Raises:
        ValueError: as `identify`, or cards that are not possible (see `ground_from_air`).
    """
    seen_by = resolve_instrument(instrument)
    if isinstance(seen_by.geometry, Hemispherical):
        black, white, _, _ = cards(films, seen_by, noise or Noise())
    else:
        bare = np.stack([films.bare_black, films.bare_white])
        black, white = ground_from_air(bare, seen_by)
    return identify(
        films.wavelengths,
        np.stack([films.over_black, films.over_white], axis=1),
        pigments,
        ground=np.stack([black, white], axis=1),
        instrument=seen_by,
        noise=noise,
        discrepancy=discrepancy,
        prior=prior,
        max_paints=max_paints,
        max_coats=max_coats,
        keep=keep,
        thorough=thorough,
        names=films.names,
    )


@accept_former_keywords(geometry="instrument")
def ground_from_air(
    bare: Float[np.ndarray, "*shape"],
    instrument: Instrument | Geometry | str | None = None,
    refractive_index: float = 1.5,
) -> Float[np.ndarray, "*shape"]:
    """Internal reflectance of grounds from what they read bare, with the same instrument.

    Args:
        bare: reflectance as read, as fractions, (...).
        instrument: it, see `glazejax.geometry.resolve_instrument`; by default d:8 with the specular
            part.
        refractive_index: of the paint that lies on them later, where `instrument` is no whole
            `glazejax.Instrument`, which has its own.

    Returns:
        Reflectance as seen from inside the paint, (...).

    Raises:
        ValueError: a reading below the surface's reflection or above that of a perfect diffuser, by
            more than .01.

    Example:
        >>> ground_from_air(np.array([0.05, 0.84])).round(2).tolist()
        [0.03, 0.93]
    """
    seen_by = resolve_instrument(instrument, refractive_index)
    within = np.asarray(bare, dtype=np.float64) - seen_by.seen_surface
    response = film_response(seen_by.geometry, seen_by.refractive_index)
    inside = np.asarray(response.internal(jnp.asarray(within)))
    for wrong, words in (
        (within < -0.01, "less than its surface alone"),
        (inside > 1.01, "more than white can"),
    ):
        if wrong.any():
            value = np.asarray(bare)[wrong].flat[0]
            raise ValueError(
                f"the bare ground reads {value:.4f} ({words}); is it seen with another instrument?"
            )
    return np.clip(inside, 0.0, 1.0)
