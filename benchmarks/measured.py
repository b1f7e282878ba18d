"""Where measured films are: GLAZEJAX_DATA, or the folder shared/data beside the repository."""

import os
from pathlib import Path


def measured_data(name: str) -> Path:
    """Folder of one set of measurements, such as "revigo".

    Raises:
        SystemExit: it is not there; says what to do.
    """
    base = Path(os.environ.get("GLAZEJAX_DATA") or Path(__file__).parents[2] / "shared" / "data")
    if not (base / name).is_dir():
        raise SystemExit(f"no folder {name} in {base}; set GLAZEJAX_DATA to the folder that holds it")
    return base / name
