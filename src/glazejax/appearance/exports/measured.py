"""A glaze as a table for Mitsuba's `measured`, with the file that uses it, and how far Mitsuba is
from the solver.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from ...io.outputs import check_output
from ...paint.media import Glaze
from ...spectra import Grid
from ...stacks import Stack
from ..glaze.mitsuba import export_glaze, reflectance_in_mitsuba
from ..glaze.table import GlazeTable, glaze_table
from .angles import check_roughness

# The least roughness of the mirror lobe: Mitsuba's blend of a table and a perfect mirror weighs
# them wrongly.
_LEAST_ROUGHNESS = 0.02
# Cosines and azimuths at which Mitsuba is asked, off the table's own directions, and at most so
# many wavelengths.
_COSINES = (0.95, 0.6, 0.25)
_AZIMUTHS = (0.3, 1.6, 2.9)
_BANDS = 7
_VARIANT = "scalar_spectral"


@dataclass(frozen=True)
class MeasuredExport:
    """What was written, and how near it is.

    Attributes:
        table, scene: files: the table, and the BSDF in Mitsuba's XML that uses it.
        bsdf: the same for `mitsuba.load_dict`.
        solver: estimated error of the reflectance factor at the table's entries.
        mitsuba: largest error of the reflectance factor found in Mitsuba, without the surface's
            reflection, at 27 pairs of directions between the table's own; None where Mitsuba could
            not be asked.
        why: why it could not be.
    """

    table: Path
    scene: Path
    bsdf: dict[str, Any]
    solver: float
    mitsuba: float | None
    why: str = ""


def write_measured(
    glaze: Glaze | Stack,
    path: str | Path,
    wavelengths_nm: Grid | None = None,
    *,
    gloss: bool = True,
    roughness: float = 0.0,
    resolution: int = 48,
    tolerance: float = 1e-4,
    check: bool = True,
    overwrite: bool = False,
) -> MeasuredExport:
    """Write a glaze for Mitsuba's `measured`: the table, PATH.bsdf, and PATH.xml, which adds the
    surface's reflection.

    Args:
        glaze: of one thickness a layer, or a stack (of a card its white half).
        path: of the table, ending in .bsdf.
        wavelengths_nm: (bands,); those of the paints if left out.
        gloss: with the reflection of the surface itself.
        roughness: alpha of that reflection alone, the body is seen through a smooth surface; below
            0.02 it is 0.02.
        resolution: directions of the eye, and half-way vectors along both of their angles.
        tolerance: absolute error wanted of the reflectance factor at the table's entries.
        check: ask Mitsuba, where it is installed, what it makes of the table.
        overwrite: replace files that exist.

    Raises:
        ValueError: a path with another ending, or what `export_glaze` refuses.
        FileExistsError, FileNotFoundError, IsADirectoryError: see
            `glazejax.io.outputs.check_output`.
    """
    path = Path(path)
    if path.suffix.lower() != ".bsdf":
        raise ValueError(f"{path}: Mitsuba's table of a measured material ends in .bsdf")
    check_roughness(roughness)
    scene = check_output(path.with_suffix(".xml"), overwrite=overwrite, switch="overwrite=True")
    made = glaze.glaze() if isinstance(glaze, Stack) else glaze
    grid = made.wavelengths if wavelengths_nm is None else wavelengths_nm
    table = glaze_table(made, grid, tolerance=tolerance)
    bsdf = export_glaze(
        table,
        path,
        grid,
        gloss=gloss,
        roughness=max(roughness, _LEAST_ROUGHNESS),
        angles=resolution,
        resolution=resolution,
        overwrite=overwrite,
    )
    scene.write_text(_xml(bsdf, path.name), encoding="utf-8")
    found, why = (
        _in_mitsuba(table, path, np.asarray(grid, float), gloss)
        if check
        else (None, "it was not asked")
    )
    return MeasuredExport(
        table=path, scene=scene, bsdf=bsdf, solver=float(table.error), mitsuba=found, why=why
    )


def _in_mitsuba(
    table: GlazeTable, path: Path, grid: np.ndarray, gloss: bool
) -> tuple[float | None, str]:
    """Largest difference between Mitsuba and the table of the solver, or why it is not known."""
    try:
        import mitsuba as mi  # pyright: ignore[reportMissingImports]
    except ImportError:
        return None, 'Mitsuba is not installed: pip install "mitsuba>=3.5"'
    if mi.variant() is None:
        mi.set_variant(_VARIANT)
    if "spectral" not in str(mi.variant()):
        return None, f"Mitsuba's variant {mi.variant()} has no spectra"
    bands = np.unique(np.linspace(0, grid.size - 1, _BANDS).round().astype(int))
    body = {"type": "measured", "filename": str(path)}
    worst = 0.0
    for cos_in in _COSINES:
        for cos_out in _COSINES:
            truth = np.asarray(table.reflectance_factor(cos_in, cos_out), float)[bands]
            for azimuth in _AZIMUTHS:
                seen = reflectance_in_mitsuba(body, grid[bands], cos_in, cos_out, azimuth) / (
                    2.0 if gloss else 1.0
                )
                worst = max(worst, float(np.abs(seen - truth).max()))
    return worst, ""


def _xml(bsdf: dict[str, Any], file: str) -> str:
    """A BSDF of `export_glaze` as Mitsuba's XML, which names the table relative to itself."""
    root = _element("bsdf", bsdf, file)
    root.set("version", "3.0.0")
    xml.indent(root)
    return xml.tostring(root, encoding="unicode") + "\n"


def _element(kind: str, values: dict[str, Any], file: str, name: str = "") -> xml.Element:
    element = xml.Element(kind, {"type": values["type"]} | ({"name": name} if name else {}))
    for key, value in values.items():
        if key == "type":
            continue
        if isinstance(value, dict) and value["type"] == "uniform":
            xml.SubElement(element, "spectrum", {"name": key, "value": f"{value['value']:g}"})
        elif isinstance(value, dict):
            element.append(_element("bsdf", value, file, key))
        elif isinstance(value, str):
            xml.SubElement(
                element, "string", {"name": key, "value": file if key == "filename" else value}
            )
        else:
            xml.SubElement(element, "float", {"name": key, "value": f"{value:.9g}"})
    return element
