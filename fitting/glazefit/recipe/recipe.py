"""Recipes: which paints, in which order and how thick, give a colour or a spectrum.

All sets of up to three paints in one coat or two are looked at on a coarse grid
(`glazefit.recipe.screen`), the best are refined by Levenberg-Marquardt on a table, more paints or
coats are added where allowed, what remains is simplified, and its last steps follow the solver's
own readings and slopes (`glazefit.recipe.refine`). Then it is rounded to what a painter can weigh
and measure, and put in order (`glazefit.recipe.selection`).
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack, overload

import numpy as np
from jaxtyping import Float

from glazejax import Glaze, Layer, Mixture, catalogue, colour
from glazejax.paint.describe import Coat
from glazejax.paint.media import make_media
from glazejax.progress import Progress, counted, no_progress

from ..film.model.mixing import Pigments
from ..film.model.variation import STRENGTH
from ..film.tables import WAVELENGTH, Tabulated, Variables, as_frame
from .model import OneStack, Sizes, read, read_ahead
from .parts import parts_by_paint
from .refine import improve, refinements
from .screen import Stacks, screen
from .selection import IN_GAMUT, round_recipes, select
from .targets import Bands, Lab, Target, TargetLike, as_targets
from .task import RecipeOptions, RecipeTask, make_task

PAINT_COLUMNS = ("coat", "thickness_um", "paint", "share", "parts", "delta_e_per_10_percent")
"""Of a recipe's paints."""

