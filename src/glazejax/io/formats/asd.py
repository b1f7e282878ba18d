"""ASD binary files (FieldSpec and its kin, versions 1 to 8): one spectrum a file.

Offsets and codes after ASD document 600545, "ASD file format version 8": a header of 484 bytes, the
spectrum, and from version 2 on the white reference with a header of its own. What follows that
(classifiers, calibration, audit log) is not read.
"""

import struct
from typing import Any

import numpy as np

from ..finish import RawSpectra
from ..source import Source
from ..spectra_table import Bands

_HEADER = 484
_KINDS = ("raw", "ref", "rad", "nounits", "irrad", "qi", "trans", "unknown", "abs")
# Of the format's codes of numbers; 3 is unknown, which old instruments write for float64.
_NUMBERS = {0: "<f4", 1: "<i4", 2: "<f8", 3: "<f8"}


def read_asd(source: Source) -> RawSpectra:
    """Read the reflectance of an ASD file: its counts over those of its white reference, or stored
    as such.

    Raises:
        ValueError: the file is cut short or damaged, so that numbers may not be finite; is a
            radiance or another quantity; or has no white reference.
    """
    content = source.content()
    damaged = "an ASD file that was cut short or is damaged: "
    if len(content) < _HEADER:
        raise source.error(f"{damaged}{len(content)} bytes of its header's 484")
    # Of the header: its type, first wavelength and step, format of numbers, and channels.
    code, start, step, number, channels = struct.unpack_from("<B4xffB4xH", content, 186)
    version = 1 if content[:3] == b"ASD" else int(content[2:3])
    if code >= len(_KINDS) or number not in _NUMBERS or not (channels and start > 0 and step > 0):
        raise source.error(
            f"{damaged}its header has type {code}, number format {number} and {channels} channels "
            f"from {start:g} nm in steps of {step:g} nm"
        )
    kind = _KINDS[code]
    if kind not in ("ref", "raw", "abs"):
        raise source.error(f"an ASD file of type {kind!r}; only reflectance can be read")
    wavelengths = float(start) + float(step) * np.arange(channels)
    dtype = np.dtype(_NUMBERS[number])
    end = _HEADER + channels * dtype.itemsize
    if end > len(content):
        raise source.error(f"{damaged}{len(content)} bytes are too few for {channels} channels")
    counts = _spectrum(source, "spectrum", wavelengths, content[_HEADER:end], dtype)
    white = np.zeros(0)
    counts_only = "an ASD file without its white reference, or cut short before it: counts only"
    if version >= 2 and end < len(content):
        # Whether there is a reference, two times, and a description stand before it.
        mark = content[end : end + 2]
        begin = end + 20 + int.from_bytes(content[end + 18 : end + 20], "little", signed=True)
        rest = begin + channels * dtype.itemsize
        if mark not in (b"\0\0", b"\xff\xff") or not end + 20 <= begin <= rest <= len(content):
            raise source.error(counts_only)
        white = _spectrum(source, "white reference", wavelengths, content[begin:rest], dtype)
        end = rest
    # Nothing else follows before version 6, but for a mark of three bytes.
    if version < 6 and len(content) - end > 3:
        raise source.error(
            f"an ASD file that is damaged: {len(content) - end} bytes after its {channels} channels"
        )
    stored = not white.any()
    # Version 1 has no room for a reference: what it calls reflectance is reflectance.
    if stored and (kind == "raw" or (kind == "ref" and version >= 2 and not white.size)):
        raise source.error(counts_only)
    # Integration time and gains are the same for both, so they cancel.
    with np.errstate(all="ignore"):  # what is damaged may overflow, and is refused as not finite
        values = counts if stored else counts / np.where(white > 0, white, np.nan)
    name = content[3:160].strip(b"\0").decode("latin-1").split("\0")[0].strip()
    return RawSpectra(
        wavelengths=wavelengths,
        names=[name or source.path.stem],
        values=values[None],
        format="ASD binary",
        notes=[
            "reflectance as stored in the file"
            if stored
            else "counts were divided by those of the white reference"
        ],
        scale=None if stored else 1.0,
        missing="refuse" if stored else "drop",
    )


def _spectrum(
    source: Source,
    what: str,
    wavelengths: Bands,
    stored: bytes,
    dtype: np.dtype[Any],
) -> Bands:
    """Numbers of a spectrum; one that is not finite somewhere is refused, as no instrument writes
    that.
    """
    # A damaged number may be a signalling NaN, of which NumPy warns; it stays NaN.
    with np.errstate(invalid="ignore"):
        values = np.frombuffer(stored, dtype).astype(np.float64)
    finite = np.isfinite(values)
    if not finite.all():
        band = int(finite.argmin())
        raise source.error(
            f"an ASD file that is damaged: its {what} is not finite at {wavelengths[band]:g} nm: "
            f"{values[band]}; copy or export it again"
        )
    return values
