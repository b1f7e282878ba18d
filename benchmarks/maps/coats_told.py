"""How much of two coats a map can tell: films drawn from what it expects, and a painting's pixels
beside all stacks that come near.

    python -m benchmarks.maps.coats_told [--films 160] [--pixels 40]

First: films are drawn from the map's own expectation, as many of one coat as of two, and read with
errors of their paints, of the surface and of the instrument. By how many stacks of each spectrum
are fitted: how probable two coats are in the mean (half of the films have them), the mean log of
the probability of what is true, and how often the first set is the right one. Then the same by how
probable the first set of one coat may be where two are still sought. By these, what a map does was
chosen.

Second: pixels of `benchmarks.maps.painting_coats`, as many of each region of two coats, each searched by
itself. "near and true" fits many more stacks, and the true one from its true amounts: what no
search can do better. With paints that are known exactly there is noise alone. Sums over regions
weigh each by its pixels.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from unittest.mock import patch

import numpy as np
from jaxtyping import Float, Int

from benchmarks.results import Results, add_option
from benchmarks.rivals.known_painting import NOISE, Painting, painting
from benchmarks.rivals.known_painting_scene import REGIONS
from glazefit import IdentificationOptions, ModelError, Noise
from glazefit.film.model.errors import draw_coefficient_errors
from glazefit.identify.search.pool import Pool
from glazefit.identify.search.searcher import Searcher
from glazefit.identify.search.task import IdentificationTask, Measured
from glazefit.identify.search.weigh import Odds, odds_of
from glazefit.mapping.solve import coats
from glazefit.mapping.solve.coats import StackSearch, search_coats
from glazefit.mapping.solve.local import as_measured
from glazefit.mapping.solve.survey import Features

_SEED = 3
# Two bands of the painting's 60 make one of a map.
_BANDS = 31
_NOISE = NOISE / np.sqrt(2.0)
FITTED = ({2: 3, 3: 5}, {2: 6, 3: 12}, {2: 12, 3: 24}, {2: 24, 3: 40}, {2: 40, 3: 120})
"""Stacks that are fitted of each spectrum, by the number of their paints."""
MANY = {2: 80, 3: 200}
OPEN = (0.9, 0.95, 0.98, 1.0)
"""Odds of the first set of one coat below which two are sought."""
KNOWN_PAINTS = ModelError(
    coefficient=0.0,
    level=0.0,
    most=1e-4,
    unstated=0.0,
    amplitude=1e-4,
    scales=(1.0,),
    weights=(1.0,),
    gloss_sd=1e-3,
    apart=10.0,
    trust=1.0,
)
"""Errors of paints that are known exactly."""

Sets = Sequence[frozenset[int]]


@dataclass(frozen=True)
class Said:
    """What is said of spectra.

    Attributes:
        coats_probability: that there is more than one coat.
        ranked: sets of paints of each, most probable first, however they lie.
        probability: of each of these.
        first: the set of the most probable candidate.
        stacked: whether that has two coats.
    """

    coats_probability: Float[np.ndarray, "spectra"]
    ranked: list[list[frozenset[int]]]
    probability: list[list[float]]
    first: list[frozenset[int]]
    stacked: np.ndarray

    @classmethod
    def of(cls, pool: Pool, odds: Odds) -> "Said":
        """From candidates and their odds; a stack that is there twice counts once."""
        chance = odds.candidates / odds.candidates.sum(axis=1, keepdims=True)
        two = []
        ranked = []
        probability = []
        for row, own in enumerate(chance):
            once: dict[tuple[frozenset[int], frozenset[int]], float] = {}
            for n in np.flatnonzero(own).tolist():
                where = pool.members[row, n], pool.coats[row, n]
                key = _paints(*where, coat=0), _paints(*where, coat=1)
                once[key] = max(once.get(key, 0.0), float(own[n]))
            whole = sum(once.values())
            sets: dict[frozenset[int], float] = {}
            for (upper, lower), value in once.items():
                sets[upper | lower] = sets.get(upper | lower, 0.0) + value / whole
            order = sorted(sets, key=lambda one: -sets[one])
            ranked.append(order)
            probability.append([sets[one] for one in order])
            two.append(sum(value for (_, lower), value in once.items() if lower) / whole)
        best = chance.argmax(axis=1)
        at = np.arange(len(best)), best
        return cls(
            coats_probability=np.array(two),
            ranked=ranked,
            probability=probability,
            first=[frozenset(one[one >= 0].tolist()) for one in pool.members[at]],
            stacked=np.asarray(pool.coats[at].any(axis=-1)),
        )

    def right(self, true: Sets) -> np.ndarray:
        """Whether the first set is the true one."""
        return np.array([one == wanted for one, wanted in zip(self.first, true, strict=True)])

    def among(self, true: Sets, count: int) -> np.ndarray:
        """Whether the true set is among the first ones."""
        return np.array(
            [wanted in sets[:count] for sets, wanted in zip(self.ranked, true, strict=True)]
        )

    def chance(self, true: Sets) -> np.ndarray:
        """How probable the true set is said to be."""
        rows = zip(self.ranked, self.probability, true, strict=True)
        return np.array([dict(zip(sets, own, strict=True)).get(t, 0.0) for sets, own, t in rows])


def _paints(members: np.ndarray, lies: np.ndarray, coat: int) -> frozenset[int]:
    return frozenset(members[(members >= 0) & (lies == coat)].tolist())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_option(parser, films=8, pixels=2)
    parser.add_argument("--films", type=int, default=160, help="of one coat, and of two")
    parser.add_argument("--pixels", type=int, default=40, help="of each region")
    options = parser.parse_args()
    results = Results("coats_told", options.out)
    scene = painting((128, 128), _BANDS, _SEED, noise=_NOISE)
    _expected(results, scene, options.films)
    results()
    _painted(results, scene, options.pixels)
    results.save()


def _searcher(scene: Painting, errors: ModelError | None = None) -> Searcher:
    chosen = IdentificationOptions(noise=Noise(_NOISE, 0.0), discrepancy=errors)
    return Searcher.of(scene.wavelengths, scene.paints, chosen)


def _measured(searcher: Searcher, scene: Painting, readings: np.ndarray) -> Measured:
    return as_measured(searcher, readings, np.full(readings.shape, _NOISE), scene.ground)


def _search(
    searcher: Searcher,
    stacks: StackSearch,
    measured: Measured,
    fitted: dict[int, int] = coats._FITTED,
    open_below: float = coats._OPEN,
) -> Said:
    """What a map's search says of each spectrum, with other numbers than a map's if they are
    given.
    """
    parts = []
    with (
        patch.object(coats, "_FITTED", MappingProxyType(fitted)),
        patch.object(coats, "_OPEN", open_below),
    ):
        for _, pool, odds in search_coats(searcher, stacks, measured):
            parts.append(Said.of(pool, odds))
    return Said(
        coats_probability=np.concatenate([part.coats_probability for part in parts]),
        ranked=[one for part in parts for one in part.ranked],
        probability=[one for part in parts for one in part.probability],
        first=[one for part in parts for one in part.first],
        stacked=np.concatenate([part.stacked for part in parts]),
    )


# Films drawn from what is expected.


def _expected(results: Results, scene: Painting, films: int) -> None:
    searcher = _searcher(scene)
    rng = np.random.default_rng(0)
    sizes = np.asarray(searcher.task.prior.sizes)
    one = [(0, int(n)) for n in rng.choice(3, films, p=sizes / sizes.sum()) + 1]
    two = [(1, int(n)) for n in rng.choice(list(coats._BODIES), films, p=[*coats._BODIES.values()])]
    drawn = [_draw(searcher.task, scene.ground, rng, *kind) for kind in (*one, *two)]
    readings = np.array([reading for _, reading in drawn])
    true = [paints for paints, _ in drawn]
    lies = np.repeat([False, True], films)
    measured = _measured(searcher, scene, readings)
    stacks = StackSearch.of(searcher.task, scene.ground, Features.of(readings))
    results(f"{films} films of one coat and {films} of two, drawn from what a map expects")
    results()
    results(
        f"{'':<34}{'two coats':>12}{'log of':>10}{'right set':>11}{'right set':>11}{'two coats':>12}\n"
        f"{'':<34}{'in the mean':>12}{'what is':>10}{'one coat':>11}{'two coats':>11}{'not sought':>12}"
    )

    def say(words: str, said: Said) -> None:
        p = np.clip(said.coats_probability, 1e-3, 1 - 1e-3)
        log = np.log(np.where(lies, p, 1.0 - p)).mean()
        right = said.right(true)
        results(
            f"{words:<34}{said.coats_probability.mean():>12.3f}{log:>10.3f}"
            f"{right[~lies].mean():>11.1%}{right[lies].mean():>11.1%}"
            f"{np.mean(said.coats_probability == 0.0):>12.1%}"
        )

    for fitted in FITTED:
        words = f"{fitted[2]} and {fitted[3]} stacks of 2 and 3 paints"
        say(words, _search(searcher, stacks, measured, fitted))
    for odds in OPEN:
        words = f"sought where odds are below {odds:g}"
        say(words, _search(searcher, stacks, measured, open_below=odds))


def _draw(
    task: IdentificationTask,
    ground: Float[np.ndarray, "bands"],
    rng: np.random.Generator,
    lower: int,
    count: int,
) -> tuple[frozenset[int], Float[np.ndarray, "bands"]]:
    """Paints of a film and its reading; the first paint lies on the others if `lower` is 1."""
    prior = task.prior
    paints = rng.choice(task.paint_count, count, replace=False)
    amounts = np.exp(prior.spread * rng.standard_normal())
    amounts = amounts * rng.dirichlet(np.full(count, prior.concentration_sought))

    # Errors of log k and log s: what another film adds, and what the paints state.
    unit = replace(task.discrepancy, coefficient=1.0)
    added, stated = (
        draw_coefficient_errors(rng, (count, 2), task.wavelengths, errors)
        for errors in (task.discrepancy, unit)
    )
    own = added + task.errors[paints] * stated
    own = own + task.modes[paints] @ rng.standard_normal(task.modes.shape[-1])
    k, s = (
        amounts[:, None] * np.asarray(part)[paints] * np.exp(own[:, n])
        for n, part in enumerate((task.paints.absorption, task.paints.scattering))
    )

    # The lower coat is the ground of the upper one.
    response = task.response
    below = ground
    if lower:
        below = np.asarray(response.internal(response.body(k[1:].sum(0), s[1:].sum(0), ground)))
        k, s = k[:1], s[:1]
    body = np.asarray(response.body(k.sum(axis=0), s.sum(axis=0), below))
    surface = task.mean_surface + task.discrepancy.surface_sd(task.surface) * rng.standard_normal()
    reading = body + surface + _NOISE * rng.standard_normal(body.shape)
    return frozenset(paints.tolist()), np.maximum(reading, 0.0)


# Pixels of the painting.


def _painted(results: Results, scene: Painting, pixels: int) -> None:
    truth = scene.truth(0, scene.shape[0])
    readings = np.maximum(scene.rows(0, scene.shape[0]), 0.0).astype(float)
    regions = [
        number
        for number, region in enumerate(REGIONS)
        if len(region.coats) == 2 and not truth["foreign"][truth["region"] == number].any()
    ]
    rng = np.random.default_rng(0)
    places = [np.argwhere(truth["region"] == number) for number in regions]
    chosen = np.concatenate([own[rng.choice(len(own), pixels, replace=False)] for own in places])
    at = tuple(chosen.T)
    features = Features.of(readings.reshape(-1, readings.shape[-1]))

    # Paints of the true stacks, the upper one first.
    order = np.argsort(truth["coats"][at], axis=1, kind="stable")
    sets, amounts = (
        np.take_along_axis(truth[name][at], order, axis=1) for name in ("members", "amounts")
    )
    weights = np.array([len(own) for own in places], float)
    results(
        f"{pixels} pixels of each region of two coats: share with the right set; of all regions that, "
        "the share\nwith the right set among the first three, how probable it is said to be, and "
        "the share said to have two coats"
    )
    results()
    columns = [
        *(REGIONS[number].name for number in regions),
        "all",
        "3 first",
        "chance",
        "two coats",
    ]
    results(" " * 42 + "".join(f"{column:>18}" for column in columns))
    for words, errors in (("errors of paints", None), ("paints known exactly", KNOWN_PAINTS)):
        searcher = _searcher(scene, errors)
        stacks = StackSearch.of(searcher.task, scene.ground, features)
        measured = _measured(searcher, scene, readings[at])
        found = _search(searcher, stacks, measured)
        near = _with_truth(searcher, stacks, measured, (sets, amounts))
        for way, said in (("the map's search", found), ("near and true", near)):
            _say(results, f"{words}, {way}", said, [frozenset(s.tolist()) for s in sets], weights)


def _with_truth(
    searcher: Searcher,
    stacks: StackSearch,
    measured: Measured,
    true: tuple[Int[np.ndarray, "spectra 3"], Float[np.ndarray, "spectra 3"]],
) -> Said:
    """What is said of all spectra with many more stacks, the true one among them."""
    prior = searcher.task.prior
    sets, amounts = true
    logs = np.log(amounts.astype(float) / prior.thickness)
    with patch.object(coats, "_FITTED", MappingProxyType(MANY)):
        near = stacks.candidates(measured)
    near = near.merge(stacks.fit(measured, sets[:, None].astype(np.int32), logs[:, None]))
    pool = Pool.join([part.best(64) for _, part, _ in searcher.search(measured)])
    weight = pool.log_weight + np.log1p(-prior.stacked)
    pool = replace(pool, log_weight=weight).merge(near)
    return Said.of(pool, odds_of(measured, pool, prior, looked_at=pool.members.shape[1]))


def _say(
    results: Results, words: str, said: Said, true: Sets, weights: Float[np.ndarray, "regions"]
) -> None:
    def each(values: np.ndarray) -> np.ndarray:
        return values.reshape(len(weights), -1).mean(axis=1)

    def whole(values: np.ndarray) -> float:
        return float(each(values) @ weights / weights.sum())

    right = said.right(true)
    shares = [*each(right)]
    shares += [
        whole(part) for part in (right, said.among(true, 3), said.chance(true), said.stacked)
    ]
    results(f"{words:<42}" + "".join(f"{share:>18.1%}" for share in shares))


if __name__ == "__main__":
    main()