# Targets whose recipes are refined together.
_GROUP = 8


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
        limit: what keeps this recipe from a target out of reach: "paints", or a coat of it at a
            bound of thickness; "" if the target is in reach.
        converged: whether least squares came to an end; if not, other amounts of the same paints
            may come nearer.
        steps: of least squares by the solver.
        before: largest Delta E 2000 before these steps, at the amounts that the table led to.
        mixed: the nearest recipe with paints mixed within its coats, to compare with one of unmixed
            coats; else None.
        observer: full name, by whom the colours are seen.
    """

    target: Target
    coats: tuple[Coat, ...]
    glaze: Glaze
    wavelengths: Bands
    reflectance: Bands
    lab: Mapping[str, Lab]
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
    observer: str = colour.CIE_1931

    @property
    def cautions(self) -> dict[str, str]:
        """Paints of it that are poisonous or hard to buy, and which, in words
        (`glazejax.catalogue.caution`).
        """
        media = [layer.medium for layer in self.glaze.coats]
        paints = [p for m in media for p in (m.pigments if isinstance(m, Mixture) else [m])]
        return {p.name: caution for p in paints if (caution := catalogue.caution(p))}

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
            parts = parts_by_paint(coat)
            for share, paint in coat.parts:
                yield number, coat.thickness * 1e6, paint, share, parts[paint], change

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
    task: RecipeTask, progress: Progress = no_progress
) -> Iterator[list[list[Recipe]]]:
    """Recipes for a few targets at a time, so that an interrupt loses little.

    `progress` is called with the parts of each stage: blocks of sets of paints, then refinements.
    """
    if task.mixed is None:
        yield from _search(task, progress)
        return
    searches = _search(task, progress), _search(task.mixed, progress)
    for pure, mixed in zip(*searches, strict=True):
        nearest = [min(recipes, key=lambda recipe: recipe.distance) for recipes in mixed]
        yield [
            [replace(recipe, mixed=best) for recipe in recipes]
            for recipes, best in zip(pure, nearest, strict=True)
        ]


def _search(task: RecipeTask, progress: Progress) -> Iterator[list[list[Recipe]]]:
    """Recipes for a few targets at a time, of mixed coats or of unmixed ones."""
    # While the first look is compiled and taken, another thread compiles what comes after it.
    read_ahead(task.model, task.max_coats, task.optics)
    rough = screen(task, progress=progress)
    firsts = range(0, len(task.targets), _GROUP)
    # Of each group: every refinement, and the rounding.
    total = len(firsts) * (refinements(task) + 1)
    note = counted(progress, total, f"refining {'glazes' if task.glazes else 'recipes'}")
    for first in firsts:
        in_group = rough.target // _GROUP == first // _GROUP
        improved = improve(task, rough.take(np.flatnonzero(in_group)), note)
        # More than asked for are rounded, because a few lose their colour by it.
        rounded = round_recipes(task, select(task, improved, 3 * task.count))
        note()
        yield _describe(task, select(task, rounded, task.count))


def _describe(task: RecipeTask, chosen: Stacks) -> list[list[Recipe]]:
    """Recipes of some targets, and what their neighbours say of them: stacks with one coat thicker
    or thinner by a tenth, or with one paint stronger by a standard deviation of mixings.
    """
    near = [_neighbours(sizes) for sizes in chosen.sizes]
    owner = np.repeat(np.arange(chosen.size), [len(stacks) for stacks in near])
    # All are read together; their readings go back to the stack that they lie near.
    readings = read(task.model, np.concatenate(near), task.optics)
    recipes = [
        _recipe(
            task,
            chosen.take([row]),
            readings.spectrum[owner == row][0],
            readings.lab[owner == row],
        )
        for row in range(chosen.size)
    ]
    # One list a target.
    return [
        _with_gamut([recipes[row] for row in np.flatnonzero(chosen.target == target)])
        for target in np.unique(chosen.target)
    ]


def _neighbours(sizes: OneStack) -> Sizes:
    """A stack, then with each of its coats thicker and thinner, then with each paint in a coat
    stronger.
    """
    coats = np.flatnonzero(sizes.any(axis=1))
    changes: list[tuple[Any, float]] = list(itertools.product(coats, (1.1, 1 / 1.1)))
    changes += [(tuple(at), np.exp(STRENGTH)) for at in np.argwhere(sizes > 0)]
    near = np.repeat(sizes[None], 1 + len(changes), axis=0)
    for stack, (entry, factor) in zip(near[1:], changes, strict=True):
        stack[entry] *= factor
    return near


def _with_gamut(recipes: list[Recipe]) -> list[Recipe]:
    """Recipes of one target, which say by how much it is out of reach, and what keeps each of them
    from it, if it is.
    """
    nearest = min(recipe.distance for recipe in recipes)
    reached = nearest < IN_GAMUT
    distance = 0.0 if reached else nearest
    # A bound is of a coat, and coats are a recipe's own.
    return [
        replace(recipe, gamut_distance=distance, limit="" if reached else recipe.limit)
        for recipe in recipes
    ]


def _recipe(
    task: RecipeTask,
    stack: Stacks,
    reading: Bands,
    labs: Float[np.ndarray, "stacks lights 3"],
) -> Recipe:
    """A recipe, from the reading of a single stack and the colours of it and of its neighbours."""
    sizes = stack.sizes[0]
    number = stack.target[0]
    target = task.targets[number]
    goals = task.target_arrays.lab[number]
    delta_e = colour.delta_e_2000(labs[0], goals)
    coats = [_coat(amounts, task) for amounts in sizes[sizes.any(axis=1)]]
    media = make_media(coats, {paint.name: paint for paint in task.pigments})
    layers = [Layer(medium, coat.thickness) for medium, coat in zip(media, coats, strict=True)]
    glaze = Glaze(layers, task.ground, task.instrument.refractive_index)
    # Under the test illuminant, where the target's colour is known there.
    tested = None
    if target.spectral or task.test_illuminant in target.labs:
        light = {"illuminant": task.test_illuminant, "observer": task.observer}
        lab = colour.lab(task.wavelengths, reading, **light)
        tested = float(colour.delta_e_2000(lab, target.lab(**light)))
    miss = reading - task.target_arrays.spectrum[number]
    # Neighbours with a coat thicker and thinner come first.
    exact, *near = labs[:, 0]
    resized = np.reshape(near[: 2 * len(coats)], (-1, 2, 3))
    # A coat at a bound, within 5 % or a rounding step, that would come nearer beyond it.
    bounds = np.array(task.span)[::-1]
    thickness = np.array([[1e6 * coat.thickness] for coat in coats])
    gain = delta_e[0] - colour.delta_e_2000(resized, goals[0])
    limits = (np.abs(thickness - bounds) < np.maximum(0.05 * bounds, 0.11)) & (gain > 0.05)
    return Recipe(
        target=target,
        coats=tuple(coats),
        glaze=glaze,
        wavelengths=task.wavelengths,
        reflectance=reading,
        lab=dict(zip(task.illuminants, labs[0], strict=True)),
        delta_e=dict(zip(task.illuminants, delta_e.tolist(), strict=True)),
        unrounded=stack.unrounded.item(),
        metamerism=tested,
        test_illuminant=task.test_illuminant,
        rmse=float(np.sqrt(np.mean(miss**2))) if target.spectral else None,
        sensitivity=tuple(colour.delta_e_2000(resized, exact).mean(axis=1).tolist()),
        between_mixings=_between_mixings(exact, np.stack(near[2 * len(coats) :])),
        limit=", ".join(
            f"coat {coat + 1} is as {('thick', 'thin')[side]} as allowed"
            for coat, side in np.argwhere(limits)
        )
        or (f"no more than {_bounds(task)} is allowed" if task.is_narrow else "paints"),
        converged=stack.settled.item(),
        steps=stack.steps.item(),
        before=stack.before.item(),
        observer=task.observer,
    )


def _bounds(task: RecipeTask) -> str:
    """Paints and coats of a recipe at most, in words."""
    coats = f"{task.max_coats} coat{'s' if task.max_coats > 1 else ''}"
    return f"{task.max_paints} paint{'s' if task.max_paints > 1 else ''} in {coats}"


def _coat(amounts: Float[np.ndarray, "paints"], task: RecipeTask) -> Coat:
    """A coat of what paints take of it, um, the largest share first."""
    total = float(amounts.sum())
    order = np.argsort(-amounts, kind="stable").tolist()
    parts = tuple(
        (round(float(amounts[paint] / total), 9), task.pigments[paint].name)
        for paint in order
        if amounts[paint] > 0
    )
    return Coat(parts, round(total * 1e-6, 15), 1)


def _between_mixings(lab: Lab, stronger: Float[np.ndarray, "amounts 3"]) -> float:
    """Mean Delta E 2000 between two mixings, whose paints come out stronger or weaker each time: to
    first order, from the colours with one paint stronger by a standard deviation.
    """
    # Pairs of mixings that are compared.
    drawn = np.random.default_rng(0).standard_normal((2, 200, len(stronger)))
    first, second = lab + drawn @ (stronger - lab)
    return float(np.mean(colour.delta_e_2000(first, second)))
