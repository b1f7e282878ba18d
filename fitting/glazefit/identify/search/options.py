"""Options of an identification, which `identify`, its siblings and a map share."""

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Integral
from typing import Any, TypedDict

from ...film.films import InstrumentLike, Noise
from ...film.model.errors import ModelError, Prior
from ...film.model.varnish import AMOUNTS

VARNISHES = ("none", *AMOUNTS, "unknown")
"""What may be said of a varnish."""


class SearchKeywords(TypedDict, total=False):
    """Fields of `IdentificationOptions` that a map of paints takes too."""

    instrument: InstrumentLike | None
    noise: Noise | None
    discrepancy: ModelError | None
    prior: Prior | None
    max_paints: int
    elements: tuple[str, ...]
    without_elements: tuple[str, ...]
    painted: int | None


class IdentificationKeywords(SearchKeywords, total=False):
    """The fields of `IdentificationOptions`, as arguments of the functions that identify."""

    max_coats: int
    keep: int
    thorough: bool
    own_films: bool
    varnish: str | None


@dataclass(frozen=True, kw_only=True)
class IdentificationOptions:
    """Options of an identification.

    Attributes:
        instrument: a `glazejax.Instrument`, a geometry, or words such as "45:0" for one without a
            sphere; by default d:8 with the specular part, index 1.5.
        noise: of a reading; where the spectra themselves are rougher, their roughness counts.
        discrepancy: of the model; by default `ModelError()`.
        prior: of the search.
        max_paints: largest set, 1 to 3.
        max_coats: 2 says for the best pairs of paints whether they were mixed or laid one over
            the other, in either order (`Identification.coats_odds`); 3 does so for the best three
            paints as well, which takes some ten seconds a spectrum. No more than `max_paints`
            count: each coat has a paint.
        keep: candidates kept for each spectrum.
        thorough: fit every pair, and give every set errors of its own: some four times as long for
            the same first answer in most cases.
        own_films: the catalogue's exemplars are taken to be by the hand that made the films, as
            those of the oils and acrylics are, and compete as paints; by default pigments that
            have a family are searched by family.
        elements, without_elements: chemical symbols that X-ray fluorescence found, and did not
            find, such as ("Cu",): change how probable families are a priori.
        painted: year in which the film was painted: families that were not in use
            are fifty times less probable.
        varnish: what is known of a varnish on the films: "none", "thin", "yellowed" or "unknown".
            By default "none" where families are searched, and "unknown" where paints are.

    Raises:
        ValueError: a number or a varnish that cannot be searched, a noise or a year of another
            kind, or symbols of elements in one string.
    """

    instrument: InstrumentLike | None = None
    noise: Noise | None = None
    discrepancy: ModelError | None = None
    prior: Prior | None = None
    max_paints: int = 3
    max_coats: int = 1
    keep: int = 20
    thorough: bool = False
    own_films: bool = False
    elements: tuple[str, ...] = ()
    without_elements: tuple[str, ...] = ()
    painted: int | None = None
    varnish: str | None = None

    def __post_init__(self) -> None:
        if self.noise is not None and not isinstance(self.noise, Noise):
            raise ValueError(
                f"noise is {self.noise!r}; give Noise(floor, share), as Noise(0.001, 0)"
            )
        if self.painted is not None and not isinstance(self.painted, Integral):
            raise ValueError(f"painted is {self.painted!r}; it is a year, such as 1620")
        for name in ("elements", "without_elements"):
            if isinstance(symbols := getattr(self, name), str):
                raise ValueError(f"{name} is {symbols!r}; list symbols, such as ['Cu', 'Pb']")
        tried = {"max_paints": "sets of 1, 2 or 3 paints", "max_coats": "1, 2 or 3 coats"}
        for name, things in tried.items():
            if getattr(self, name) not in (1, 2, 3):
                raise ValueError(f"{name} is {getattr(self, name)}; {things} can be tried")
        if self.varnish not in (None, *VARNISHES):
            raise ValueError(
                f"varnish is {self.varnish!r}; say one of {', '.join(VARNISHES)}, or leave it out"
            )

    def refuse_facts(self) -> None:
        """Refuse elements and a year where no families are searched.

        Raises:
            ValueError: there are some.
        """
        if self.elements or self.without_elements or self.painted is not None:
            raise ValueError(
                "elements and years apply to families of pigments only: use "
                "catalogue.load('pigments') (--catalogue pigments) without own_films "
                "(--own-films), or leave them out"
            )


def check_keywords(function: str, keywords: Mapping[str, Any], accepted: type) -> None:
    """Refuse keywords that a function does not take, as Python itself does.

    Args:
        function: its name.
        keywords: its keywords.
        accepted: the typed dictionary of those that it takes.

    Raises:
        TypeError: one that is not among them.
    """
    for name in keywords:
        if name not in accepted.__optional_keys__:  # pyright: ignore[reportAttributeAccessIssue]
            raise TypeError(f"{function}() got an unexpected keyword argument {name!r}")
