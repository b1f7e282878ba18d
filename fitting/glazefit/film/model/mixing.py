"""Mixing of the coefficients of paints: from weights to the shares that k and s are summed with.

k = sum_p c_p k_p and s = sum_p c_p s_p with shares c. By mass the shares are the mass fractions
(Duncan 1940). By volume they are mass fractions over densities, normalised; a film's thickness
being unknown, the two predict the same spectra and differ in the thickness only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256

import numpy as np
from jaxtyping import ArrayLike, Float

from glazejax import Pigment
from glazejax.names import first_repeated

LAWS = ("mass", "volume")

Pigments = Mapping[str, Pigment] | Sequence[Pigment]
"""A catalogue as the user has it."""


def check_paints(paints: Sequence[Pigment]) -> None:
    """Refuse paints that no search takes.

    Raises:
        ValueError: two of one name, several spectra in one, or one that has a phase function.
    """
    if (twice := first_repeated(paint.name for paint in paints)) is not None:
        raise ValueError(f"two pigments are called {twice!r}; names must differ")
    for paint in paints:
        if paint.absorption.ndim != 1 or paint.scattering.ndim != 1:
            raise ValueError(f"pigment {paint.name!r} is a batch; give its members one by one")
        if paint.phase is not None:
            raise ValueError(
                f"pigment {paint.name!r} has a phase function; here paint scatters isotropically"
            )


def listed_pigments(pigments: Pigments) -> list[Pigment]:
    """The paints of a catalogue, of a mapping its values."""
    return list(pigments.values()) if isinstance(pigments, Mapping) else list(pigments)


@dataclass(frozen=True)
class MixingLaw:
    """Mixing law.

    Attributes:
        name: "mass" or "volume".
        densities: of each paint, for "volume"; any unit.

    Raises:
        ValueError: an unknown name, or a density that is missing or not positive.
    """

    name: str = "mass"
    densities: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        if self.name not in LAWS:
            raise ValueError(f"unknown mixing law {self.name!r}; known: {', '.join(LAWS)}")
        if self.name == "volume" and not self.densities:
            raise ValueError(
                "the volume law needs the densities of the paints: MixingLaw('volume', "
                "densities={...})"
            )
        for paint, density in (self.densities or {}).items():
            if not density > 0:
                raise ValueError(f"the density of {paint!r} is {density:g}; it must be above 0")

    def shares(
        self, weights: Float[np.ndarray, "films paints"], paints: Sequence[str]
    ) -> Float[np.ndarray, "films paints"]:
        """Shares of each paint in each film, summing to one, from weights in any unit.

        Raises:
            ValueError: a paint has no density.
        """
        if self.name == "volume":
            densities = self.densities or {}
            missing = [paint for paint in paints if paint not in densities]
            if missing:
                raise ValueError(f"no density was given for {', '.join(map(repr, missing))}")
            weights = weights / np.array([densities[paint] for paint in paints])
        return weights / weights.sum(axis=1, keepdims=True)


def weight_table(
    samples: Sequence[str], recipes: Mapping[str, Mapping[str, float]]
) -> tuple[tuple[str, ...], Float[np.ndarray, "films paints"]]:
    """Paints of some films in order of appearance, and the weight of each in each film.

    Raises:
        ValueError: a film has no recipe, or a weight is negative or all are zero.
    """
    for sample in samples:
        recipe = recipes.get(sample)
        if recipe is None:
            raise ValueError(
                f"nothing is known of what film {sample!r} is made of; add it to the list of "
                "recipes"
            )
        if any(not weight >= 0 for weight in recipe.values()) or not sum(recipe.values()) > 0:
            raise ValueError(
                f"film {sample!r} has weights {dict(recipe)}; they must be 0 or more, and not all 0"
            )
    paints = tuple(
        dict.fromkeys(paint for sample in samples for paint, w in recipes[sample].items() if w > 0)
    )
    return paints, np.array(
        [[recipes[sample].get(paint, 0.0) for paint in paints] for sample in samples]
    )


def digest(*arrays: ArrayLike) -> str:
    """Sixteen hexadecimal digits of what arrays hold."""
    hasher = sha256()
    for array in arrays:
        hasher.update(np.asarray(array).tobytes())
    return hasher.hexdigest()[:16]
