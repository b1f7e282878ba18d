"""How near the studio's page comes to the library, and how quick it is: `studio/page/solver.js`, run
by node, against `glazejax.reflectance`'s solver.

    python -m benchmarks.studio.page_solver [--stacks 2000] [--out FOLDER]

Random stacks of the catalogues' paints: one to eight coats of .1 to 200 micrometres, over white,
black and any grey, in six geometries, 31 and 38 bands. The largest error of the reflectance, and
CIEDE2000 of the colours under D65. With `--table FILE` the stacks are only written, for
`node --test tests/studio/solver.test.mjs`.
"""

import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.results import Results, command_line, quantity
from glazejax import colour
from glazejax.geometry import Bidirectional, Hemispherical, parse_geometry
from glazejax.radiative.common.fresnel import dielectric_reflectance
from glazejax.radiative.stack import stack_hemispherical_reflectance, stack_reflectance_factor
from glazejax.stacks import all_paints
from glazejax.studio.page_data import page_data

NEEDS = ("program/node",)

GEOMETRIES = ("45:0", "d:8", "de:8", "60:30", "30:30:specular", "0:0")
MOST = 8
TEST = Path(__file__).parents[2] / "tests" / "studio" / "solver.test.mjs"
_INDEX = 1.5
_LAMP = "D65"


def write_table(path: Path, count: int) -> None:
    """Stacks, and what the library says of them, for the test in node."""
    shelf = all_paints()
    rng = np.random.default_rng(0)
    stacks: list[dict[str, Any]] = []
    kinds = len(GEOMETRIES) * 2
    for i, geometry in enumerate(GEOMETRIES * 2):
        bands = 31 if i < len(GEOMETRIES) else 38
        names = [name for name, paint in shelf.items() if paint.wavelengths.size == bands]
        stacks += _some(rng, names, geometry, -(-count // kinds))
    known = page_data()
    known["paints"] = [one | {"curves": _fully(shelf[one["name"]])} for one in known["paints"]]
    path.write_text(json.dumps({"data": known, "index": _INDEX, "lamp": _LAMP, "stacks": stacks}))


def _fully(paint: Any) -> dict[str, Any]:
    """Coefficients to all their digits, so that only the solver is compared."""
    keys = ("wavelengths", "absorption", "scattering")
    return {key: np.asarray(getattr(paint, key), float).tolist() for key in keys}


def _some(
    rng: np.random.Generator, names: list[str], geometry: str, count: int
) -> list[dict[str, Any]]:
    """Stacks of these paints, as one batch."""
    paints = [all_paints()[name] for name in names]
    k, s = (
        np.array([np.asarray(getattr(paint, key), float) for paint in paints])
        for key in ("absorption", "scattering")
    )
    coats = rng.integers(1, MOST + 1, count)
    chosen = rng.integers(0, len(names), (count, MOST))
    thickness = np.exp(rng.uniform(np.log(1e-7), np.log(2e-4), (count, MOST)))
    thickness[np.arange(MOST) >= coats[:, None]] = 0.0
    ground = rng.choice([0.93, 0.025, 0.0, 1.0, -1.0], count, p=[0.25, 0.15, 0.05, 0.05, 0.5])
    ground = np.where(ground < 0, rng.uniform(0, 1, count), ground)
    extinction = np.moveaxis(k[chosen] + s[chosen], 1, 2)
    albedo = np.moveaxis(s[chosen], 1, 2) / extinction
    stack = albedo, extinction * thickness[:, None], ground[:, None]
    seen = parse_geometry(geometry)
    light = float(np.asarray(seen.cos_incidence))
    settings: dict[str, Any] = {"refractive_index": _INDEX, "cos_incidence": light}
    if isinstance(seen, Hemispherical):
        found = np.asarray(stack_hemispherical_reflectance(*stack, **settings), float)
    else:
        assert isinstance(seen, Bidirectional)
        settings["cos_viewing"] = seen.cos_viewing
        found = np.asarray(stack_reflectance_factor(*stack, **settings), float)
    if seen.sees_surface:
        found = found + float(dielectric_reflectance(light, _INDEX))
    lab = np.asarray(colour.lab(paints[0].wavelengths, found, illuminant=_LAMP), float)
    return [
        {
            "coats": [
                {"paint": names[chosen[i, j]], "thickness": float(thickness[i, j])}
                for j in range(coats[i])
            ],
            "ground": float(ground[i]),
            "geometry": geometry,
            "reflectance": found[i].tolist(),
            "lab": lab[i].tolist(),
        }
        for i in range(count)
    ]


def run_node(table: Path) -> dict[str, float]:
    """What `node --test` measures with a table: errors, CIEDE2000, milliseconds, by name.

    Raises:
        AssertionError: with all that it prints, where a test fails or is skipped.
    """
    node = shutil.which("node")
    assert node is not None, "there is no node here"
    environment = os.environ | {"SOLVER_TABLE": str(table)}
    done = subprocess.run(
        [node, "--test", "--test-reporter=tap", str(TEST)],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "# skipped 0" in done.stdout, done.stdout
    figures: dict[str, float] = {}
    for line in done.stdout.splitlines():
        _, mark, words = line.partition("page solver: ")
        if mark:
            figures |= json.loads(words)
    return figures


def main() -> None:
    parser = command_line(__doc__, stacks=(2000, 120, "random stacks"))
    parser.add_argument("--table", type=Path, help="only write the stacks into this file")
    options = parser.parse_args()
    if options.table is not None:
        write_table(options.table, options.stacks)
        return
    out = Results("page_solver", options.out)
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "stacks.json"
        write_table(table, options.stacks)
        node = run_node(table)
    count = int(node["stacks"])
    out(
        f"stacks: {count}\n"
        f"error of the reflectance, largest: {node['largest']:.1e}, median: {node['median']:.1e}\n"
        f"CIEDE2000, largest: {node['delta_e']:.3f}"
    )
    eight = f"median: {node['eight_median']:.2f}, 95 %: {node['eight_95']:.2f}"
    out(f"small matrices, 8 coats, CIEDE2000, {eight}")
    every = f"95 %: {node['matrices_95']:.2f}, largest: {node['matrices_largest']:.2f}"
    out(f"small matrices, CIEDE2000, {every}")
    matrices = 1e3 * node["matrices_ms"]
    out(f"microseconds for 8 coats as small matrices, all bands: {matrices:.0f}")
    for coats, key in (
        ("1 coat", "one_coat"),
        ("3 coats", "three_coats"),
        ("8 coats", "eight_coats"),
    ):
        out(f"milliseconds for {coats}, 31 bands: {node[key]:.2f}")
    out.record(
        largest=quantity(node["largest"], digits=1, form="e", n=count),
        median=quantity(node["median"], digits=1, form="e", n=count),
        delta_e=quantity(node["delta_e"], digits=3, n=count),
        matrices_95=quantity(node["matrices_95"], n=count),
        matrices_largest=quantity(node["matrices_largest"], n=count),
        one_coat=quantity(node["one_coat"], "ms"),
        eight_coats=quantity(node["eight_coats"], "ms"),
        matrices_ms=quantity(node["matrices_ms"], "ms", digits=3),
        matrices_times=quantity(node["matrices_ms"] / node["eight_coats"], "times", form="g"),
    )
    out.save()


if __name__ == "__main__":
    main()
