"""CxF3 (ISO 17972-1), the XML in which colour instruments exchange measurements."""

import datetime
import re
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

import numpy as np

from ...spectra import MAX_DECLARED, describe_grid
from ..finish import RawSpectra
from ..quantity import first_quantity
from ..source import Source
from ..spectra_table import Bands, SpectraTable
from ..words import is_number, read_number

_NAMESPACE = "http://colorexchangeformat.com/CxF3-core"
# Bounds of CxF3's schema for the first wavelength.
_FIRST = (360, 400)
_FILE = """<?xml version="1.0" encoding="UTF-8"?>
<CxF xmlns="{namespace}">
<FileInformation><Creator>glazejax</Creator><CreationDate>{date}</CreationDate></FileInformation>
<Resources>
<ObjectCollection>
{objects}
</ObjectCollection>
<ColorSpecificationCollection><ColorSpecification Id="c1"><MeasurementSpec>
<MeasurementType>Spectrum_Reflectance</MeasurementType>
<GeometryChoice><UnknownGeometry>unknown</UnknownGeometry></GeometryChoice>
<WavelengthRange StartWL="{first:.0f}" Increment="{step:.0f}"/>
</MeasurementSpec></ColorSpecification></ColorSpecificationCollection>
</Resources>
</CxF>
"""
_OBJECT = """<Object ObjectType="Standard" Name={name} Id="o{number}">
<CreationDate>{date}</CreationDate>
<ColorValues>
<ReflectanceSpectrum ColorSpecification="c1">{values}</ReflectanceSpectrum>
</ColorValues>
</Object>"""


def read_cxf(source: Source) -> RawSpectra:
    """Read the reflectance spectra of all objects of a CxF3 file.

    The first wavelength stands in each spectrum or in its colour specification, the step in the
    specification. An object with spectra of several specifications (M0, M1, ...) gives a row each;
    the specification is an attribute.

    Raises:
        ValueError: not XML, not CxF3, no reflectance spectra, no wavelengths for one, or
            wavelengths that differ.
    """
    content = source.content()
    if _NAMESPACE.encode() not in content:
        if b"colorexchangeformat.com/v2" in content or re.search(rb"<CXF[ >]", content):
            raise source.error("CxF 2, which is not read; save it as CxF3, CGATS or CSV")
        raise source.error(f"XML, but not CxF3 (no namespace {_NAMESPACE})")
    if b"<!DOCTYPE" in content:
        raise source.error(
            "not legal CxF3: it has a DOCTYPE, whose entities could name other files; remove it"
        )
    # Each tag takes about a kilobyte when it is read, each word a quarter of one.
    most_tags = 100_000
    most_words = 600_000
    if content.count(b"<") > most_tags or len(content.split()) > most_words:
        raise source.error(
            f"more than {most_tags} tags or {most_words} words; split it, or export the spectra "
            "as CSV"
        )
    try:
        # UTF-16 was turned into UTF-8 as it was read.
        content = re.sub(rb"(?i)\A([^>]*encoding=.)utf-16", rb"\1utf-8", content)
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise source.error(f"not legal CxF3: {error}") from None
    stray = any((thing.tail or "").strip() for thing in root.iter())
    ranges = {
        specification.get("Id"): limits
        for specification in root.iter(_tag("ColorSpecification"))
        for limits in specification.iter(_tag("WavelengthRange"))
    }
    kinds = {
        specification.get("Id"): specification.findtext(f".//{_tag('MeasurementType')}", "")
        for specification in root.iter(_tag("ColorSpecification"))
    }
    names: list[str] = []
    grids: list[np.ndarray] = []
    values: list[list[float]] = []
    specifications: list[str] = []
    things = list(root.iter(_tag("Object")))
    for thing in things:
        spectra = list(thing.iter(_tag("ReflectanceSpectrum")))
        for spectrum in spectra:
            specification = spectrum.get("ColorSpecification", "")
            name = thing.get("Name") or thing.get("Id") or f"object {len(names) + 1}"
            if len(spectra) > 1:
                name += f" ({spectrum.get('Name') or specification})"
            words = (spectrum.text or "").split()
            wrong = [word for word in words if not is_number(word)]
            if wrong or not words:
                said = f"holds {wrong[0][:20]!r}, not a number" if wrong else "is empty"
                raise source.error(f"the spectrum of {name!r} {said}")
            limits = ranges.get(specification)
            grid = _wavelengths(spectrum, limits, len(words))
            if grid is None:
                raise source.error(
                    f"no wavelengths for {name!r}: its ColorSpecification {specification!r} has no "
                    "legal WavelengthRange with StartWL and Increment"
                )
            grids.append(grid)
            if not np.array_equal(grid, grids[0]):
                raise source.error(
                    f"{name!r} is on {describe_grid(grid)} and {names[0]!r} on "
                    f"{describe_grid(grids[0])}; a table has one grid: export them apart"
                )
            names.append(name)
            values.append(list(map(read_number, words)))
            specifications.append(specification)
    if len([*root.iter(_tag("ReflectanceSpectrum"))]) != len(names):
        raise source.error("not legal CxF3: a spectrum stands outside of the objects")
    if not names:
        raise source.error(f"CxF3 without reflectance spectra ({len(things)} objects)")
    table = np.array(values)
    return RawSpectra(
        wavelengths=grids[0],
        names=names,
        values=table,
        format="CxF3",
        notes=["text between the tags is not read; was the file changed by hand?"] * stray,
        quantity=first_quantity(kinds.get(one, "") for one in specifications),
        # The standard says fractions below 3. Who goes beyond has not kept to it and is looked at
        # like any other.
        scale=1.0 if table.max() <= MAX_DECLARED else None,
        attributes={"ColorSpecification": specifications},
    )


