"""Provenance of a map, in words, for its report."""

import platform
from collections.abc import Mapping
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from glazejax.commands.command_line import option
from glazejax.io import quick_source_hash

from ..page.inputs import input_files

if TYPE_CHECKING:
    import xarray

_PACKAGES = ("glazejax", "jax", "numpy", "scipy", "xarray", "zarr")


def map_provenance(
    command: str,
    typed: Mapping[str, Any],
    cube: Path,
    read: Mapping[str, Path | None],
    paint_map: "xarray.Dataset",
    facts: Mapping[str, str],
) -> dict[str, Any]:
    """Collect the provenance of a map for its report.

    Args:
        command: the command line.
        typed: all options and their values, by the names of the command's arguments.
        cube: that was mapped.
        read: what else was read, by what it was given as.
        paint_map: the map.
        facts: names and words for the head of the page, such as the instrument, the ground and the
            paints tried.

    Returns:
        ``title`` of the painting or cube, ``created``, ``command`` as it was typed, ``facts``,
        ``options`` that were set, ``versions`` of programs, ``platform``; ``role``, ``name`` and
        ``sha256`` of each file of ``inputs``; ``shortcuts``, what each did and may cost;
        ``agreement`` with the full search; and ``notes``, sentences of the reader and the solver.
    """
    attrs = paint_map.attrs
    source = {"role": "CUBE", "name": str(cube), "sha256": quick_source_hash(cube)}
    return {
        "title": cube.name,
        "created": datetime.now().astimezone().isoformat(timespec="seconds"),
        "command": command,
        "facts": facts,
        "options": {option(name): str(value) for name, value in typed.items() if name != "cube"},
        "versions": {name: version(name) for name in _PACKAGES},
        "platform": platform.platform(),
        "inputs": [source, *input_files(read)],
        "shortcuts": {
            "Representatives": (
                f"{attrs['representatives']:,} spectra of the image were searched in full; any "
                "other pixel is answered in closed form from the one nearest to it: a set that "
                "only that pixel shows can be missed"
            ),
            "Bands": (
                f"neighbouring bands were averaged to {len(attrs['working_wavelengths'])}: a "
                "feature narrower than their distance is lost"
            ),
        },
        "agreement": agreement_words(attrs["agreement"]),
        "notes": [*map(str, attrs.get("notes", ()))],
    }


def agreement_words(agreement: Mapping[str, Any]) -> dict[str, str]:
    """Agreement of answers in closed form with full searches of the same pixels."""
    comparison = {
        "Pixels compared": f"{int(agreement['pixels']):,}",
        "Same first set": f"{agreement['first']:.1%}",
        "Same answer on whether the paints explain the pixel": f"{agreement['explained']:.1%}",
        "Largest difference of a paint's probability": (
            f"{agreement['probability']:.3f} in the median, "
            f"{agreement['probability_90']:.3f} at most in nine of ten"
        ),
    }
    if np.isfinite(float(agreement["amount"])):
        comparison["Difference of thickness, in its standard deviations"] = (
            f"{agreement['amount']:.2f} in the median, "
            f"{agreement['amount_90']:.2f} at most in nine of ten"
        )
    return comparison
