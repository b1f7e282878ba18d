"""Format of a file, recognised by its content and never by its name."""

import re
from pathlib import Path

from ..source import WORKBOOKS, Source, is_there, open_source

_CGATS = re.compile(
    r"\A\s*(CGATS\S*|IT8\S*|ISO ?28178\S*|CTI[1-4]|SPECT|SPOT|NCLR)[ \t]*$|^[ "
    r"\t]*BEGIN_DATA_FORMAT\b",
    re.MULTILINE,
)
_QTX = re.compile(r"\A\s*\[(STANDARD|BATCH)_DATA \d+\]")
_JCAMP = re.compile(r"##\s*(TITLE|JCAMP-?DX)\s*=", re.IGNORECASE)
_XML = re.compile(r"\A\s*<[?!A-Za-z]")
# A table may begin with a title such as [nm].
_JSON = re.compile(r"\A\s*(\[\s*[\[{\]]|\{\s*[\"}])")
_PICTURE = "a picture ({}), which holds no spectra; name a table of spectra"
_MAKERS = "a {} file, which only its maker's software reads; export it there as {}"
_OFFICE = "a document of Word or PowerPoint; save the table in it as a workbook or as UTF-8 CSV"
# Old files of Office and of others hold named parts.
_OLE = rb"\xd0\xcf\x11\xe0(?s:.*)"
# How files begin that are not read here, and what they are.
_OTHERS = {
    rb"\x89PNG": _PICTURE.format("PNG"),
    rb"\xff\xd8\xff": _PICTURE.format("JPEG"),
    rb"GIF8": _PICTURE.format("GIF"),
    rb"II\*\0|MM\0\*": "a TIFF; glazejax map reads TIFFs of spectra",
    rb"\x89HDF": "an HDF5 or NetCDF file; glazejax map reads images of spectra in it",
    rb"MATLAB [57]": "a MATLAB file; glazejax map reads images of spectra in it",
    rb"%PDF": "a PDF; export the table in it as UTF-8 CSV",
    rb"\x1f\x8b": "a gzip archive; unpack it first",
    rb"\n\n\xfe\xfe": _MAKERS.format("Bruker OPUS", "a data point table (.dpt) or JCAMP-DX"),
    rb"Spectral (Data|Exte) File(?s:.*)\0": _MAKERS.format(
        "Thermo OMNIC (.spa, .spg)", "CSV or JCAMP-DX"
    ),
    rb"PEPE(?s:.*)\0": _MAKERS.format("PerkinElmer (.sp, .fsm)", "ASCII or JCAMP-DX"),
    rb"WDF1(?s:.*)\0": _MAKERS.format("Renishaw WiRE (.wdf)", "text"),
    _OLE + rb"Y\0-\0D\0a\0t\0a\0": _MAKERS.format("JASCO (.jws)", "ASCII or JCAMP-DX"),
    _OLE + rb"(W\0o\0r\0d\0D|P\0o\0w\0e\0r\0P)": _OFFICE,
    rb"PK\x03\x04(?s:.*)(word|ppt)/": _OFFICE,
}
_SPC = "a Galactic SPC file (GRAMS); export it from its software as JCAMP-DX or as text"
# The archive of SpectraSuite begins with one of these.
_PROCSPEC = re.compile(rb"PK\x03\x04.{26}(ps_\d+\.xml|OOI\w+\.(txt|xml))", re.DOTALL)
_ENVI = re.compile(rb"(\xef\xbb\xbf)?[ \t\r]*ENVI[ \t\r]*(\n|\Z)")
# Tables keep the name of the image that they were made from.
_TABLES = (".csv", ".tsv", ".txt", *WORKBOOKS)
_ASD = (b"ASD", b"as2", b"as3", b"as4", b"as5", b"as6", b"as7", b"as8")


def identify(source: Source) -> str:
    """Format of a file, by the name of its module, ``envi header`` or ``envi data``; ``table``
    if its content shows none.

    Raises:
        ValueError: it is a file of a maker's own, a picture, an archive or a PDF.
    """
    head = source.head
    for start, words in _OTHERS.items():
        # The data of an ENVI image may begin with any bytes.
        if re.match(start, head) and not header_beside(source.path):
            raise source.error(words)
    if _PROCSPEC.match(head):
        return "procspec"
    if head.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")) and not header_beside(source.path):
        return "workbook"
    if b"\0" in head:
        if head.startswith(_ASD):
            return "asd"
        if header_beside(source.path):
            return "envi data"
        if head[1:2] in (b"K", b"L", b"M") and b"\0" in head[:8]:
            raise source.error(_SPC)
        return "table"
    text = head.decode("utf-8-sig", errors="replace")
    if _ENVI.match(head):
        return "envi header"
    if text.startswith("/*** Spectra Vista"):
        return "svc"
    if _QTX.match(text):
        return "qtx"
    if _XML.match(text):
        return "cxf"
    if _JSON.match(text):
        return "listing"
    if _is_jcamp(text):
        return "jcamp"
    if _CGATS.search(text):
        return "cgats"
    if "\ufffd" in text and header_beside(source.path):
        return "envi data"
    return "table"


def header_beside(path: Path) -> Path | None:
    """ENVI header of a data file: ``cube.hdr`` or ``cube.img.hdr`` for ``cube.img``, if there is
    one. A file that is named as a table or workbook has none.
    """
    if path.suffix.lower() in _TABLES:
        return None
    for name in (path.with_suffix(".hdr"), path.with_name(path.name + ".hdr")) if path.name else ():
        for candidate in (name, name.with_suffix(".HDR")):
            if candidate != path and is_there(candidate):
                with open_source(candidate) as source:
                    if _ENVI.match(source.head):
                        return candidate
    return None


def _is_jcamp(text: str) -> bool:
    """Return whether the text begins with labels of JCAMP-DX; a table may begin with comments such
    as ## date = today.
    """
    for line in text.splitlines():
        start = line.lstrip()
        if _JCAMP.match(start):
            return True
        if start and not start.startswith(("##", "$$")):
            return False
    return False
