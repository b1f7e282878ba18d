"""ASD binary files (FieldSpec and its kin, versions 1 to 8), decoded by pyASDReader: one spectrum a file."""

import logging
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from ..finish import RawSpectra


def _open(path: Path) -> Any:
    """File as pyASDReader sees it. What it cannot parse stays None; it logs why, to nobody here."""
    # On import the package opens a log file in the working folder and takes the root logger: neither is wanted.
    with mock.patch("logging.FileHandler", return_value=logging.NullHandler()), mock.patch("logging.basicConfig"):
        from pyASDReader import ASDFile
    logging.getLogger("pyASDReader").setLevel(logging.CRITICAL + 1)
    return ASDFile(str(path))


def read_asd(path: Path) -> RawSpectra:
    """Read the reflectance of an ASD file: its counts over those of its white reference, or stored as such.

    Raises:
        ValueError: the file is cut short or damaged, is a radiance or another quantity, or has no white reference.
    """
    try:
        file = _open(path)
        header, stored = file.metadata, file.spectrumData
    except Exception as error:
        raise ValueError(f"{path}: not a legal ASD file: {error}") from None
    if header is None or stored is None or stored.spectra is None:
        raise ValueError(f"{path}: an ASD file that was cut short or is damaged: its header or spectrum cannot be read")
    kind = header.dataType.name.removeprefix("dt_").removesuffix("_TYPE").lower()
    if kind not in ("ref", "raw", "abs"):
        raise ValueError(f"{path}: an ASD file of type {kind!r}; only reflectance can be read")
    wavelengths = header.channel1Wavelength + header.wavelengthStep * np.arange(header.channels)
    counts = np.asarray(stored.spectra, float)
    if not np.isfinite(counts).all():
        band = int(np.argmin(np.isfinite(counts)))
        raise ValueError(f"{path}: the spectrum is not finite at {wavelengths[band]:g} nm: {counts[band]}")
    white = file.referenceData.spectra if file.referenceData is not None else None
    name = header.comments.decode("latin-1").split("\0")[0].strip() or path.stem
    if white is None or not np.any(white):
        version = header.asdFileVersion.value
        # Version 1 has no room for a reference: what it calls reflectance is reflectance.
        if kind == "raw" or (kind == "ref" and version >= 2 and white is None):
            raise ValueError(f"{path}: an ASD file without its white reference, or cut short before it: counts only")
        return RawSpectra(wavelengths, [name], counts[None], "ASD binary", ["reflectance as stored in the file"])
    white = np.asarray(white, float)
    dark = ~(white > 0)
    # Integration time and gains are the same for both, so they cancel.
    values = np.where(dark, np.nan, counts / np.where(dark, 1.0, white))
    notes = ["counts were divided by those of the white reference"]
    return RawSpectra(wavelengths, [name], values[None], "ASD binary", notes, 1.0, missing="drop")
