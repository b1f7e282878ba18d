"""Stacks on their way to a recipe: many as arrays, and the moves from one to another, simpler or
richer.
"""

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from glazejax.colour import delta_e_2000

from .model import StackModel, read
from .task import RecipeTask


class Stacks(NamedTuple):
    """Stacks that may become recipes, (n,)."""

    sizes: Float[np.ndarray, "n coats paints"]  # what each paint takes of each coat's thickness, um
    target: Int[np.ndarray, "n"]
    cost: Float[np.ndarray, "n"]  # squared distance
    settled: Bool[np.ndarray, "n"]  # whether the last least squares came to an end
    steps: Int[np.ndarray, "n"]  # of the last least squares
    before: Float[np.ndarray, "n"]  # largest Delta E 2000 before these steps; NaN without them

    @classmethod
    def before_refinement(cls, sizes: np.ndarray, target: np.ndarray, cost: np.ndarray) -> "Stacks":
        """Stacks that no least squares has seen."""
        none = len(target)
        return cls(
            sizes=sizes,
            target=target,
            cost=cost,
            settled=np.zeros(none, bool),
            steps=np.zeros(none, int),
            before=np.full(none, np.nan),
        )

    @property
    def size(self) -> int:
        """Number of stacks."""
        return len(self.target)

    @property
    def coats(self) -> Int[np.ndarray, "n"]:
        """Number of coats that are there."""
        return self.sizes.any(axis=2).sum(axis=1)

    @property
    def paints(self) -> Int[np.ndarray, "n"]:
        """Number of different paints."""
        return self.sizes.any(axis=1).sum(axis=1)

    def take(self, rows: Int[np.ndarray, "m"]) -> "Stacks":
        """Some of them."""
        return Stacks(*(values[rows] for values in self))

    def best(self, count: int) -> "Stacks":
        """The `count` of least cost for each target, by number of coats and paints; of stacks with
        the same paints in the same coats only the best.
        """
        kinds = np.stack([self.target, self.coats, self.paints], axis=1).tolist()
        chosen = []
        layouts = set()
        counts: Counter[tuple[int, ...]] = Counter()
        for row in np.argsort(self.cost, kind="stable").tolist():
            kind = tuple(kinds[row])
            layout = (kind, (self.sizes[row] > 0).tobytes())
            if counts[kind] < count and layout not in layouts:
                counts[kind] += 1
                layouts.add(layout)
                chosen.append(row)
        return self.take(np.array(sorted(chosen), int))

    @staticmethod
    def join(groups: "Sequence[Stacks]") -> "Stacks":
        """All of several."""
        return Stacks(*(np.concatenate(values) for values in zip(*groups, strict=True)))


def strength(model: StackModel) -> Float[np.ndarray, "paints"]:
    """Strength of each paint, 1/um: how much a little of it shows, by its absorption, or by its
    scattering where it is pale.
    """
    return np.mean(np.asarray(model.absorption) + 0.1 * np.asarray(model.scattering), axis=1) + 1e-9


def pack_coats(sizes: Float[np.ndarray, "n coats paints"]) -> Float[np.ndarray, "n coats paints"]:
    """Stacks with their empty coats last."""
    order = np.argsort(~sizes.any(axis=2), axis=1, kind="stable")
    return np.take_along_axis(sizes, order[:, :, None], axis=1)


def merge_coats(
    sizes: Float[np.ndarray, "n coats paints"], thickest: float
) -> Float[np.ndarray, "n coats paints"]:
    """Stacks where neighbours of one and the same paint are one coat, if that is no thicker than
    allowed, um.
    """
    sizes = sizes.copy()
    for stack in sizes:
        for upper, lower in itertools.pairwise(stack):
            alone = (upper > 0).sum() == 1 and np.array_equal(upper > 0, lower > 0)
            if alone and upper.sum() + lower.sum() <= thickest:
                lower += upper
                upper[:] = 0.0
    return pack_coats(sizes)


def simplify(task: RecipeTask, stacks: Stacks) -> Stacks:
    """Stacks without the paints that are hardly in them and the coats that hardly show: fewer, to
    be refined again.
    """
    share = stacks.sizes / np.maximum(stacks.sizes.sum(axis=2, keepdims=True), 1e-12)
    # A paint that is less than this of its coat is tried without.
    sizes = np.where(share < 0.01, 0.0, stacks.sizes)
    labs = read(task.model, sizes, None).lab[:, 0]
    for coat in range(sizes.shape[1]):
        without = sizes.copy()
        without[:, coat] = 0.0
        # A coat that changes the colour less than this is tried without.
        unseen = delta_e_2000(read(task.model, without, None).lab[:, 0], labs) < 0.1
        unseen &= without.any(axis=(1, 2)) & sizes[:, coat].any(axis=1)
        sizes[unseen] = without[unseen]
    changed = np.flatnonzero(((sizes > 0) != (stacks.sizes > 0)).any(axis=(1, 2)))
    simple = merge_coats(pack_coats(sizes[changed]), float(np.exp(task.model.span[1])))
    return Stacks.before_refinement(simple, stacks.target[changed], stacks.cost[changed])


def grown(task: RecipeTask, parents: Stacks) -> Stacks:
    """Every stack with one more paint in a coat, or one more coat on top or at the bottom (of
    glazes between two others, too), with its cost by the table.
    """
    children = [list(enlargements(task, stack)) for stack in parents.sizes]
    target = np.repeat(parents.target, [len(offspring) for offspring in children])
    if target.size == 0:
        return parents.take(target)
    sizes = pack_coats(np.stack(list(itertools.chain.from_iterable(children))))
    readings = read(task.model, sizes, None)
    cost = task.target_arrays.distances(target, readings.spectrum, readings.lab)[1]
    return Stacks.before_refinement(sizes, target, cost)


def enlargements(
    task: RecipeTask, stack: Float[np.ndarray, "coats paints"]
) -> Iterator[Float[np.ndarray, "coats paints"]]:
    """Stacks with one paint or one coat more, within the limits of the search."""
    power = strength(task.model)
    present = stack.sum(axis=0) > 0
    filled = np.count_nonzero(stack.any(axis=1))
    positions = range(filled + 1) if task.glazes else (0, filled)
    for paint in range(stack.shape[1]):
        if not present[paint] and np.count_nonzero(present) >= task.max_paints:
            continue
        for coat in () if task.glazes else range(filled):
            if stack[coat, paint] > 0:
                continue
            child = stack.copy()
            # An added paint gets this share of a coat's strength.
            child[coat, paint] = 0.15 * (stack[coat] @ power) / power[paint]
            child[coat] *= stack[coat].sum() / child[coat].sum()
            yield child
        # An added coat starts thin or half-way between thinnest and thickest.
        for fraction in (0.15, 0.5) if filled < task.max_coats else ():
            coat = np.zeros(stack.shape[1])
            coat[paint] = np.exp(task.model.span @ [1.0 - fraction, fraction])
            for at in positions:
                # The same paint twice in a row would be one thicker coat.
                if not any(_only(near, paint) for near in stack[max(at - 1, 0) : at + 1]):
                    yield np.concatenate([stack[:at], coat[None], stack[at:-1]])


def _only(coat: Float[np.ndarray, "paints"], paint: int) -> bool:
    """True if a coat is of this paint and of no other."""
    return bool(coat[paint] > 0 and (coat > 0).sum() == 1)
