"""Paints that are searched by family, and what is expected of their films."""

from collections.abc import Sequence

from glazejax import Pigment

from ...film.model.errors import Prior

EXPECTED = Prior(unknown=0.1)
"""What is expected of a film: the catalogue's families are most that were ever painted with."""


def has_families(pigments: Sequence[Pigment]) -> bool:
    """True if paints can be searched by family: each has one, and a source."""
    return bool(pigments) and all(paint.family and paint.source for paint in pigments)
