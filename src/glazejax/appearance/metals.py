"""Metals: complex refractive indices as published, and the reflectances that follow.

The figures are in `metals.csv` next to this file, as printed in their sources and collected,
without copyright (CC0 1.0), by the refractiveindex.info database.
"""

import functools
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from ..radiative.common.fresnel import conductor_reflectance
from ..spectra import (
    Bands,
    Grid,
    Numbers,
    as_float_array,
    describe_grid,
    validate_wavelengths,
)

_JOHNSON = (
    "P. B. Johnson, R. W. Christy, 'Optical constants of the noble metals', Phys. Rev. B 6, 4370 "
    "(1972), doi 10.1103/PhysRevB.6.4370: evaporated films at room temperature; through "
    "refractiveindex.info (CC0 1.0)"
)
SOURCES = {
    "copper": _JOHNSON,
    "copper-hagemann": (
        "H.-J. Hagemann, W. Gudat, C. Kunz, 'Optical constants from the far infrared to the "
        "x-ray region', J. Opt. Soc. Am. 65, 742 (1975), doi 10.1364/JOSA.65.000742: in the "
        "visible the copper of Palik's handbook, where paper B took its figures from; through "
        "refractiveindex.info (CC0 1.0)"
    ),
    "gold": _JOHNSON,
    "silver": _JOHNSON,
    "aluminium": (
        "A. D. Rakić, 'Algorithm for the determination of intrinsic optical constants of metal "
        "films: application to aluminum', Appl. Opt. 34, 4755 (1995), doi 10.1364/AO.34.004755; "
        "through refractiveindex.info (CC0 1.0)"
    ),
}
"""Metals that there are, and where their figures come from."""


class Metal(NamedTuple):
    """Complex refractive index n + ik of a metal on a grid of wavelengths."""

    name: str
    """What it is called."""
    wavelengths: Bands
    """In nm, (bands,)."""
    refractive_index: Bands
    """Real part n, (bands,)."""
    extinction: Bands
    """Imaginary part k, (bands,)."""
    source: str
    """Where the numbers were published."""

    def __repr__(self) -> str:
        return f"Metal({self.name!r}, {describe_grid(self.wavelengths)})"

    def resample(self, wavelengths_nm: Grid) -> "Metal":
        """The metal on another grid, nm, by monotone cubic interpolation (PCHIP): no n or k beyond
        its neighbours'.

        Raises:
            ValueError: the grid is not legal or reaches beyond the figures.
        """
        from scipy.interpolate import PchipInterpolator

        new = validate_wavelengths(wavelengths_nm)
        # Nothing is extrapolated: beyond the published figures n and k are not known.
        if new[0] < self.wavelengths[0] or new[-1] > self.wavelengths[-1]:
            raise ValueError(
                f"{self.name} is known from {self.wavelengths[0]:g} to {self.wavelengths[-1]:g} "
                f"nm, which {describe_grid(new)} exceeds"
            )
        n, k = (
            PchipInterpolator(self.wavelengths, values)(new)
            for values in (self.refractive_index, self.extinction)
        )
        return self._replace(wavelengths=new, refractive_index=n, extinction=k)

    def reflectance(self, cos_incidence: Numbers) -> Float[Array, "*batch bands"]:
        """Exact Fresnel reflectance, (..., bands), at cosines of incidence (...), in [0, 1]."""
        cosine = as_float_array(cos_incidence)[..., None]
        n = as_float_array(self.refractive_index)
        k = as_float_array(self.extinction)
        return conductor_reflectance(cosine, n, k)


def metal(name: str, wavelengths_nm: Grid | None = None) -> Metal:
    """Metal by name: copper, gold, silver or aluminium, or copper-hagemann, that of paper B.

    Args:
        name: in any case; aluminum will do.
        wavelengths_nm: grid wanted, nm; as published if left out.

    Raises:
        ValueError: there is no such metal, or see `Metal.resample`.
    """
    key = name.strip().lower().replace("aluminum", "aluminium")
    if key not in SOURCES:
        raise ValueError(
            f"unknown metal {name!r}: there are {', '.join(SOURCES)}; or give n and k of your own"
        )
    entry = _load()[key]
    return entry if wavelengths_nm is None else entry.resample(wavelengths_nm)


@functools.cache
def _load() -> dict[str, Metal]:
    """All metals, from the file."""
    text = files(__name__.rpartition(".")[0]).joinpath("metals.csv").read_text(encoding="utf-8")
    table = np.genfromtxt(
        text.splitlines(), delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    metals = {}
    for name, source in SOURCES.items():
        rows = table[table["metal"] == name]
        rows.setflags(write=False)
        metals[name] = Metal(
            name=name,
            wavelengths=rows["wavelength_nm"],
            refractive_index=rows["n"],
            extinction=rows["k"],
            source=source,
        )
    return metals
