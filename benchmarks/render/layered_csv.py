"""The reference table of `layered_truth` as a CSV that others may use."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from tests.oracles.position_free import Tally

from benchmarks.render.layer_rules import RULES
from benchmarks.render.layered_stacks import INCIDENCES, VIEWS, LayeredStack
from benchmarks.render.layered_values import Surface, Values

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


class Row(Protocol):
    """What is written of a stack."""

    stack: LayeredStack
    surface: Surface
    truth: Values
    paths: dict[str, list[Tally]]
    rules: dict[str, Values]


def write_table(path: Path, all_found: Sequence) -> None:
    """One line for each stack, angle and band."""
    with path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {line}\n" for line in HEADER.format(count=len(all_found)).splitlines())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            [
                *(
                    "number",
                    "name",
                    "stack",
                    "ground",
                    "alpha",
                    "kind",
                    "incidence",
                    "viewing",
                    "azimuth",
                    "band",
                ),
                *("body", "surface", "monte_carlo", "standard_error", "paths", *RULES),
            ]
        )
        for number, found in enumerate(all_found, 1):
            writer.writerows(_lines(number, found))


def layers_in_words(stack: LayeredStack) -> str:
    """Such as '0|0 0 0|0|1.5; 8|0.004 0.04 0.4|0|1.5'."""
    return "; ".join(
        f"{layer.scattering:g}|{' '.join(f'{k:g}' for k in layer.absorption)}|{layer.g:g}|{n:g}"
        for layer, n in zip(stack.layers, stack.indices, strict=True)
    )


def _lines(number: int, found: Row) -> Iterator[list]:
    stack = found.stack
    start = [
        number,
        stack.name,
        layers_in_words(stack),
        f"{stack.ground:g}",
        f"{stack.roughness:g}",
    ]
    for i, incidence in enumerate(INCIDENCES):
        for kind, places in (("albedo", [("", "")]), ("factor", list(VIEWS))):
            tally = found.paths[kind][i]
            for v, place in enumerate(places):
                pick = (i,) if kind == "albedo" else (i, v)
                at = () if kind == "albedo" else (v,)
                surface = found.surface.lit[i] if kind == "albedo" else found.surface.factor[i, v]
                place = [f"{a:g}" if isinstance(a, float) else a for a in place]
                for band, body in enumerate(getattr(found.truth, kind)[pick]):
                    rules = [
                        f"{getattr(found.rules[rule], kind)[pick][band]:.6f}" for rule in RULES
                    ]
                    yield [
                        *start,
                        kind,
                        f"{incidence:g}",
                        *place,
                        band + 1,
                        f"{body:.8f}",
                        f"{surface:.8f}",
                        f"{tally.mean[at][band]:.7f}",
                        f"{tally.error[at][band]:.2e}",
                        tally.paths,
                        *rules,
                    ]


def read_table(path: Path) -> list[dict[str, str]]:
    """Lines of the table by column."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def albedo_of(rows: Sequence[dict[str, str]], number: int) -> np.ndarray:
    """Body's albedo of one stack, (incidences, bands)."""
    found = [
        float(row["body"])
        for row in rows
        if row["number"] == str(number) and row["kind"] == "albedo"
    ]
    return np.array(found).reshape(len(INCIDENCES), -1)
