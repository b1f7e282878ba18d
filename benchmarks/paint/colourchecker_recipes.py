"""Recipes for the 24 measured patches of a ColorChecker chart, from the catalogue's paints.

For each patch the best recipe: its colour difference (and again from the glaze by colour-science's
own integration of a finely solved spectrum), layers, paints and seconds alone; then how near fewer
paints and coats come, with the time for all 24. Run with ``python -m
benchmarks.paint.colourchecker_recipes``.
"""

import functools
import warnings

import numpy as np

import glazejax as gj
from benchmarks.results import Results, command_line, quantities, quantity
from benchmarks.timing import time_call
from glazefit import Recipe, Target, colourchecker_targets, find_recipes
from glazefit.recipe.plots import recipe_figure
from glazejax import colour
from glazejax.commands.main import start_jax

NEEDS = ("matplotlib",)

SEEN = gj.Bidirectional(45, 0)
LIMITS = ((1, 1), (2, 1), (3, 1), (2, 2), (3, 2))


def main() -> None:
    options = command_line(__doc__).parse_args()
    if options.quick:
        globals().update(LIMITS=((1, 1), (3, 2)))
    start_jax()
    results = Results("colourchecker_recipes", options.out, "colour-science", "optimistix")
    catalogue = gj.catalogue.load()
    targets = colourchecker_targets()[slice(14, 18) if options.quick else slice(None)]
    results(
        f"{len(catalogue)} paints of the catalogue, {len(targets)} patches of colour-science's "
        "'BabelColor Average' "
        "chart, D65, 2°"
    )

    _, first = time_call(lambda: find_recipes(targets))
    results(
        f"all {len(targets)}, three paints and two coats at most: {first:.1f} s the first time, "
        "with what was not compiled before;"
    )
    found, again = time_call(lambda: find_recipes(targets))
    results(f"{again:.1f} s again")
    results.record(**quantities({"first": first, "again": again}, "s", 1))
    find_recipes(targets[0])
    results("\npatch           dE00  check  dE A   RMSE layers paints     s  recipe, top first")
    for target, recipes in zip(targets, found, strict=True):
        best = recipes[0]
        _, alone = time_call(lambda target=target: find_recipes(target))
        results(
            f"{target.name:14} {best.distance:5.2f} {independent(best):6.2f} "
            f"{best.metamerism:5.2f} {best.rmse:6.3f} "
            f"{len(best.coats):6d} {len(best.paints):6d} {alone:5.1f}  {best.text}"
        )
        if target.name == "magenta":
            results.record(magenta=quantity(best.distance, digits=1))
    results(
        "check: Delta E 2000 of the glaze solved to 1e-8, both spectra integrated by "
        "colour-science's sd_to_XYZ"
    )
    results()
    compare(targets, results)
    shown = [recipes[0] for recipes in found]
    figure = recipe_figure(
        shown,
        titles=[recipe.target.name for recipe in shown],
        heading="The ColorChecker in glazes: target left, recipe right",
        subtitle=(
            f"{len(catalogue)} oil paints; D65; curves: grey the target, black the recipe; coats "
            "top first"
        ),
    )
    results.save(figure)


def compare(targets: list[Target], results: Results) -> None:
    """How near the best recipe comes with fewer paints and coats."""
    results(
        "at most            dE00 of the nearest of five recipes\n"
        f"{'paints':>6} {'coats':>6} {'median':>7} {'largest':>8} {'below 1':>8} "
        f"{f's, all {len(targets)}':>10}"
    )
    for paints, coats in LIMITS:
        work = functools.partial(find_recipes, targets, max_paints=paints, max_coats=coats)
        work()
        found, seconds = time_call(work)
        nearest = np.array([min(recipe.distance for recipe in recipes) for recipes in found])
        results(
            f"{paints:6d} {coats:6d} {np.median(nearest):7.2f} {nearest.max():8.2f} "
            f"{(nearest < 1).sum():8d} {seconds:10.1f}"
        )
        if (paints, coats) == LIMITS[-1]:
            results.record(
                largest=quantity(nearest.max(), digits=1, n=len(targets)),
                median=quantity(np.median(nearest), n=len(targets)),
                within_one=quantity((nearest < 1).sum(), digits=0, n=len(targets)),
            )


def independent(recipe: Recipe) -> float:
    """Delta E 2000 of a recipe by another way: solved finely, integrated by colour-science from 1
    nm tables.
    """
    science = colour.colour_science()
    target = recipe.target
    spectrum = np.asarray(gj.reflectance(recipe.glaze, SEEN, tolerance=1e-8))
    light = science.SDS_ILLUMINANTS["D65"]
    observer = science.MSDS_CMFS[colour.CIE_1931]
    with warnings.catch_warnings(action="ignore"):
        white = science.sd_to_XYZ(science.sd_ones(), observer, light) / 100
    labs = []
    assert target.wavelengths is not None
    assert target.reflectance is not None
    for grid, values in ((recipe.wavelengths, spectrum), (target.wavelengths, target.reflectance)):
        measured = science.SpectralDistribution(values, grid)
        # It says at length that it trims and aligns.
        with warnings.catch_warnings(action="ignore"):
            xyz = science.sd_to_XYZ(measured, observer, light) / 100
        labs.append(np.asarray(science.XYZ_to_Lab(xyz, science.XYZ_to_xy(white))))
    return float(colour.delta_e_2000(*labs))


if __name__ == "__main__":
    main()
