"""CxF3 (ISO 17972-1), the XML in which colour instruments exchange measurements, through
colour-cxf.
"""

import datetime
import logging
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ...spectra import describe_grid
from ..finish import MAX_DECLARED, RawSpectra
from ..source import Source
from ..spectra_table import SpectraTable
from ..words import is_number

_NAMESPACE = b"colorexchangeformat.com/CxF3-core"
# Bounds of CxF3's schema for the first wavelength.
_FIRST = (360, 400)


def _library() -> Any:
    """The package colour-cxf, or a clear error."""
    try:
        import colour_cxf
    except ImportError:
        raise ValueError(
            "CxF3 needs the package colour-cxf (Python 3.13 or older): pip install colour-cxf"
        ) from None
    return colour_cxf


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
    if _NAMESPACE not in content:
        if b"colorexchangeformat.com/v2" in content or re.search(rb"<CXF[ >]", content):
            raise source.error("CxF 2, which is not read; save it as CxF3, CGATS or CSV")
        raise source.error(f"XML, but not CxF3 (no namespace http://{_NAMESPACE.decode()})")
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
    cxf = _library()
    notes: list[str] = []
    try:
        with warnings.catch_warnings(), _stray_text(notes):
            # A value outside the schema comes back as text, and is refused below with its place.
            warnings.simplefilter("ignore")
            document = cxf.read_cxf(content)
    except Exception as error:
        raise source.error(f"not legal CxF3: {_one_line(error)}") from None
    resources = document.resources
    collection = resources.color_specification_collection if resources else None
    ranges = {
        spec.id: spec.measurement_spec.wavelength_range
        for spec in (collection.color_specification if collection else [])
        if spec.measurement_spec
    }
    names = []
    values = []
    specifications = []
    grid = None
    objects = (
        resources.object_collection.object_value
        if resources and resources.object_collection
        else []
    )
    for thing in objects:
        spectra = [
            c
            for c in (thing.color_values.choice if thing.color_values else [])
            if _is_reflectance(c)
        ]
        for spectrum in spectra:
            name = thing.name or thing.id or f"object {len(names) + 1}"
            if len(spectra) > 1:
                name += f" ({spectrum.name or spectrum.color_specification})"
            here = _wavelengths(source, name, spectrum, ranges.get(spectrum.color_specification))
            if grid is not None and (here.size != grid.size or (here != grid).any()):
                raise source.error(
                    f"{name!r} is on {here[0]:g}-{here[-1]:g} nm ({here.size} bands) and "
                    f"{names[0]!r} on {grid[0]:g}-{grid[-1]:g} nm ({grid.size} bands); a table "
                    "has one grid: export them apart"
                )
            grid = here
            names.append(name)
            values.append(spectrum.value)
            specifications.append(spectrum.color_specification or "")
    if grid is None:
        raise source.error(f"CxF3 without reflectance spectra ({len(objects)} objects)")
    table = np.array(values, float)
    # The standard says fractions below 3. Who goes beyond has not kept to it and is looked at like
    # any other.
    scale = 1.0 if table.max() <= MAX_DECLARED else None
    return RawSpectra(
        wavelengths=grid,
        names=names,
        values=table,
        format="CxF3",
        notes=notes,
        scale=scale,
        attributes={"ColorSpecification": specifications},
    )


@contextmanager
def _stray_text(notes: list[str]) -> Iterator[None]:
    """Make a note of text between the tags, which the library leaves out; it would log that."""

    def take(record: logging.LogRecord) -> bool:
        stray = record.getMessage().startswith("Unassigned parsed object")
        if stray and not notes:
            notes.append("text between the tags is not read; was the file changed by hand?")
        return not stray

    log = logging.getLogger("xsdata.logger")
    log.addFilter(take)
    try:
        yield
    finally:
        log.removeFilter(take)


def _is_reflectance(choice: object) -> bool:
    return type(choice).__name__ == "ReflectanceSpectrum"


def _wavelengths(source: Source, name: str, spectrum: Any, measured: Any) -> np.ndarray:
    """Wavelengths of one spectrum."""
    if not spectrum.value:
        raise source.error(f"the spectrum of {name!r} is empty")
    # Where one of the numbers is none, the library leaves the whole text, or that word, as it is.
    words = spectrum.value.split() if isinstance(spectrum.value, str) else spectrum.value
    wrong = [word for word in words if not is_number(str(word))]
    if wrong:
        raise source.error(f"the spectrum of {name!r} holds {str(wrong[0])[:20]!r}, not a number")
    start = (
        spectrum.start_wl if spectrum.start_wl is not None else getattr(measured, "start_wl", None)
    )
    step = getattr(measured, "increment", None)
    try:
        # None is a TypeError here, and said below.
        first = float(start)  # pyright: ignore[reportArgumentType]
        width = float(step)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError, OverflowError):
        raise source.error(
            f"no wavelengths for {name!r}: its ColorSpecification "
            f"{spectrum.color_specification!r} has no "
            "legal WavelengthRange with StartWL and Increment"
        ) from None
    return first + width * np.arange(len(spectrum.value))


def format_cxf(table: SpectraTable) -> bytes:
    """A table as CxF3; the instrument's geometry is declared unknown, as a table does not carry it.

    Raises:
        ValueError: wavelengths that CxF3 cannot say: they must begin at a whole number from 360 to
            400 nm and go in equal whole steps.
    """
    cxf = _library()
    core = cxf.cxf3
    steps = np.diff(table.wavelengths)
    first = float(table.wavelengths[0])
    step = float(steps[0]) if steps.size else 1.0
    even = first.is_integer() and step.is_integer() and bool((steps == step).all())
    if not (even and _FIRST[0] <= first <= _FIRST[1]):
        last = table.wavelengths[-1]
        way = (
            "resample first, to 400:700:10 say"
            if first <= 400 and last >= 700
            else "write CSV or ENVI"
        )
        raise ValueError(
            f"CxF3 holds wavelengths that begin at {_FIRST[0]} to {_FIRST[1]} nm and go in equal "
            f"whole steps, not {describe_grid(table.wavelengths)}: {way}"
        )
    from xsdata.models.datatype import XmlDateTime

    now = core.CreationDate(
        XmlDateTime.from_datetime(datetime.datetime.now(datetime.UTC).replace(microsecond=0))
    )
    objects = [
        core.Object(
            object_type="Standard",
            name=name,
            id=f"o{number}",
            creation_date=now,
            color_values=core.ColorValues(
                [core.ReflectanceSpectrum(row.tolist(), color_specification="c1")]
            ),
        )
        for number, (name, row) in enumerate(
            zip(table.names, table.reflectance, strict=True), start=1
        )
    ]
    measurement = core.MeasurementSpec(
        core.MeasurementType(core.EspectrumType.SPECTRUM_REFLECTANCE),
        core.GeometryChoice("unknown"),
        core.WavelengthRange(int(first), int(step)),
    )
    specifications = [core.ColorSpecification(measurement_spec=measurement, id="c1")]
    document = core.CxF(
        core.FileInformation(creator="glazejax", creation_date=now),
        core.Resources(
            core.ObjectCollection(objects), core.ColorSpecificationCollection(specifications)
        ),
    )
    return cxf.write_cxf(document)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200]
