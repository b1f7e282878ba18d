"""ASD binary files (FieldSpec and its kin, versions 1 to 8): one spectrum a file.

Offsets and codes after ASD document 600545, "ASD file format version 8": a header of 484 bytes, the
spectrum, and from version 2 on the white reference with a header of its own. What follows that
(classifiers, calibration, audit log) is not read.
"""

import struct

import numpy as np
from jaxtyping import Float

from ..finish import RawSpectra
from ..source import Source

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
    if len(content) < _HEADER:
        raise source.error(
            f"an ASD file that was cut short or is damaged: {len(content)} bytes of its header's "
            "484"
        )
    code, start, step, number = content[186], *struct.unpack_from("<ff", content, 191), content[199]
    (channels,) = struct.unpack_from("<H", content, 204)
    version = 1 if content[:3] == b"ASD" else int(content[2:3])
    if code >= len(_KINDS) or number not in _NUMBERS or not (channels and start > 0 and step > 0):
        raise source.error(
            f"an ASD file that was cut short or is damaged: its header has type {code}, number "
            f"format {number} and {channels} channels from {start:g} nm in steps of {step:g} nm"
        )
    kind = _KINDS[code]
    if kind not in ("ref", "raw", "abs"):
        raise source.error(f"an ASD file of type {kind!r}; only reflectance can be read")
    wavelengths = float(start) + float(step) * np.arange(channels)
    counts, end = _spectrum(content, _HEADER, _NUMBERS[number], channels)
    if counts is None:
        raise source.error(
            f"an ASD file that was cut short or is damaged: {len(content)} bytes are too few for "
            f"{channels} channels"
        )
    _refuse_holes(source, "spectrum", wavelengths, counts)
    name = content[3:160].strip(b"\0").decode("latin-1").split("\0")[0].strip() or source.path.stem
    white = None
    if version >= 2 and end < len(content):
        white, end = _white(content, end, _NUMBERS[number], channels)
        if white is None:
            raise source.error(
                "an ASD file without its white reference, or cut short before it: counts only"
            )
        _refuse_holes(source, "white reference", wavelengths, white)
    # Nothing else follows before version 6, but for a mark of three bytes.
    if version < 6 and len(content) - end > 3:
        raise source.error(
            f"an ASD file that is damaged: {len(content) - end} bytes after its {channels} channels"
        )
    if white is None or not (white != 0).any():
        # Version 1 has no room for a reference: what it calls reflectance is reflectance.
        if kind == "raw" or (kind == "ref" and version >= 2 and white is None):
            raise source.error(
                "an ASD file without its white reference, or cut short before it: counts only"
            )
        return RawSpectra(
            wavelengths=wavelengths,
            names=[name],
            values=counts[None],
            format="ASD binary",
            notes=["reflectance as stored in the file"],
        )
    dark = ~(white > 0)
    # Integration time and gains are the same for both, so they cancel.
    with np.errstate(all="ignore"):  # what is damaged may overflow, and is refused as not finite
        values = np.where(dark, np.nan, counts / np.where(dark, 1.0, white))
    notes = ["counts were divided by those of the white reference"]
    return RawSpectra(
        wavelengths=wavelengths,
        names=[name],
        values=values[None],
        format="ASD binary",
        notes=notes,
        scale=1.0,
        missing="drop",
    )


def _spectrum(
    content: bytes, start: int, kind: str, channels: int
) -> tuple[Float[np.ndarray, "channels"] | None, int]:
    """Numbers of a spectrum that begins at a byte, and the byte after it; None if the file ends
    before.
    """
    end = start + channels * np.dtype(kind).itemsize
    if end > len(content):
        return None, start
    # A damaged number may be a signalling NaN, of which NumPy warns; it stays NaN.
    with np.errstate(invalid="ignore"):
        return np.frombuffer(content, kind, channels, start).astype(np.float64), end


def _refuse_holes(
    source: Source,
    what: str,
    wavelengths: Float[np.ndarray, "channels"],
    values: Float[np.ndarray, "channels"],
) -> None:
    """Refuse a spectrum that is not finite somewhere: no instrument writes that."""
    finite = np.isfinite(values)
    if not finite.all():
        band = int(finite.argmin())
        raise source.error(
            f"an ASD file that is damaged: its {what} is not finite at {wavelengths[band]:g} nm: "
            f"{values[band]}; copy or export it again"
        )


def _white(
    content: bytes, start: int, kind: str, channels: int
) -> tuple[Float[np.ndarray, "channels"] | None, int]:
    """White reference, after whether there is one, two times and a description; None if it is cut
    short or damaged.
    """
    if len(content) < start + 20 or content[start : start + 2] not in (b"\0\0", b"\xff\xff"):
        return None, start
    (length,) = struct.unpack_from("<h", content, start + 18)
    return (None, start) if length < 0 else _spectrum(content, start + 20 + length, kind, channels)
