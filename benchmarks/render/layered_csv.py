"""The reference table of `layered_truth` as a CSV that others may use."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.render.layer_rules import RULES
from benchmarks.render.layered_report import Found
from benchmarks.render.layered_stacks import BANDS, INCIDENCES, VIEWS, LayeredStack

HEADER = """\
Reflection of {count} layered paints: reference values by glazejax and by position-free Monte Carlo.
Licence: CC0 1.0, https://creativecommons.org/publicdomain/zero/1.0/ - no rights reserved; no warranty.
Made by `python -m benchmarks.render.layered_truth`; how, and how it was checked: docs/layered-truth.md of glazejax.
stack: layers top first on a Lambertian ground. Each layer 's|k1 k2 k3|g|n': scattering s d, absorption k d in three
  bands, mean cosine g of Henyey and Greenstein's phase function (0: isotropic), refractive index n (air above: 1).
  ground: reflectance of the ground as seen from inside the lowest layer. All without unit.
alpha: GGX roughness of the outer surface (0: smooth Fresnel); Smith's separable shadowing, exact unpolarised Fresnel;
  light that facets lose is returned by a reciprocal lobe c(i) c(o)/C, C = integral of c over n^2 cos dω of both sides.
  Surfaces between layers of different n are smooth.
kind albedo: directional-hemispherical reflectance at the angle of incidence (= albedo seen from there in even light).
kind factor: pi times the BRDF in 1/sr. Angles in degrees in air; azimuth 0 is the mirror side, 180 back to the light.
body: light that comes from below the surface, by glazejax. surface: what the surface reflects at once, by glazejax; the
  sum of both is the whole. A smooth surface's mirror image is a delta in the mirror direction and is not in factors.
monte_carlo, standard_error, paths: the body by paths; values of one stack and incidence share paths.
scaling, reciprocal, openpbr, belcour: the body by the layer rules of renderers (benchmarks/render/layer_rules.py)."""


COLUMNS = (
    *("number", "name", "stack", "ground", "alpha", "kind", "incidence", "viewing", "azimuth"),
    *("band", "body", "surface", "monte_carlo", "standard_error", "paths", *RULES),
)


def write_table(path: Path, all_found: Sequence[Found]) -> None:
    """One line for each stack, angle and band."""
    with path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {line}\n" for line in HEADER.format(count=len(all_found)).splitlines())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for number, found in enumerate(all_found, 1):
            writer.writerows(_lines(number, found))


def layers_in_words(stack: LayeredStack) -> str:
    """Such as '0|0 0 0|0|1.5; 8|0.004 0.04 0.4|0|1.5'."""
    return "; ".join(
        f"{layer.scattering:g}|{' '.join(f'{k:g}' for k in layer.absorption)}|{layer.g:g}|{n:g}"
        for layer, n in zip(stack.layers, stack.indices, strict=True)
    )


def _lines(number: int, found: Found) -> Iterator[list]:
    stack = found.stack
    start = [number, stack.name, layers_in_words(stack), f"{stack.ground:g}"]
    start.append(f"{stack.roughness:g}")
    places = {"albedo": [("", "")], "factor": [(f"{a:g}", f"{z:g}") for a, z in VIEWS]}
    surfaces = {"albedo": found.surface.lit, "factor": found.surface.factor}
    for i, incidence in enumerate(INCIDENCES):
        for kind, views in places.items():
            # One row of bands for each view, and one in all for an albedo.
            values = [found.truth, *(found.rules[rule] for rule in RULES)]
            tally = found.paths[kind][i]
            bands = [getattr(one, kind)[i] for one in values] + [tally.mean, tally.error]
            body, *rules, mean, error = (np.atleast_2d(one) for one in bands)
            surface = np.atleast_1d(surfaces[kind][i])
            for v, place in enumerate(views):
                for band in range(BANDS):
                    yield [
                        *start,
                        kind,
                        f"{incidence:g}",
                        *place,
                        band + 1,
                        f"{body[v, band]:.8f}",
                        f"{surface[v]:.8f}",
                        f"{mean[v, band]:.7f}",
                        f"{error[v, band]:.2e}",
                        tally.paths,
                        *(f"{rule[v, band]:.6f}" for rule in rules),
                    ]
