"""Paints that a map is not given: whether their spectra are offered as paints, and what a second map
makes of them.

    python -m benchmarks.maps.painting_spots [--side 200] [--bands 60]
"""

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.maps.painting import PAINTS, map_painting
from benchmarks.results import Results, command_line, quantities
from benchmarks.rivals.known_painting import Painting, painting, write_painting
from glazefit import open_map
from glazefit.mapping.spot_files import write_spots
from glazejax import catalogue
from glazejax.geometry import resolve_instrument
from glazejax.paint.pigment_table import write_pigments

if TYPE_CHECKING:
    import xarray

NEEDS = ("zarr",)

_SEED = 3
FOREIGN = {"ViridianGreen": "viridian", "Cochineal": "cochineal", "EmeraldGreen": "emerald"}
"""Paints that are in the painting, and that the first map is not given; what texts call them."""


def main() -> None:
    options = command_line(
        __doc__, side=(200, 64, "pixels"), bands=(60, 40, "of the image")
    ).parse_args()
    results = Results("painting_spots", options.out, "zarr")
    scene = painting((options.side, options.side), options.bands, _SEED)
    paints = [paint for name, paint in catalogue.load().items() if name not in FOREIGN]
    members = scene.truth(0, options.side)["members"]
    with tempfile.TemporaryDirectory() as temporary:
        where = Path(temporary) / "painting"
        write_painting(where, scene)
        write_pigments(where / PAINTS, paints)
        map_painting(where)
        found = open_map(where / "map.zarr").load()
        _, table = write_spots(
            where,
            found,
            scene.wavelengths,
            paints,
            instrument=resolve_instrument("d:8"),
        )
        table.replace(where / PAINTS)
        map_painting(where)
        again = open_map(where / "map.zarr").load()
    results(
        f"Painting of {options.side} x {options.side} pixels, {options.bands} bands, mapped "
        f"without {', '.join(FOREIGN)}"
    )
    results()
    offered = _offered(results, scene, members, found.attrs["spots"])
    results(
        f"\nforeign paints offered: {len(offered)} of {len(FOREIGN)}\n"
        f"\n{'':<30}{'pixels':>10}{'none':>10}{'none in the second map':>24}{'its spots':>11}"
    )
    results.record(**quantities({"offered": len(offered), "paints": len(FOREIGN)}, digits=0))
    names = [str(name) for name in again["paint"].values]
    there = again["members"].values.astype(int)
    for name, key in FOREIGN.items():
        here = (members == scene.names.index(name)).any(axis=-1)
        spots = [names.index(spot) for spot in offered.get(name, ())]
        by_spot = np.isin(there[here], spots).any(axis=-1) & (again["explained"].values[here] > 0)
        before, after = _none(found, here), _none(again, here)
        results(f"{name:<30}{here.sum():>10,}{before:>10.1%}{after:>24.1%}{by_spot.mean():>11.1%}")
        shares = {f"{key}_none": 100.0 * before, f"{key}_again": 100.0 * after}
        results.record(**quantities(shares, "%", 0, n=int(here.sum())))
    others = ~np.isin(members, [scene.names.index(name) for name in FOREIGN]).any(axis=-1)
    results(
        f"{'all other pixels':<30}{others.sum():>10,}{_none(found, others):>10.1%}"
        f"{_none(again, others):>24.1%}"
    )
    results.save()


def _offered(
    results: Results, scene: Painting, members: np.ndarray, spots: list[dict]
) -> dict[str, list[str]]:
    """Spots at which a foreign paint lies, by its name."""
    offered: dict[str, list[str]] = {}
    for spot in spots:
        y, x = spot["place"]
        here = [scene.names[number] for number in members[y, x] if number >= 0]
        results(f"{spot['name']:<8}{spot['pixels']:>8,} pixels, purest where {' + '.join(here)}")
        for name in FOREIGN.keys() & set(here):
            offered.setdefault(name, []).append(spot["name"])
    return offered


def _none(found: "xarray.Dataset", here: Any) -> float:
    """Share of pixels that no paints explain."""
    return 1.0 - float(found["explained"].values[here].mean())


if __name__ == "__main__":
    main()
