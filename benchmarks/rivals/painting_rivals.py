"""What people map paints with: spectral angle, linear unmixing, Kubelka-Munk unmixing; and scores
against a truth.

    python -m benchmarks.rivals.painting_rivals [--pixels 2000] [--bands 200]

All get the same paints as the map, and the choice that each method leaves to its user, from which
share on a paint is named and from which misfit on nothing is, is made for it on another painting
whose truth it is shown.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import nnls

from benchmarks.results import Results, add_option
from benchmarks.rivals.known_painting import PLACES, Scenery, painting
from glazefit.film.films import Instrument, diffuse_internal_reflectance
from glazejax import Glaze, Hemispherical, Layer, Mixture, Pigment, reflectance
from glazejax.catalogue import family

Spectra = Float[np.ndarray, "pixels bands"]
Shares = Float[np.ndarray, "pixels paints"]

_OPAQUE = 0.005
_FILM = 25e-6
_TINY = 1e-12
CUTS = (0.003, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2)
"""Shares that are tried as the least that a paint is named for."""


@dataclass(frozen=True)
class Truth:
    """What some pixels are painted with.

    Attributes:
        members: paints by number, ascending, -1 where there are no more, (pixels, places).
        amounts: of each in m, the same shape.
        foreign: whether a paint of the pixel is not in the catalogue, (pixels,).
        coats: number of coats, (pixels,).
    """

    members: Int[np.ndarray, "pixels places"]
    amounts: Float[np.ndarray, "pixels places"]
    foreign: Bool[np.ndarray, "pixels"]
    coats: Int[np.ndarray, "pixels"]


@dataclass(frozen=True)
class Answer:
    """What a method says of some pixels.

    Attributes:
        members: paints by number, in any order, -1 where there are no more, (pixels, places).
        shares: of each, by what the method takes for amounts, the same shape.
        thickness: m, NaN where the method knows none, (pixels,).
        none: whether it says that none of the paints explain the pixel, (pixels,).
    """

    members: Int[np.ndarray, "pixels places"]
    shares: Float[np.ndarray, "pixels places"]
    thickness: Float[np.ndarray, "pixels"]
    none: Bool[np.ndarray, "pixels"]


class Score(NamedTuple):
    """How an answer compares with the truth; all but the last over pixels of the catalogue's
    paints.

    The paints that are named count even where the answer is none, so that a threshold that says
    none too often does not hide what a method can do.

    Attributes:
        right_set: share of pixels with exactly the right paints.
        right_pigments: the same, where paints of one pigment count as one (medium and maker aside).
        right_main: share in which the paint of the largest share is the right one.
        share_error: mean of half the sum of absolute differences of shares, 0 to 1.
        amount_error: median of the sum of absolute differences of amounts over all the paint there
            is; NaN without.
        false_none: share called none.
        none_found: share of pixels with foreign paint that are called none.
    """

    right_set: float
    right_pigments: float
    right_main: float
    share_error: float
    amount_error: float
    false_none: float
    none_found: float


class Unmixed(NamedTuple):
    """What a method computes before anybody chooses what to name.

    Attributes:
        shares: of each paint, (pixels, paints), sum 1 (or 0 where there is none).
        thickness: m, NaN where the method knows none, (pixels,).
        misfit: larger where the paints explain less, (pixels,).
    """

    shares: Shares
    thickness: Float[np.ndarray, "pixels"]
    misfit: Float[np.ndarray, "pixels"]


Method = Callable[[Spectra], Unmixed]


def sampled(
    scene: Scenery, pixels: int, seed: int = 0
) -> tuple[Spectra, Truth, Int[np.ndarray, "pixels 2"]]:
    """Readings and truth of pixels drawn at random, and where they are (y, x)."""
    height, width = scene.shape
    drawn = np.sort(
        np.random.default_rng(seed).choice(
            height * width, min(pixels, height * width), replace=False
        )
    )
    ys, xs = np.divmod(drawn, width)
    spectra, parts = [], []
    for y in range(0, height, 64):
        end = min(y + 64, height)
        here = (ys >= y) & (ys < end)
        truth = scene.truth(y, end)
        spectra.append(scene.rows(y, end)[ys[here] - y, xs[here]])
        parts.append({name: values[ys[here] - y, xs[here]] for name, values in truth.items()})
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return np.concatenate(spectra).astype(float), truth_of(whole), np.stack([ys, xs], axis=1)


def truth_of(arrays: dict[str, np.ndarray]) -> Truth:
    """Truth of pixels (..., places) by the names of `benchmarks.rivals.known_painting.TRUTH`, in
    one line.
    """
    members = arrays["members"].reshape(-1, PLACES).astype(int)
    coats = np.where(members >= 0, arrays["coats"].reshape(members.shape), 0).max(axis=1) + 1
    return Truth(
        members,
        arrays["amounts"].reshape(members.shape).astype(float),
        arrays["foreign"].ravel(),
        coats,
    )


def score(truth: Truth, answer: Answer, names: Sequence[str]) -> Score:
    """Compare an answer with the truth.

    Args:
        truth: of the pixels.
        answer: for the same pixels.
        names: of all paints by number, those of the catalogue first, then foreign ones.
    """
    known = ~truth.foreign
    count = len(names)
    true_amounts = _by_paint(truth.members, truth.amounts, count)
    shares = _by_paint(answer.members, answer.shares, count)
    amounts = shares * answer.thickness[:, None]
    true_shares = true_amounts / true_amounts.sum(axis=1, keepdims=True)
    there = _by_paint(answer.members, np.ones(answer.members.shape), count) > 0
    alike = _families(names)
    right = (there == (true_amounts > 0)).all(axis=1)
    right_family = ((there @ alike > 0) == ((true_amounts > 0) @ alike > 0)).all(axis=1)
    main = (shares.argmax(axis=1) == true_amounts.argmax(axis=1)) & (shares.max(axis=1) > 0)
    share_error = 0.5 * np.abs(shares - true_shares).sum(axis=1)
    share_error[shares.sum(axis=1) == 0] = 1.0
    off = np.abs(amounts - true_amounts).sum(axis=1) / true_amounts.sum(axis=1)
    told = known & np.isfinite(off)

    def mean(values: np.ndarray, over: np.ndarray) -> float:
        return float(values[over].mean()) if over.any() else float("nan")

    return Score(
        mean(right, known),
        mean(right_family, known),
        mean(main, known),
        mean(share_error, known),
        float(np.median(off[told])) if told.any() else float("nan"),
        mean(answer.none, known),
        mean(answer.none, truth.foreign),
    )


def _by_paint(
    members: Int[np.ndarray, "pixels places"],
    values: Float[np.ndarray, "pixels places"],
    count: int,
) -> Float[np.ndarray, "pixels paints"]:
    """Values of places as those of paints, 0 for paints that are not there."""
    found = np.zeros((len(members), count))
    rows, places = np.nonzero(members >= 0)
    found[rows, members[rows, places]] = values[rows, places]
    return found


def _families(names: Sequence[str]) -> Float[np.ndarray, "paints pigments"]:
    """Which paint is of which pigment."""
    pigments = sorted({family(name) for name in names})
    return np.array([[family(name) == pigment for pigment in pigments] for name in names], float)


class Choice(NamedTuple):
    """What a user of a method chooses: the least share that is named, and the largest misfit that
    is believed.
    """

    cut: float
    threshold: float


def choose(truth: Truth, unmixed: Unmixed, names: Sequence[str]) -> Choice:
    """The best choice for pixels whose truth is known.

    The threshold is the one by which most is right of foreign pixels and of the others, both
    counting alike; the cut then the one with most right sets.
    """
    threshold = _threshold(unmixed.misfit, truth.foreign)
    scores = [score(truth, answered(unmixed, Choice(cut, np.inf)), names).right_set for cut in CUTS]
    return Choice(CUTS[int(np.argmax(scores))], threshold)


def _threshold(misfit: Float[np.ndarray, "pixels"], foreign: Bool[np.ndarray, "pixels"]) -> float:
    if not foreign.any() or foreign.all():
        return float("inf")
    levels = np.unique(misfit)
    above = len(misfit[foreign]) - np.searchsorted(np.sort(misfit[foreign]), levels, side="right")
    below = np.searchsorted(np.sort(misfit[~foreign]), levels, side="right")
    balanced = above / foreign.sum() + below / (~foreign).sum()
    best = int(balanced.argmax())
    # Between two readings, so that rounding does not decide.
    return float(0.5 * (levels[best] + levels[min(best + 1, len(levels) - 1)]))


def answered(unmixed: Unmixed, choice: Choice) -> Answer:
    """The paints with the largest shares, as far as these are at least the cut, and none where the
    misfit is large.
    """
    order = np.argsort(-unmixed.shares, axis=1, kind="stable")[:, :PLACES]
    shares = np.take_along_axis(unmixed.shares, order, axis=1)
    kept = shares >= choice.cut
    kept[:, 0] = shares[:, 0] > 0
    total = np.where(kept, shares, 0.0).sum(axis=1, keepdims=True)
    part = np.where(kept, shares, 0.0) / np.where(total > 0, total, 1.0)
    return Answer(
        np.where(kept, order, -1),
        part,
        unmixed.thickness,
        (unmixed.misfit > choice.threshold) | ~kept[:, 0],
    )


def films(
    paints: Sequence[Pigment],
    weights: Float[np.ndarray, "films paints"],
    thickness: float,
    ground: np.ndarray,
) -> Float[np.ndarray, "films bands"]:
    """Spectra of films of one coat, by the solver: the library that other methods would measure."""
    layers = [Layer(Mixture(paints, weights), np.full(len(weights), thickness))]
    return np.asarray(reflectance(Glaze(layers, ground, 1.5), Hemispherical(8.0)), float)


def spectral_angle(
    paints: Sequence[Pigment], ground: Float[np.ndarray, "bands"], *, pairs: bool = True
) -> Method:
    """The nearest entry of a library by the angle between spectra.

    The library has every paint, hiding its ground and 8 and 25 micrometres thick; with `pairs`,
    every mixture of two at 1:9, 1:3, 1:1, 3:1, 9:1 as well.
    """
    count = len(paints)
    weights = [np.eye(count)]
    if pairs:
        one, two = np.triu_indices(count, 1)
        for share in (0.1, 0.25, 0.5, 0.75, 0.9):
            weights.append(share * np.eye(count)[one] + (1 - share) * np.eye(count)[two])
    recipes = np.concatenate(weights)
    sizes = (_OPAQUE, _FILM, 8e-6)
    library = np.concatenate([films(paints, recipes, size, ground) for size in sizes])
    unit = library / np.linalg.norm(library, axis=1, keepdims=True)
    thickness = np.repeat([np.nan, *sizes[1:]], len(recipes))

    def method(spectra: Spectra) -> Unmixed:
        cosine = (spectra / np.linalg.norm(spectra, axis=1, keepdims=True)) @ unit.T
        best = cosine.argmax(axis=1)
        angle = np.arccos(np.clip(cosine[np.arange(len(best)), best], -1, 1))
        return Unmixed(recipes[best % len(recipes)], thickness[best], angle)

    return method


def linear(
    paints: Sequence[Pigment], ground: Float[np.ndarray, "bands"], *, logarithm: bool = False
) -> Method:
    """Non-negative least squares in reflectance, or in -log reflectance, with masstones and the
    bare ground.
    """
    count = len(paints)
    masstones = films(paints, np.eye(count), _OPAQUE, ground)
    bare = films(paints, np.eye(count)[:1], 0.0, ground)

    def taken(values: np.ndarray) -> np.ndarray:
        return -np.log(np.maximum(values, 1e-3)) if logarithm else values

    ends = taken(np.concatenate([masstones, bare])).T

    def method(spectra: Spectra) -> Unmixed:
        found = [nnls(ends, spectrum) for spectrum in taken(spectra)]
        weights = np.array([each[0] for each in found])[:, :count]
        total = weights.sum(axis=1, keepdims=True)
        misfit = np.array([each[1] for each in found]) / np.sqrt(spectra.shape[1])
        return Unmixed(
            weights / np.where(total > 0, total, 1.0), np.full(len(spectra), np.nan), misfit
        )

    return method


class TwoFlux:
    """Kubelka-Munk's film under Saunderson's surface, with K and S of each paint as films over
    cards would give them.

    K and S are fitted, band by band, to films of 8, 25 and 60 micrometres over black and over
    white: what those who use the theory measure, and a better start for it than constants of
    radiative transfer.
    """

    def __init__(self, paints: Sequence[Pigment], ground: Float[np.ndarray, "bands"]):
        instrument = Instrument()
        self.outer, self.inner = instrument.surface, diffuse_internal_reflectance(instrument)
        self.ground = np.asarray(ground, float)
        k = np.array([np.asarray(paint.absorption, float) for paint in paints])
        s = np.array([np.asarray(paint.scattering, float) for paint in paints])
        self.absorption, self.scattering = self._calibrated(paints, 2.0 * k, 0.75 * s)

    def reading(
        self, absorption: np.ndarray, scattering: np.ndarray, ground: np.ndarray | float
    ) -> np.ndarray:
        """Reading of films of K d and S d on a ground."""
        x = np.sqrt(np.maximum(absorption * (absorption + 2.0 * scattering), _TINY**2))
        # sinh(x)/x and cosh(x) over exp(x), so that nothing overflows.
        small = np.exp(-2.0 * x)
        sinh = np.where(x < 1e-4, 1.0 - x, -np.expm1(-2.0 * x) / (2.0 * np.maximum(x, _TINY)))
        below = 0.5 * (1.0 + small) + (absorption + scattering) * sinh
        back, through = scattering * sinh / below, np.exp(-x) / below
        inside = back + through**2 * ground / (1.0 - back * ground)
        return self.outer + (1 - self.outer) * (1 - self.inner) * inside / (1 - self.inner * inside)

    def inside(self, reading: np.ndarray) -> np.ndarray:
        """Reflectance inside the paint, Saunderson's correction undone."""
        body = np.maximum(reading - self.outer, 1e-4)
        return np.clip(
            body / ((1 - self.outer) * (1 - self.inner) + self.inner * body), 1e-4, 0.999
        )

    def slopes(
        self, absorption: np.ndarray, scattering: np.ndarray, ground: np.ndarray | float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Reading, and its derivatives by the logarithms of K d and of S d, by differences."""
        step = 1e-4
        one, two = (
            self.reading(absorption * (1 + step), scattering, ground),
            self.reading(absorption * (1 - step), scattering, ground),
        )
        three, four = (
            self.reading(absorption, scattering * (1 + step), ground),
            self.reading(absorption, scattering * (1 - step), ground),
        )
        middle = self.reading(absorption, scattering, ground)
        return middle, (one - two) / (2 * step), (three - four) / (2 * step)

    def _calibrated(
        self, paints: Sequence[Pigment], absorption: np.ndarray, scattering: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        grounds, sizes = (0.03, 0.93), (8e-6, 25e-6, 60e-6)
        every = [(ground, size) for ground in grounds for size in sizes]
        bands = self.ground.size
        exact = np.stack(
            [
                films(paints, np.eye(len(paints)), size, np.full(bands, ground))
                for ground, size in every
            ]
        )
        logs, damping = (
            np.log(np.stack([absorption + 1.0, scattering + 1.0])),
            np.full(absorption.shape, 1e-3),
        )

        def computed(at: np.ndarray) -> tuple[np.ndarray, ...]:
            parts = [
                self.slopes(np.exp(at[0]) * size, np.exp(at[1]) * size, ground)
                for ground, size in every
            ]
            return tuple(np.stack(each) for each in zip(*parts, strict=True))

        value, by_k, by_s = computed(logs)
        cost = ((exact - value) ** 2).sum(axis=0)
        for _ in range(40):
            off = exact - value
            a, b, c = (by_k**2).sum(axis=0), (by_k * by_s).sum(axis=0), (by_s**2).sum(axis=0)
            p, q = (by_k * off).sum(axis=0), (by_s * off).sum(axis=0)
            a, c = a + damping * (a + 1e-9), c + damping * (c + 1e-9)
            step = np.stack([c * p - b * q, a * q - b * p]) / np.maximum(a * c - b * b, _TINY**2)
            trial = logs + np.clip(step, -1.0, 1.0)
            new = computed(trial)
            new_cost = ((exact - new[0]) ** 2).sum(axis=0)
            better = new_cost < cost
            logs, cost = np.where(better, trial, logs), np.where(better, new_cost, cost)
            value, by_k, by_s = (
                np.where(better, n, o) for n, o in zip(new, (value, by_k, by_s), strict=True)
            )
            damping = np.where(better, damping * 0.3, np.minimum(damping * 5.0, 1e6))
        self.calibration_error = float(np.sqrt(cost.mean() / len(every)))
        return np.exp(logs[0]), np.exp(logs[1])

    def opaque(self, spectra: Spectra) -> Unmixed:
        """Shares of films that hide their ground: sum of c K over sum of c S is K/S of
        the reading.
        """
        inside = self.inside(spectra)
        ratio = (1.0 - inside) ** 2 / (2.0 * inside)
        # Unknown is what each paint adds to the scattering, so that weak paints are no way to fit
        # everything by nothing; one more row makes it sum to 1.
        heavy, mean = 1e3, self.scattering.mean(axis=1)
        absorption, scattering = self.absorption / mean[:, None], self.scattering / mean[:, None]
        found = np.zeros((len(spectra), len(mean)))
        for n, (q, r) in enumerate(zip(ratio, inside, strict=True)):
            # What a change of K/S does to the reading, so that each band counts by its noise.
            slope = (
                2.0
                * r**2
                / (1.0 - r**2)
                * (1 - self.outer)
                * (1 - self.inner)
                / (1 - self.inner * r) ** 2
            )
            total, weights = np.ones(len(q)), np.ones(len(mean))
            for _ in range(3):
                rows = (slope / total * (absorption - q * scattering)).T
                weights = nnls(
                    np.vstack([rows, np.full(len(mean), heavy)]), np.r_[np.zeros(len(q)), heavy]
                )[0]
                total = np.maximum(weights @ scattering, 1e-3)
            found[n] = weights / mean / np.sum(weights / mean)
        mixed = (found @ self.absorption) / (found @ self.scattering)
        body = 1.0 + mixed - np.sqrt(mixed**2 + 2.0 * mixed)
        reading = self.outer + (1 - self.outer) * (1 - self.inner) * body / (1 - self.inner * body)
        misfit = np.sqrt(np.mean((reading - spectra) ** 2, axis=1))
        return Unmixed(found, np.full(len(spectra), np.nan), misfit)

    def film(
        self, spectra: Spectra, starts: Sequence[float] = (8e-6, 30e-6), rounds: int = 60
    ) -> Unmixed:
        """Amounts of every paint in one coat over the ground, by least squares with none below
        zero.
        """
        pieces = [
            self._film(spectra[n : n + 256], starts, rounds) for n in range(0, len(spectra), 256)
        ]
        return Unmixed(*(np.concatenate(part) for part in zip(*pieces, strict=True)))

    def _film(self, spectra: Spectra, starts: Sequence[float], rounds: int) -> Unmixed:
        first = self.opaque(spectra).shares
        count = first.shape[1]
        unit = 1e-6
        best, least = np.zeros_like(first), np.full(len(spectra), np.inf)
        for size in starts:
            amounts = (0.9 * first + 0.1 / count) * size / unit
            value, slopes = self._amount_slopes(amounts, unit)
            cost, damping = ((spectra - value) ** 2).sum(axis=1), np.full(len(spectra), 1e-3)
            for _ in range(rounds):
                gradient = np.einsum("nbp,nb->np", slopes, spectra - value)
                curvature = slopes.transpose(0, 2, 1) @ slopes
                # What lies at zero and would go below stays there for this step.
                held = (amounts <= 0) & (gradient < 0)
                curvature[held[:, :, None] | held[:, None, :]] = 0.0
                scale = np.einsum("npp->np", curvature)
                scale = np.where(held, 1.0, scale * (1 + damping[:, None]) + 1e-12)
                curvature[:, np.arange(count), np.arange(count)] = scale
                step = np.linalg.solve(curvature, np.where(held, 0.0, gradient)[..., None])[..., 0]
                trial = np.maximum(amounts + step, 0.0)
                new, new_slopes = self._amount_slopes(trial, unit)
                new_cost = ((spectra - new) ** 2).sum(axis=1)
                better = new_cost < cost
                amounts[better], value[better], slopes[better] = (
                    trial[better],
                    new[better],
                    new_slopes[better],
                )
                gain = np.where(better, cost - new_cost, 0.0)
                cost = np.where(better, new_cost, cost)
                damping = np.clip(np.where(better, 0.3 * damping, 4.0 * damping), 1e-9, 1e9)
                if np.all((gain < 1e-6 * cost) & (better | (damping > 1e4))):
                    break
            won = cost < least
            best[won], least[won] = amounts[won], cost[won]
        total = best.sum(axis=1)
        return Unmixed(
            best / np.where(total > 0, total, 1.0)[:, None],
            total * unit,
            np.sqrt(least / spectra.shape[1]),
        )

    def _amount_slopes(self, amounts: np.ndarray, unit: float) -> tuple[np.ndarray, np.ndarray]:
        """Readings, and their derivatives by the amounts, (pixels, bands, paints)."""
        k, s = (
            np.maximum(amounts @ self.absorption * unit, 1e-9),
            np.maximum(amounts @ self.scattering * unit, 1e-9),
        )
        value, by_k, by_s = self.slopes(k, s, self.ground)
        slopes = (by_k / k)[:, :, None] * (self.absorption.T * unit) + (by_s / s)[:, :, None] * (
            self.scattering.T * unit
        )
        return value, slopes


def rivals(paints: Sequence[Pigment], ground: Float[np.ndarray, "bands"]) -> dict[str, Method]:
    """All methods by name, set up for these paints and this ground."""
    flux = TwoFlux(paints, ground)
    return {
        "spectral angle, pure paints": spectral_angle(paints, ground, pairs=False),
        "spectral angle, and pairs": spectral_angle(paints, ground),
        "NNLS in R": linear(paints, ground),
        "NNLS in -log R": linear(paints, ground, logarithm=True),
        "Kubelka-Munk, opaque": flux.opaque,
        "Kubelka-Munk, film on ground": flux.film,
    }


class Row(NamedTuple):
    """One method's line of a table."""

    name: str
    score: Score
    seconds: float  # a pixel
    by_coats: tuple[float, ...]  # share with the right set of pixels of one, two and three coats
    choice: Choice | None = None


def compared(scene: Scenery, other: Scenery, pixels: int = 2000) -> list[Row]:
    """Scores of all rivals on pixels of a painting; each chooses its cut and threshold on another
    painting.

    Raises:
        ValueError: the two paintings have other paints or wavelengths.
    """
    if not np.array_equal(scene.wavelengths, other.wavelengths) or scene.names != other.names:
        raise ValueError("the two paintings must have the same paints and wavelengths")
    spectra, truth, _ = sampled(scene, pixels)
    practice, known, _ = sampled(other, pixels)
    rows = []
    for name, method in rivals(scene.paints, scene.ground).items():
        choice = choose(known, method(practice), scene.names)
        start = time.perf_counter()
        found = method(spectra)
        seconds = (time.perf_counter() - start) / len(spectra)
        answer = answered(found, choice)
        rows.append(
            Row(
                name,
                score(truth, answer, scene.names),
                seconds,
                by_coats(truth, answer, scene.names),
                choice,
            )
        )
    return rows


def by_coats(truth: Truth, answer: Answer, names: Sequence[str]) -> tuple[float, ...]:
    """Share of pixels with the right set among those of one, two and three coats; NaN where there
    are none.
    """
    return tuple(score(*only(truth, answer, truth.coats == n), names).right_set for n in (1, 2, 3))


def table(rows: Sequence[Row]) -> list[str]:
    """Lines that show scores side by side."""
    heads = (
        "right set",
        "one coat",
        "two coats",
        "three coats",
        "right pigments",
        "main paint",
        "error of shares",
        "error of amounts",
        "false none",
        "none found",
        "pixels a_second",
    )
    words = [head.split() for head in heads]
    lines = [
        " " * 30 + "".join(f"{each[line].replace('_', ' '):>10}" for each in words)
        for line in (0, -1)
    ]
    for row in rows:
        s = row.score
        amount = "-" if np.isnan(s.amount_error) else f"{s.amount_error:.3f}"
        lines.append(
            f"{row.name:<30}{s.right_set:>10.1%}"
            f"{''.join(f'{share:>10.1%}' for share in row.by_coats)}"
            f"{s.right_pigments:>10.1%}{s.right_main:>10.1%}{s.share_error:>10.3f}"
            f"{amount:>10}{s.false_none:>10.1%}{s.none_found:>10.1%}{1 / row.seconds:>10.0f}"
        )
    return lines


def answer_of_map(arrays: dict[str, np.ndarray]) -> Answer:
    """A map's answer for pixels, from its variables `members`, `fraction`, `thickness` and
    `explained`, in one line.
    """
    members = np.asarray(arrays["members"]).reshape(-1, PLACES).astype(int)
    shares = np.nan_to_num(np.asarray(arrays["fraction"], float).reshape(members.shape))
    none = np.asarray(arrays["explained"]).ravel() == 0
    return Answer(members, shares, np.asarray(arrays["thickness"], float).ravel(), none)


def only(truth: Truth, answer: Answer, rows: np.ndarray) -> tuple[Truth, Answer]:
    """Some of the pixels."""
    some = {name: getattr(truth, name)[rows] for name in ("members", "amounts", "foreign", "coats")}
    part = {
        name: getattr(answer, name)[rows] for name in ("members", "shares", "thickness", "none")
    }
    return replace(truth, **some), replace(answer, **part)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_option(parser, pixels=100, bands=40)
    parser.add_argument("--pixels", type=int, default=2000)
    parser.add_argument("--bands", type=int, default=200)
    options = parser.parse_args()
    results = Results("painting_rivals", options.out)
    shape = (96, 128) if options.quick else (480, 640)
    scene, other = painting(shape, options.bands, seed=0), painting(shape, options.bands, seed=1)
    results(
        f"{options.pixels} pixels drawn from a painting of {shape[0]} x {shape[1]} pixels and "
        f"{options.bands} bands,"
    )
    results("noise .003; cuts and thresholds chosen on another painting of the same kind")
    results()
    rows = compared(scene, other, options.pixels)
    for line in table(rows):
        results(line)
    results()
    for row in rows:
        assert row.choice is not None
        results(
            f"{row.name:<30} names shares from {row.choice.cut:g}, believes misfits to "
            f"{row.choice.threshold:.3g}"
        )
    results.save()


if __name__ == "__main__":
    main()