def _tag(title: str) -> str:
    return f"{{{_NAMESPACE}}}{title}"


def _wavelengths(
    spectrum: ElementTree.Element, limits: ElementTree.Element | None, count: int
) -> Bands | None:
    """Wavelengths of a spectrum; None where the file does not say them."""
    stated = {} if limits is None else limits.attrib
    words = (spectrum.get("StartWL") or stated.get("StartWL", ""), stated.get("Increment", ""))
    first, step = (read_number(word) if is_number(word) else np.nan for word in words)
    # No number is so large, and NaN is not below.
    return first + step * np.arange(count) if np.abs([first, step]).max() < 1e6 else None


def format_cxf(table: SpectraTable) -> bytes:
    """A table as CxF3; the instrument's geometry is declared unknown, as a table does not carry it.

    Raises:
        ValueError: wavelengths that CxF3 cannot say: they must begin at a whole number from 360 to
            400 nm and go in equal whole steps.
    """
    steps = np.diff(table.wavelengths)
    first = float(table.wavelengths[0])
    step = float(steps[0]) if steps.size else 1.0
    even = first.is_integer() and step.is_integer() and bool((steps == step).all())
    if not (even and _FIRST[0] <= first <= _FIRST[1]):
        reaches = first <= 400 and table.wavelengths[-1] >= 700
        way = "resample first, to 400:700:10 say" if reaches else "write CSV or ENVI"
        raise ValueError(
            f"CxF3 holds wavelengths that begin at {_FIRST[0]} to {_FIRST[1]} nm and go in equal "
            f"whole steps, not {describe_grid(table.wavelengths)}: {way}"
        )
    date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    objects = [
        _OBJECT.format(
            name=quoteattr(name), number=i + 1, date=date, values=" ".join(map(repr, row.tolist()))
        )
        for i, (name, row) in enumerate(zip(table.names, table.reflectance, strict=True))
    ]
    text = _FILE.format(
        namespace=_NAMESPACE, date=date, objects="\n".join(objects), first=first, step=step
    )
    return text.encode()
