"""Recipes: which paints, in which order and how thick, give a colour or a spectrum.

All sets of up to three paints in one coat or two are looked at on a coarse grid
(`glazefit.recipe.screen`), the best are refined by Levenberg-Marquardt on a table
(`glazefit.recipe.refine`), more paints or coats are added where allowed, what remains is
simplified, and its last steps follow the solver's own readings and slopes
(`glazefit.recipe.polish`). Then it is rounded to what a painter can weigh and measure, and put in
order (`glazefit.recipe.selection`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Unpack, overload

import numpy as np
from jaxtyping import Float

from glazejax import Glaze, Layer, Mixture, catalogue, colour
from glazejax.paint.describe import Coat

from ..film.model.mixing import Pigments
from ..film.model.variation import MIXED, Variation
from .model import StackModel, readings, readings_ahead
from .polish import polish
from .refine import grown, refine, refine_ahead
from .screen import MOST_SCREENED, Stacks, TargetArrays, screen
from .selection import IN_GAMUT, Scored, round_recipes, score, select, simplify
from .targets import Target
from .task import RecipeOptions, RecipeTask, Wanted, as_targets, make_task

GROUP = 8
"""Targets that are refined at a time."""

# How many sets of paints a target keeps after the first look, by (layers, paints counted in each
# coat); and how many after a first refinement, and for the solver.
_KEEP = {(1, 1): 3, (1, 2): 12, (1, 3): 40, (2, 1): 8, (2, 2): 24, (2, 3): 40}
_KEPT = 8


@dataclass(frozen=True, eq=False)
class Recipe:
    """A glaze that comes near a target, in round numbers.

    Attributes:
        target: what it is for.
        coats: top first; shares of paints to 0.1 %, thickness in m to 0.1 micrometres.
        glaze: the same, for `glazejax.reflectance`.
        wavelengths, reflectance: (bands,), nm, and what the instrument reads on it.
        lab: L*a*b* by illuminant, (3,).
        delta_e: Delta E 2000 to the target by illuminant.
        unrounded: largest Delta E 2000 before its numbers were rounded.
        metamerism: Delta E 2000 under the test illuminant, or None if the target's colour there is
            not known.
        test_illuminant: full name.
        rmse: root mean squared difference to the target's spectrum, or None without one.
        sensitivity: for each coat, Delta E 2000 of the colour when that coat alone is 10 % thicker
            or thinner.
        between_mixings: mean Delta E 2000 to be expected from one mixing to the next, by the
            strength that paints have in one film beside others (`glazefit.film.model.variation`).
        gamut_distance: the least Delta E 2000 found for the target if that is 1 or more, else 0.
        limit: what keeps a target out of reach: "paints", or a coat at a bound of thickness; "" if
            in reach.
        converged: whether least squares came to an end; if not, other amounts of the same paints
            may come nearer.
        steps: of least squares by the solver.
        before: largest Delta E 2000 before these steps, at the amounts that the table led to.
        mixed: the nearest recipe with paints mixed within its coats, beside one of unmixed coats;
            else None.
    """

    target: Target
    coats: tuple[Coat, ...]
    glaze: Glaze
    wavelengths: Float[np.ndarray, "bands"]
    reflectance: Float[np.ndarray, "bands"]
    lab: Mapping[str, Float[np.ndarray, "3"]]
    delta_e: Mapping[str, float]
    unrounded: float
    metamerism: float | None
    test_illuminant: str
    rmse: float | None
    sensitivity: tuple[float, ...]
    between_mixings: float
    gamut_distance: float = 0.0
    limit: str = ""
    converged: bool = True
    steps: int = 0
    before: float = np.nan
    mixed: "Recipe | None" = None

    @property
    def cautions(self) -> dict[str, str]:
        """Paints of it that are poisonous or hard to buy, and which, in words
        (`glazejax.catalogue.caution`).
        """
        media = [layer.medium for layer in self.glaze.coats]
        paints = [p for m in media for p in (m.pigments if isinstance(m, Mixture) else [m])]
        found = {paint.name: catalogue.caution(paint) for paint in paints}
        return {name: words for name, words in found.items() if words}

    @property
    def in_gamut(self) -> bool:
        """Whether the paints reach the target: a recipe was found below a Delta E 2000 of 1."""
        return self.gamut_distance == 0

    @property
    def distance(self) -> float:
        """Largest Delta E 2000 under the illuminants asked for."""
        return max(self.delta_e.values())

    @property
    def paints(self) -> tuple[str, ...]:
        """Paints in it, in order of appearance from the top."""
        return tuple(dict.fromkeys(name for coat in self.coats for _, name in coat.parts))

    @property
    def text(self) -> str:
        """The glaze as `glazejax render --coats` takes it."""
        return ", ".join(map(_type_coat, self.coats))

    def __repr__(self) -> str:
        return f"Recipe({self.text!r} for {self.target.name!r}, Delta E {self.distance:.2f})"


def _type_coat(coat: Coat) -> str:
    """A coat as `glazejax.paint.describe.parse_coats` reads it."""
    mixed = " + ".join(f"{share:.6g}*{name}" for share, name in coat.parts)
    return f"{mixed if len(coat.parts) > 1 else coat.name}:{coat.thickness * 1e6:.6g}um"


@overload
def find_recipes(
    target: Wanted, pigments: Pigments | None = None, **options: Unpack[RecipeOptions]
) -> list[Recipe]: ...
@overload
def find_recipes(
    target: Sequence[Wanted], pigments: Pigments | None = None, **options: Unpack[RecipeOptions]
) -> list[list[Recipe]]: ...
def find_recipes(
    target: Wanted | Sequence[Wanted],
    pigments: Pigments | None = None,
    **options: Unpack[RecipeOptions],
) -> list[Recipe] | list[list[Recipe]]:
    """The best few different glazes for a colour or a spectrum, or for many at once.

    Args:
        target: L*a*b* under D65, (3,); a mapping from illuminants to such colours; or what
            `lab_target`,
            `srgb_target`, `spectral_target` or `colourchecker_targets` make. A list of them is a
            batch.
        pigments: mapping or sequence; the catalogue if left out.
        ground: internal reflectance below the paint, scalar or (bands,) on the pigments'
            wavelengths; 0.9 if left out.
        instrument: how the colour is seen, see `glazejax.geometry.resolve_instrument`; 45:0 if left
            out: no mirror reflection.
        refractive_index: of all coats, where `instrument` is no whole one.
        illuminants: to match the colour under; those a colour is given under, or D65, if left out.
        test_illuminant: under which metamerism is reported; A if left out.
        observer: 2, 10, or a full name; 2 if left out.
        max_paints: different paints in a recipe, at most; 1 to 6. 3 if left out, of glazes 6.
        max_coats: coats, at most; 1 to 4, of glazes 1 to 6. 2 if left out, of glazes 6.
        glazes: nothing is mixed: each coat is one paint as it is. `Recipe.mixed` says what mixing
            would gain.
        thickness: of the thinnest and the thickest coat, m; 1 to 50 um if left out.
        count: how many recipes a target gets, at most; 5 if left out. They differ in their paints
            or in the order of the coats.
        metamerism: Delta E that a root mean squared difference of 0.01 from the target's spectrum
            weighs; 0.2 if left out.
        simplicity: Delta E that one more paint, or one more coat, must gain to be worth it; 0.3 if
            left out.
        seed: of the points from which mixtures of three paints start.

    Returns:
        A list of `Recipe`, best first: those below a Delta E of 1 before others. For a batch, one
        such list a target.

    Raises:
        ValueError: an argument out of range; the message names it, the value and the fix.
    """
    targets, batch = as_targets(target)
    task = make_task(targets, pigments, **options)
    found = [recipes for group in recipe_chunks(task) for recipes in group]
    return found if batch else found[0]


def recipe_chunks(task: RecipeTask) -> Iterator[list[list[Recipe]]]:
    """Recipes for a few targets at a time, so that progress can be shown and an interrupt loses
    little.
    """
    if not task.glazes:
        yield from _search(task)
        return
    for pure, mixed in zip(_search(task), _search(task.mixed), strict=True):
        nearest = [min(recipes, key=lambda one: one.distance) for recipes in mixed]
        yield [
            [replace(one, mixed=best) for one in own]
            for own, best in zip(pure, nearest, strict=True)
        ]


def _search(task: RecipeTask) -> Iterator[list[list[Recipe]]]:
    """Recipes for a few targets at a time, of mixed coats or of unmixed ones."""
    model = task.model()
    aims = task.target_arrays()

    # While the first look is compiled and taken, another thread compiles what comes after it.
    refine_ahead(model, aims, task.slots, task.max_coats)
    readings_ahead(model, task.solver, task.max_coats)

    def keep(coats: int, paints: int) -> int:
        return _KEEP[coats, paints]

    rough = screen(
        model,
        aims,
        max_paints=task.max_paints,
        max_coats=task.max_coats,
        keep=keep,
        seed=task.seed,
        mixed=not task.glazes,
    )
    for first in range(0, len(task.targets), GROUP):
        here = range(first, min(first + GROUP, len(task.targets)))
        stacks = _refine(task, model, aims, rough.take(np.flatnonzero(np.isin(rough.target, here))))
        yield _finish(task, model, aims, stacks, here)


def _refine(task: RecipeTask, model: StackModel, aims: TargetArrays, rough: Stacks) -> Stacks:
    """The best stacks that come of a first look."""

    def better(stacks: Stacks) -> Stacks:
        return refine(model, aims, stacks, task.slots)

    stacks = better(better(rough).best(lambda coats, paints: _KEPT))
    more = 0 if task.glazes else max(0, task.max_paints - MOST_SCREENED)
    for number in range(more + max(0, task.max_coats - 2)):
        # Of unmixed stacks those of one coat less are all that a coat can be added to anew.
        last = stacks.take(np.flatnonzero(stacks.coats == number + 2)) if task.glazes else stacks
        # A few grow, into very many: most of these are dropped before a refinement.
        parents = last.best(lambda coats, paints: 4)
        children = grown(
            model,
            aims,
            parents,
            max_paints=task.max_paints,
            max_coats=task.max_coats,
            mixed=not task.glazes,
        )
        children = better(children.best(lambda coats, paints: 24))
        stacks = Stacks.join([stacks, better(children.best(lambda coats, paints: _KEPT))])
    pool = Stacks.join([stacks, better(simplify(model, stacks))])
    # What the table puts first, at the best amounts by the solver itself.
    # Unmixed stacks are of more kinds.
    kept = 4 if task.glazes else _KEPT
    return polish(model, task.solver, aims, pool.best(lambda coats, paints: kept))


def _finish(
    task: RecipeTask, model: StackModel, aims: TargetArrays, stacks: Stacks, targets: range
) -> list[list[Recipe]]:
    """Choose, round and describe the recipes of some targets."""
    scored = score(model, task.solver, aims, stacks)
    exact = []
    for target in targets:
        own = [one for one, owner in zip(scored, stacks.target, strict=True) if owner == target]
        # More than asked for are rounded, because a few lose their colour by it.
        exact += [(target, one) for one in select(own, 3 * task.count, task.simplicity)]
    round_ones = round_recipes(model, task.solver, aims, exact, task.simplicity)
    recipes = []
    for target in targets:
        pairs = {
            id(new): old
            for (owner, old), new in zip(exact, round_ones, strict=True)
            if owner == target
        }
        own = [new for (owner, _), new in zip(exact, round_ones, strict=True) if owner == target]
        best = select(own, task.count, task.simplicity)
        recipes.append(_describe(task, model, target, [(one, pairs[id(one)]) for one in best]))
    return recipes


def _describe(
    task: RecipeTask, model: StackModel, target: int, chosen: list[tuple[Scored, Scored]]
) -> list[Recipe]:
    """Recipes from what was chosen, each with the same before it was rounded."""
    aim = task.targets[target]
    recipes = []
    effects = _thickness_effects(task, model, aim, [one for one, _ in chosen])
    between = _between_mixings(task, model, [one for one, _ in chosen])
    for (one, exact), (sensitivity, _), mixing in zip(chosen, effects, between, strict=True):
        recipes.append(_recipe(task, aim, one, exact, sensitivity, mixing))
    nearest = min(one.distance for one, _ in chosen)
    if nearest < IN_GAMUT:
        return recipes
    limit = effects[int(np.argmin([one.distance for one, _ in chosen]))][1]
    return [replace(recipe, gamut_distance=nearest, limit=limit) for recipe in recipes]


def _recipe(
    task: RecipeTask,
    aim: Target,
    one: Scored,
    exact: Scored,
    sensitivity: tuple[float, ...],
    between_mixings: float,
) -> Recipe:
    coats = []
    layers = []
    for sizes in one.sizes:
        total = float(sizes.sum())
        if total == 0:
            continue
        present = sorted(np.flatnonzero(sizes > 0).tolist(), key=lambda paint: -sizes[paint])
        shares = [round(float(sizes[paint] / total), 9) for paint in present]
        metres = round(total * 1e-6, 15)
        paints = [task.pigments[paint] for paint in present]
        layers.append(Layer(Mixture(paints, shares) if len(paints) > 1 else paints[0], metres))
        coats.append(Coat(tuple(zip(shares, (p.name for p in paints), strict=True)), metres, 1))

    def lab(illuminant: str) -> Float[np.ndarray, "3"]:
        return np.asarray(
            colour.lab(task.wavelengths, one.reading, illuminant=illuminant, observer=task.observer)
        )

    test = None
    rmse = None
    if aim.knows(task.test_illuminant):
        there = aim.lab(task.test_illuminant, task.observer)
        test = float(colour.delta_e_2000(lab(task.test_illuminant), there))
    if aim.wavelengths is not None and aim.reflectance is not None:
        wanted = np.interp(task.wavelengths, aim.wavelengths, aim.reflectance)
        rmse = float(np.sqrt(np.mean((one.reading - wanted) ** 2)))
    return Recipe(
        target=aim,
        coats=tuple(coats),
        glaze=Glaze(layers, task.ground, task.instrument.refractive_index),
        wavelengths=task.wavelengths,
        reflectance=one.reading,
        lab={name: lab(name) for name in task.illuminants},
        delta_e=dict(zip(task.illuminants, one.delta_e.tolist(), strict=True)),
        unrounded=exact.distance,
        metamerism=test,
        test_illuminant=task.test_illuminant,
        rmse=rmse,
        sensitivity=sensitivity,
        between_mixings=between_mixings,
        converged=exact.settled,
        steps=exact.steps,
        before=exact.before,
    )


def _thickness_effects(
    task: RecipeTask, model: StackModel, aim: Target, chosen: list[Scored]
) -> list[tuple[tuple[float, ...], str]]:
    """For each recipe, what 10 % of each coat's thickness does to the colour, and what keeps it
    from the target.
    """
    light = task.illuminants[0]
    sizes = []
    places = []
    for row, one in enumerate(chosen):
        for coat in range(one.coats):
            for factor in (1.1, 1 / 1.1):
                other = one.sizes.copy()
                other[coat] *= factor
                sizes.append(other)
                places.append((row, coat))
    reading = readings(model, np.stack(sizes), task.solver)
    labs = np.asarray(
        colour.lab(task.wavelengths, reading, illuminant=light, observer=task.observer)
    )
    wanted = aim.lab(light, task.observer)
    effects = []
    for row, one in enumerate(chosen):
        own = np.asarray(
            colour.lab(task.wavelengths, one.reading, illuminant=light, observer=task.observer)
        )
        moved = labs[[place[0] == row for place in places]].reshape(one.coats, 2, 3)
        sensitivity = colour.delta_e_2000(moved, own).mean(axis=1)
        distance = colour.delta_e_2000(own, wanted)
        limits = [
            f"coat {coat + 1} is as {'thick' if side == 0 else 'thin'} as allowed"
            for coat in range(one.coats)
            for side in (0, 1)
            if _at_bound(one.sizes[coat].sum(), task.thickness[1 - side])
            and colour.delta_e_2000(moved[coat, side], wanted)
            < distance - max(0.05, 0.01 * distance)
        ]
        effects.append((tuple(sensitivity.tolist()), ", ".join(limits) or "paints"))
    return effects


def _between_mixings(task: RecipeTask, model: StackModel, chosen: list[Scored]) -> list[float]:
    """Mean Delta E 2000 between two mixings of each recipe, whose paints come out stronger or
    weaker each time.

    To first order: what one paint of a coat does to the colour when it is stronger by a standard
    deviation.
    """
    light = task.illuminants[0]
    spread = MIXED.level * Variation().size_of([])
    places = [
        (row, coat, paint)
        for row, one in enumerate(chosen)
        for coat, paint in np.argwhere(one.sizes > 0).tolist()
    ]
    stronger = np.stack([chosen[row].sizes for row, _, _ in places])
    for number, (_, coat, paint) in enumerate(places):
        stronger[number, coat, paint] *= np.exp(spread)
    labs, own = (
        np.asarray(colour.lab(task.wavelengths, reading, illuminant=light, observer=task.observer))
        for reading in (
            readings(model, stronger, task.solver),
            np.stack([one.reading for one in chosen]),
        )
    )
    rng = np.random.default_rng(0)
    found = []
    for row in range(len(chosen)):
        moves = labs[[place[0] == row for place in places]] - own[row]
        # Pairs of mixings that are compared.
        two = own[row] + rng.standard_normal((2, 200, len(moves))) @ moves
        found.append(float(np.mean(colour.delta_e_2000(two[0], two[1]))))
    return found


def _at_bound(size: float, bound: float) -> bool:
    """Whether a thickness in um is within 5 % or a rounding step of a bound in m."""
    return bool(abs(size - bound * 1e6) < max(0.05 * bound * 1e6, 0.11))
