"""Maps of two coats: a painting of known coats mapped with one and with two.

    python -m benchmarks.maps.painting_coats [--side 200] [--bands 60]

Which paints lie in both coats a spectrum often leaves open: a white for another, a body that looks
as the ground does. So it is counted, too, how many pixels are said to have two coats, whether the
upper one's pigment is right, and how probable two coats are in the mean. What no search could do
better is in `benchmarks.maps.coats_told`.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.maps.painting import map_painting
from benchmarks.results import Results, add_option
from benchmarks.rivals.known_painting import painting, write_painting
from benchmarks.rivals.known_painting_scene import REGIONS
from benchmarks.rivals.painting_rivals import Row, answer_of_map, by_coats, score, table, truth_of
from glazefit import open_map
from glazejax.catalogue import family

NEEDS = ("zarr",)

_SEED = 3


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_option(parser, side=64, bands=40)
    parser.add_argument("--side", type=int, default=200)
    parser.add_argument("--bands", type=int, default=60)
    options = parser.parse_args()
    results = Results("painting_coats", options.out, "zarr")
    scene = painting((options.side, options.side), options.bands, _SEED)
    truth = scene.truth(0, options.side)
    rows = []
    seconds = {}
    arrays = {}
    with tempfile.TemporaryDirectory() as temporary:
        where = Path(temporary) / "painting"
        write_painting(where, scene)
        for coats in (1, 2):
            # Programs are compiled once and kept, as on a second call of the command.
            map_painting(where, coats=coats)
            seconds[coats] = map_painting(where, coats=coats)["seconds"]
            found = open_map(where / "map.zarr")
            arrays = {str(name): found[name].values for name in found.data_vars}
            answer = answer_of_map(arrays)
            flat = truth_of(truth)
            pace = seconds[coats] / options.side**2
            name = f"map_cube, {coats} coat{'s' if coats > 1 else ''}"
            right = score(flat, answer, scene.names)
            rows.append(Row(name, right, pace, by_coats(flat, answer, scene.names)))
    results(f"Painting of {options.side} x {options.side} pixels, {options.bands} bands")
    results()
    for line in table(rows):
        results(line)
    results()
    results(
        f"one coat {seconds[1]:.1f} s, two coats {seconds[2]:.1f} s: {seconds[2] / seconds[1]:.2f} "
        "times as long"
    )
    results()
    _upper(results, scene.names, truth, arrays)
    results.save()


def _upper(results: Results, names: tuple[str, ...], truth: dict, arrays: dict) -> None:
    """What is said of coats, region by region."""
    lower = np.where(truth["members"] >= 0, truth["coats"], 0).max(axis=-1)
    members = arrays["members"].astype(int)
    stacked = (arrays["coats"] > 0).any(axis=-1) & (arrays["explained"] > 0)
    families = np.array([family(name) for name in names] + [""])

    def pigments(numbers: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Words for the pigments of the upper coat."""
        found = np.sort(families[np.where(upper, numbers, -1)], axis=-1)
        return found

    said = pigments(members, (members >= 0) & (arrays["coats"] == 0))
    true = pigments(truth["members"], (truth["members"] >= 0) & (truth["coats"] == 0))
    right = stacked & (said == true).all(axis=-1)
    thick = np.where((truth["members"] >= 0) & (truth["coats"] == 0), truth["amounts"], 0.0)
    off = np.abs(np.log(arrays["top_thickness"] / thick.sum(axis=-1)))
    results(
        f"{'':<30}{'pixels':>10}{'said two':>10}{'upper':>10}{'error of its':>14}{'chance of':>12}\n"
        f"{'':<30}{'':>10}{'coats':>10}{'right':>10}{'thickness':>14}{'two coats':>12}"
    )
    known = ~truth["foreign"]
    parts = {"one coat": known & (lower == 0), "two coats": known & (lower == 1)}
    parts |= {
        f"  {region.name}": truth["region"] == number
        for number, region in enumerate(REGIONS)
        if len(region.coats) == 2 and not truth["foreign"][truth["region"] == number].any()
    }
    for words, here in parts.items():
        error = off[here & right]
        shown = f"{np.median(error):>14.1%}" if error.size else f"{'-':>14}"
        results(
            f"{words:<30}{here.sum():>10,}{stacked[here].mean():>10.1%}{right[here].mean():>10.1%}"
            + shown
            + f"{np.nanmean(arrays['coats_probability'][here]):>12.1%}"
        )


if __name__ == "__main__":
    main()
