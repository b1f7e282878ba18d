"""A table of spectra that share a grid: what every reader of spectra gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ..names import nearest_names
from ..spectra import describe_grid


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

    wavelengths: Float[np.ndarray, "bands"]
    names: tuple[str, ...]
    reflectance: Float[np.ndarray, "rows bands"]
    notes: list[str] = field(default_factory=list)
    format: str = ""
    unit: str = "fraction"
    attributes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> Float[np.ndarray, "bands"]:
        """Spectrum of one sample; KeyError if there is none of that name."""
        if name not in self.names:
            raise KeyError(f"no spectrum is called {name!r}")
        return self.reflectance[self.names.index(name)]

    def __repr__(self) -> str:
        return f"SpectraTable({len(self)} spectra, {describe_grid(self.wavelengths)})"


def there_are(wanted: str, names: Sequence[str]) -> str:
    """What to say where no spectrum is called so: the nearest names if there are such, else the
    first few.
    """
    near = nearest_names(wanted, names)
    if near:
        return f"the nearest {'is' if len(near) == 1 else 'are'} {', '.join(near)}"
    return f"there are {', '.join(names[:6])}{', ...' if len(names) > 6 else ''}"


def list_names(names: Sequence[str]) -> str:
    """First few of some names."""
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return ", ".join(names[:3]) + more
