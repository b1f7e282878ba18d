"""Recipes: which paints, in which order and how thick, give a colour or a spectrum.

All sets of up to three paints in one coat or two are looked at on a coarse grid
(`glazefit.recipe.screen`), the best are refined by Levenberg-Marquardt on a table
(`glazefit.recipe.refine`), more paints or coats are added where allowed, what remains is
simplified (`glazefit.recipe.stacks`), and its last steps follow the solver's own readings and
slopes. Then it is rounded to what a painter can weigh and measure, and put in order
(`glazefit.recipe.selection`).
"""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack, overload

import numpy as np
from jaxtyping import Float

from glazejax import Glaze, Layer, Mixture, catalogue, colour
from glazejax.paint.describe import Coat
from glazejax.progress import Progress, counted, no_progress

from ..film.model.mixing import Pigments
from ..film.model.optics import Optics
from ..film.model.variation import MIXED, Variation
from ..film.tables import WAVELENGTH, Tabulated, Variables, as_frame
from .model import read, read_ahead
from .parts import whole_parts
from .refine import refine
from .screen import MOST_SCREENED, screen
from .selection import IN_GAMUT, Scored, round_recipes, score, select
from .stacks import Stacks, grown, simplify
from .targets import Target, TargetLike
from .task import RecipeOptions, RecipeTask, as_targets, make_task

PAINT_COLUMNS = ("coat", "thickness_um", "paint", "share", "parts", "delta_e_per_10_percent")
"""Of a recipe's paints."""


@dataclass(frozen=True, eq=False)
class Recipe(Tabulated):
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
            strength that paints have in one film relative to others
            (`glazefit.film.model.variation`).
        gamut_distance: the least Delta E 2000 found for the target if that is 1 or more, else 0.
        limit: what keeps a target out of reach: "paints", or a coat at a bound of thickness; "" if
            in reach.
        converged: whether least squares came to an end; if not, other amounts of the same paints
            may come nearer.
        steps: of least squares by the solver.
        before: largest Delta E 2000 before these steps, at the amounts that the table led to.
        mixed: the nearest recipe with paints mixed within its coats, to compare with one of unmixed
            coats; else None.
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
        cautions = {paint.name: catalogue.caution(paint) for paint in paints}
        return {name: caution for name, caution in cautions.items() if caution}

    @property
    def in_gamut(self) -> bool:
        """True if the paints reach the target: a recipe was found below a Delta E 2000 of 1."""
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

    def rows(self) -> Iterator[tuple[int, float, str, float, int, float]]:
        """`PAINT_COLUMNS` of each paint in each coat, top first."""
        coats = zip(self.coats, self.sensitivity, strict=True)
        for number, (coat, change) in enumerate(coats, 1):
            proportions = whole_parts([share for share, _ in coat.parts])
            for (share, paint), proportion in zip(coat.parts, proportions, strict=True):
                yield number, coat.thickness * 1e6, paint, share, proportion, change

    def to_dataframe(self) -> Any:
        """A pandas.DataFrame with a row for each paint in each coat, top first; thickness in
        micrometres, shares by weight.

        Raises:
            ModuleNotFoundError: pandas is not installed.
        """
        return as_frame(PAINT_COLUMNS, self.rows())

    def arrays_and_axes(self) -> Variables:
        """Reading of the instrument."""
        axes = {WAVELENGTH: self.wavelengths}
        return {"reflectance": (tuple(axes), self.reflectance)}, axes

    def __repr__(self) -> str:
        return f"Recipe({self.text!r} for {self.target.name!r}, Delta E {self.distance:.2f})"


def _type_coat(coat: Coat) -> str:
    """A coat as `glazejax.paint.describe.parse_coats` reads it."""
    mixed = " + ".join(f"{share:.6g}*{name}" for share, name in coat.parts)
    return f"{mixed if len(coat.parts) > 1 else coat.name}:{coat.thickness * 1e6:.6g}um"


