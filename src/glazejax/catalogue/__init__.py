"""Pigments that ship with the package: k and s fitted to measured paint films, each with its provenance.

The numbers are in `pigments.csv` and what they rest on in `PROVENANCE.md`, beside this file. They were fitted together
to pure films, tints and shades of unknown thickness, a typical one taken as 25 micrometres: how much stronger one paint
is than another is known, their common scale is not. Where k and s could not be told apart, `Pigment.identifiable` is
False and only k/s can be trusted.
"""

import csv
import difflib
import functools
from collections.abc import Iterator, Mapping
from importlib.resources import files

import numpy as np

from ..paint.media import Pigment

ASSUMED_THICKNESS = 25e-6
"""Thickness of a typical film in m, an assumption."""

PROVENANCE = (
    "Fitted jointly to 58 films over black and over white from revigo-spectra (CC0 1.0): Geldof, Proaño Gaibor, "
    "Kirchner, Ligterink, 'Reconstructing Van Gogh's palette...', Heritage Science 6:17 (2018), "
    "doi 10.1186/s40494-018-0181-6. Thickness unknown, that of a typical film taken as 25 micrometres: k and s of all "
    "paints scale with its inverse. Mixtures add k and s by mass. "
    "Integrating sphere d:8 with the specular part, refractive index 1.5."
)


class Catalogue(Mapping[str, Pigment]):
    """Pigments by name; a name that is not known raises a KeyError that lists the nearest."""

    def __init__(self, pigments: Mapping[str, Pigment]):
        self._pigments = dict(pigments)

    def __getitem__(self, name: str) -> Pigment:
        try:
            return self._pigments[name]
        except KeyError:
            raise KeyError(_unknown(name, tuple(self._pigments))) from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._pigments)

    def __len__(self) -> int:
        return len(self._pigments)

    def __contains__(self, name: object) -> bool:
        return name in self._pigments

    def __repr__(self) -> str:
        return f"Catalogue({', '.join(self)})"


def _unknown(name: str, known: tuple[str, ...]) -> str:
    folded = {k.lower(): k for k in known}
    asked = str(name).lower().replace(" ", "")
    close = difflib.get_close_matches(asked, list(folded), n=3, cutoff=0.4)
    close += [k for k in folded if asked and (asked in k or k in asked) and k not in close]
    if close:
        return f"unknown pigment {name!r}; nearest: " + ", ".join(repr(folded[k]) for k in close[:4])
    return f"unknown pigment {name!r}; the catalogue has {', '.join(known)}"


def load() -> Catalogue:
    """The catalogue: a mapping from name to `Pigment`, on 400-700 nm step 10, k and s in 1/m.

    The pigments are made in the precision that JAX is set to when this is called.
    """
    return Catalogue(
        {
            name: Pigment(
                name,
                table[:, 0],
                table[:, 1],
                table[:, 2],
                absorption_sd=table[:, 3],
                scattering_sd=table[:, 4],
                identifiable=table[:, 5] > 0,
                provenance=PROVENANCE,
            )
            for name, table in _tables().items()
        }
    )


def pigment(name: str) -> Pigment:
    """One pigment of the catalogue.

    Raises:
        ValueError: there is none of that name; the message lists the nearest names.
    """
    try:
        return load()[name]
    except KeyError as error:
        raise ValueError(error.args[0]) from None


@functools.cache
def _tables() -> dict[str, np.ndarray]:
    """Numbers of each pigment: wavelength, k, s, their standard deviations, 1 where identifiable."""
    rows: dict[str, list[list[float]]] = {}
    text = files(__name__).joinpath("pigments.csv").read_text(encoding="utf-8")
    reader = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    for row in reader:
        numbers = [
            float(row[key]) for key in ("wavelength_nm", "absorption", "scattering", "absorption_sd", "scattering_sd")
        ]
        rows.setdefault(row["pigment"], []).append([*numbers, float(row["identifiable"] == "True")])
    return {name: np.array(values) for name, values in rows.items()}
