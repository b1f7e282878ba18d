"""What the solver's own last steps do for recipes, and how near unmixed coats come: the 24 patches
of a ColorChecker.

For each patch the nearest of five recipes with paints mixed within up to two coats, before the
solver's own least squares and after, both as Delta E 2000 of the solver's spectrum before amounts
are rounded; then the nearest of five of up to six unmixed coats, and what mixing would gain.
Nothing here is timed. Run with ``python -m benchmarks.paint.recipe_coats``.
"""

import argparse

import numpy as np

import glazejax as gj
from benchmarks.results import Results, add_option
from glazefit import Recipe, colourchecker_targets, find_recipes
from glazejax.commands.main import start_jax


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_option(parser)
    options = parser.parse_args()
    start_jax()
    results = Results("recipe_coats", options.out)
    found = find_recipes(colourchecker_targets()[: 3 if options.quick else None], glazes=True)
    unmixed = [min(recipes, key=lambda one: one.distance) for recipes in found]
    mixed = [recipes[0].mixed for recipes in found if recipes[0].mixed is not None]
    count = f"{len(gj.catalogue.load())} paints of the catalogue, {len(found)} patches"
    results(f"{count}, D65, 2°; nearest of five recipes each")
    results()
    results("paints mixed, up to three in two coats      dE00, not rounded")
    results("patch          coats   by the table  by the solver  steps settled")
    for one in mixed:
        results(
            f"{one.target.name:14} {len(one.coats):5d} {one.before:14.3f} {one.unrounded:14.3f} "
            f"{one.steps:6d} "
            f"{'yes' if one.converged else 'no':>7}"
        )
    several = [one for one in mixed if len(one.coats) > 1]
    before, after = (np.median([value(one) for one in several]) for value in (_before, _after))
    results(
        f"median of the {len(several)} of several coats: {before:.3f} before, {after:.3f} after; "
        "settled: "
        f"{sum(one.converged for one in mixed)} of {len(mixed)}; most steps: "
        f"{max(one.steps for one in mixed)}"
    )
    results()
    results("up to six unmixed coats         dE00, rounded")
    results("patch          unmixed  mixed  coats settled  unmixed recipe, top first")
    for one, other in zip(unmixed, mixed, strict=True):
        results(
            f"{one.target.name:14} {one.distance:7.2f} {other.distance:6.2f} {len(one.coats):6d} "
            f"{'yes' if one.converged else 'no':>7}  {one.text}"
        )
    for name, some in (("unmixed", unmixed), ("mixed", mixed)):
        distances = np.array([one.distance for one in some])
        results(
            f"{name}: median {np.median(distances):.2f}, below 1: {(distances < 1).sum()} of "
            f"{len(some)}"
        )
    results.save()


def _before(recipe: Recipe) -> float:
    return recipe.before


def _after(recipe: Recipe) -> float:
    return recipe.unrounded


if __name__ == "__main__":
    main()