@overload
def find_recipes(
    target: TargetLike, pigments: Pigments | None = None, **options: Unpack[RecipeOptions]
) -> list[Recipe]: ...
@overload
def find_recipes(
    target: Sequence[TargetLike],
    pigments: Pigments | None = None,
    **options: Unpack[RecipeOptions],
) -> list[list[Recipe]]: ...
def find_recipes(
    target: TargetLike | Sequence[TargetLike],
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
    recipe_lists = [recipes for group in recipe_chunks(task) for recipes in group]
    return recipe_lists if batch else recipe_lists[0]


def recipe_chunks(
    task: RecipeTask, group: int = 8, progress: Progress = no_progress
) -> Iterator[list[list[Recipe]]]:
    """Recipes for a few targets at a time, so that an interrupt loses little.

    `progress` is called with the parts of each stage: blocks of sets of paints, then refinements.
    """
    if not task.glazes:
        yield from _search(task, group, progress)
        return
    searches = (_search(each, group, progress) for each in (task, task.mixed))
    for pure, mixed in zip(*searches, strict=True):
        nearest = [min(recipes, key=lambda recipe: recipe.distance) for recipes in mixed]
        yield [
            [replace(recipe, mixed=best) for recipe in recipes]
            for recipes, best in zip(pure, nearest, strict=True)
        ]


def _search(task: RecipeTask, group: int, progress: Progress) -> Iterator[list[list[Recipe]]]:
    """Recipes for a few targets at a time, of mixed coats or of unmixed ones."""
    # While the first look is compiled and taken, another thread compiles what comes after it.
    read_ahead(task.model, task.max_coats, task.optics)
    rough = screen(task, progress=progress)
    firsts = range(0, len(task.targets), group)
    # Of each group: every refinement, and the rounding.
    total = len(firsts) * (2 * _growths(task) + 5)
    note = counted(progress, total, f"refining {'glazes' if task.glazes else 'recipes'}")
    for first in firsts:
        in_group = (rough.target >= first) & (rough.target < first + group)
        stacks = _refine(task, rough.take(np.flatnonzero(in_group)), note)
        # More than asked for are rounded, because a few lose their colour by it.
        exact = [select(scored, 3 * task.count, task.simplicity) for scored in score(task, stacks)]
        chosen = [
            select(scored, task.count, task.simplicity) for scored in round_recipes(task, exact)
        ]
        note()
        yield _describe(task, chosen)


def _growths(task: RecipeTask) -> int:
    """Paints and coats that are added, one at a time, to what a first look finds."""
    extra_paints = 0 if task.glazes else max(0, task.max_paints - MOST_SCREENED)
    return extra_paints + max(0, task.max_coats - 2)


def _refine(task: RecipeTask, rough: Stacks, note: Callable[[], object]) -> Stacks:
    """The best stacks that come of a first look; `note` is called after each refinement."""

    def improve(stacks: Stacks, optics: Optics | None = None, max_steps: int = 40) -> Stacks:
        improved = refine(task, stacks, optics, max_steps)
        note()
        return improved

    # A few steps show which are worth more.
    count = 8
    stacks = improve(improve(rough, max_steps=12).best(count))
    for number in range(_growths(task)):
        # Of unmixed stacks those of one coat less are the only ones to which a coat can be added.
        last = stacks.take(np.flatnonzero(stacks.coats == number + 2)) if task.glazes else stacks
        # A few grow, into very many: most of these are dropped before a refinement.
        children = improve(grown(task, last.best(4)).best(24), max_steps=12)
        stacks = Stacks.join([stacks, improve(children.best(count))])
    pool = Stacks.join([stacks, improve(simplify(task, stacks))])
    # What the table puts first, at the best amounts by the solver itself. Unmixed stacks are of
    # more kinds.
    return improve(pool.best(4 if task.glazes else count), task.optics)


def _describe(task: RecipeTask, chosen: list[list[Scored]]) -> list[list[Recipe]]:
    """Recipes of some targets, and what their neighbours say of them: stacks with one coat thicker
    or thinner by a tenth, or with one paint stronger by a standard deviation of mixings.
    """
    stronger = np.exp(MIXED.level * Variation().size_of([]))
    scored = list(itertools.chain.from_iterable(chosen))
    # Near each stack: each coat thicker and thinner, then each paint in a coat stronger.
    near = [
        [
            _scaled(stack.sizes, coat, factor)
            for coat in range(stack.coats)
            for factor in (1.1, 1 / 1.1)
        ]
        + [_scaled(stack.sizes, tuple(at), stronger) for at in np.argwhere(stack.sizes > 0)]
        for stack in scored
    ]
    # All are read together; their colours go back to the stack that they lie near.
    labs = read(task.model, np.stack([*itertools.chain.from_iterable(near)]), task.optics).lab[:, 0]
    colours = np.split(labs, np.cumsum([len(stacks) for stacks in near])[:-1])
    recipes = map(_recipe, itertools.repeat(task), scored, colours)
    # One list a target, as they came.
    return [_with_gamut(list(itertools.islice(recipes, len(group)))) for group in chosen]


def _scaled(sizes: Float[np.ndarray, "coats paints"], index: int | tuple, factor: float):
    """A stack with a coat, or a paint in a coat, so many times as thick."""
    scaled = sizes.copy()
    scaled[index] *= factor
    return scaled


def _with_gamut(recipes: list[Recipe]) -> list[Recipe]:
    """Recipes of one target, which say by how much and why it is out of reach, if it is."""
    nearest = min(recipes, key=lambda recipe: recipe.distance)
    if nearest.distance < IN_GAMUT:
        return [replace(recipe, limit="") for recipe in recipes]
    return [
        replace(recipe, gamut_distance=nearest.distance, limit=nearest.limit) for recipe in recipes
    ]


def _recipe(task: RecipeTask, scored: Scored, near: Float[np.ndarray, "stacks 3"]) -> Recipe:
    """A recipe, from the colours of its neighbours under the first light."""
    target = task.targets[scored.target]
    # The coats from the top, the largest share of each first.
    coats = []
    layers = []
    for sizes in scored.sizes[: scored.coats]:
        total = float(sizes.sum())
        present = sorted(np.flatnonzero(sizes > 0).tolist(), key=lambda paint: -sizes[paint])
        shares = [round(float(sizes[paint] / total), 9) for paint in present]
        metres = round(total * 1e-6, 15)
        paints = [task.pigments[paint] for paint in present]
        layers.append(Layer(Mixture(paints, shares) if len(paints) > 1 else paints[0], metres))
        coats.append(Coat(tuple(zip(shares, (p.name for p in paints), strict=True)), metres, 1))
    # Under the test illuminant, where the target's colour is known there.
    tested = None
    if target.knows(task.test_illuminant):
        light = {"illuminant": task.test_illuminant, "observer": task.observer}
        lab = colour.lab(task.wavelengths, scored.reading, **light)
        tested = float(colour.delta_e_2000(lab, target.lab(**light)))
    miss = scored.reading - task.target_arrays.spectrum[scored.target]
    # Neighbours with a coat thicker and thinner come first.
    resized = near[: 2 * scored.coats].reshape(scored.coats, 2, 3)
    return Recipe(
        target=target,
        coats=tuple(coats),
        glaze=Glaze(layers, task.ground, task.instrument.refractive_index),
        wavelengths=task.wavelengths,
        reflectance=scored.reading,
        lab=dict(zip(task.illuminants, scored.lab, strict=True)),
        delta_e=dict(zip(task.illuminants, scored.delta_e.tolist(), strict=True)),
        unrounded=scored.unrounded,
        metamerism=tested,
        test_illuminant=task.test_illuminant,
        rmse=float(np.sqrt(np.mean(miss**2))) if target.spectral else None,
        sensitivity=tuple(colour.delta_e_2000(resized, scored.lab[0]).mean(axis=1).tolist()),
        between_mixings=_between_mixings(scored.lab[0], near[2 * scored.coats :]),
        limit=_limit(task, scored, resized),
        converged=scored.settled,
        steps=scored.steps,
        before=scored.before,
    )


def _limit(task: RecipeTask, scored: Scored, resized: Float[np.ndarray, "coats 2 3"]) -> str:
    """Name what keeps a stack from its target: coats at a bound that would come nearer beyond it,
    or the paints.
    """
    distances = colour.delta_e_2000(resized, task.target_arrays.lab[scored.target, 0])
    limits = []
    for coat, side in itertools.product(range(scored.coats), (0, 1)):
        bound = task.thickness[1 - side] * 1e6
        # Within 5 % or a rounding step of the bound.
        at_bound = abs(scored.sizes[coat].sum() - bound) < max(0.05 * bound, 0.11)
        gain = scored.delta_e[0] - distances[coat, side]
        if at_bound and gain > max(0.05, 0.01 * scored.delta_e[0]):
            limits.append(f"coat {coat + 1} is as {'thin' if side else 'thick'} as allowed")
    return ", ".join(limits) or "paints"


def _between_mixings(
    lab: Float[np.ndarray, "3"], stronger: Float[np.ndarray, "amounts 3"]
) -> float:
    """Mean Delta E 2000 between two mixings, whose paints come out stronger or weaker each time: to
    first order, from the colours with one paint stronger by a standard deviation.
    """
    # Pairs of mixings that are compared.
    drawn = np.random.default_rng(0).standard_normal((2, 200, len(stronger)))
    first, second = lab + drawn @ (stronger - lab)
    return float(np.mean(colour.delta_e_2000(first, second)))
