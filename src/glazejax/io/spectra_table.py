"""A table of spectra that share a grid: what every reader of spectra gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from ..names import nearest_names
from ..spectra import Bands as Bands
from ..spectra import describe_grid
from ..spectra import list_names as list_names

Rows: TypeAlias = Float[np.ndarray, "rows bands"]
"""Spectra, a row each."""
Stored: TypeAlias = Float[np.ndarray, "stored"]
"""A number for each band of a file."""
Chosen: TypeAlias = Int[np.ndarray, "bands"]
"""Which of a file's bands, by their number from 0 on."""
Mask: TypeAlias = Bool[np.ndarray, "y x"]
"""Which pixels of an image."""


@dataclass(frozen=True)
class SpectraTable:
    """Measured spectra that share a grid.

    Attributes:
        wavelengths: (bands,), nm, ascending.
        names: one a row, all different.
        reflectance: (rows, bands), fraction.
        notes: sentences on what the reader changed or noticed.
        format: what the file was, such as ``ENVI spectral library``; empty if it came from none.
        unit: ``fraction`` or ``percent``, as it was in the file.
        attributes: what else the file says of each spectrum: a title, and one text a row.
    """

    wavelengths: Bands
    names: tuple[str, ...]
    reflectance: Rows
    notes: list[str] = field(default_factory=list)
    format: str = ""
    unit: str = "fraction"
    attributes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> Bands:
        """Spectrum of one sample; KeyError if there is none of that name."""
        if name not in self.names:
            raise KeyError(f"no spectrum is called {name!r}")
        return self.reflectance[self.names.index(name)]

    def __repr__(self) -> str:
        return f"SpectraTable({len(self)} spectra, {describe_grid(self.wavelengths)})"


def row_of(
    names: Sequence[str], wanted: str, holder: str, example: str = "", what: str = "spectrum"
) -> int:
    """Row of the spectrum, or lamp, that is called so; where none is named, of the only one.

    Args:
        names: of the rows.
        wanted: the name; may be empty.
        holder: of the rows, such as a file: how errors begin.
        example: what a name is written behind, such as ``FILE:``.
        what: is looked for.

    Raises:
        ValueError: there are several and none is named, or none is called so.
    """
    if wanted and wanted not in names:
        raise ValueError(f"{holder} holds no {what} {wanted!r}; {there_are(wanted, names)}")
    if not wanted and len(names) > 1:
        several = {"spectrum": "spectra"}.get(what, f"{what}s")
        raise ValueError(
            f"{holder} holds {len(names)} {several}: choose one, as {example}{names[0]} "
            f"({there_are('', names)})"
        )
    return names.index(wanted) if wanted else 0


def there_are(wanted: str, names: Sequence[str]) -> str:
    """Sentence for where no spectrum is called so, or none is wanted (empty): the nearest names if
    there are such, else the first few.
    """
    near = nearest_names(wanted, names)
    if near:
        return f"the nearest {'is' if len(near) == 1 else 'are'} {', '.join(near)}"
    return f"there are {', '.join(names[:6])}{', ...' if len(names) > 6 else ''}"
