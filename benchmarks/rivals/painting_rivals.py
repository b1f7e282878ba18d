"""What people map paints with: spectral angle, linear unmixing, Kubelka-Munk unmixing; and scores
against a truth.

All get the same paints as the map, and the choice that each method leaves to its user, from which
share on a paint is named and from which misfit on nothing is, is made for it on another painting
whose truth it is shown.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from benchmarks.paintbench.spectra import (
    absorbance,
    cosine_distance,
    hiding_ratio,
    hiding_reflectance,
)
from benchmarks.rivals.baselines import Surface, film_reflectance, least_squares, shares_of, unmix
from benchmarks.rivals.known_painting import PLACES, Painting
from benchmarks.timing import time_call
from glazefit.film.films import Instrument, bare_surface
from glazejax import Glaze, Hemispherical, Layer, Mixture, Pigment, reflectance
from glazejax.catalogue import family

Spectra = Float[np.ndarray, "pixels bands"]
Shares = Float[np.ndarray, "pixels paints"]

_OPAQUE = 0.005
_FILM = 25e-6
CUTS = (0.003, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2)
"""Shares that are tried as the least that a paint is named for."""


class Truth(NamedTuple):
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


class Answer(NamedTuple):
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
    scene: Painting, pixels: int, seed: int = 0
) -> tuple[Spectra, Truth, Int[np.ndarray, "pixels 2"]]:
    """Readings and truth of pixels drawn at random, and where they are (y, x)."""
    height, width = scene.shape
    drawn = np.sort(
        np.random.default_rng(seed).choice(
            height * width, min(pixels, height * width), replace=False
        )
    )
    ys, xs = np.divmod(drawn, width)
    spectra = []
    parts = []
    for y in range(0, height, 64):
        end = min(y + 64, height)
        here = (ys >= y) & (ys < end)
        at = ys[here] - y, xs[here]
        spectra.append(scene.rows(y, end)[at])
        parts.append({name: values[at] for name, values in scene.truth(y, end).items()})
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return np.concatenate(spectra).astype(float), truth_of(whole), np.stack([ys, xs], axis=1)


def truth_of(arrays: dict[str, np.ndarray]) -> Truth:
    """Truth of pixels (..., places) by the names of `benchmarks.rivals.known_painting.TRUTH`, in
    one line.
    """
    members = arrays["members"].reshape(-1, PLACES).astype(int)
    coats = np.where(members >= 0, arrays["coats"].reshape(members.shape), 0).max(axis=1) + 1
    return Truth(
        members=members,
        amounts=arrays["amounts"].reshape(members.shape).astype(float),
        foreign=arrays["foreign"].ravel(),
        coats=coats,
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

    def mean(values: np.ndarray, over: np.ndarray, of: Callable = np.mean) -> float:
        return float(of(values[over])) if over.any() else float("nan")

    return Score(
        right_set=mean(right, known),
        right_pigments=mean(right_family, known),
        right_main=mean(main, known),
        share_error=mean(share_error, known),
        amount_error=mean(off, known & np.isfinite(off), np.median),
        false_none=mean(answer.none, known),
        none_found=mean(answer.none, truth.foreign),
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
    above = misfit[:, None] > levels
    best = int((above[foreign].mean(axis=0) - above[~foreign].mean(axis=0)).argmax())
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
    return Answer(
        members=np.where(kept, order, -1),
        shares=shares_of(np.where(kept, shares, 0.0)),
        thickness=unmixed.thickness,
        none=(unmixed.misfit > choice.threshold) | ~kept[:, 0],
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
    thickness = np.repeat([np.nan, *sizes[1:]], len(recipes))

    def method(spectra: Spectra) -> Unmixed:
        distance = cosine_distance(spectra, library, least=1)
        best = distance.argmin(axis=1)
        return Unmixed(
            shares=recipes[best % len(recipes)],
            thickness=thickness[best],
            misfit=distance[np.arange(len(best)), best],
        )

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
    taken = absorbance if logarithm else np.asarray
    ends = taken(np.concatenate([masstones, bare])).T

    def method(spectra: Spectra) -> Unmixed:
        amounts, misfit = unmix(ends, taken(spectra))
        unknown = np.full(len(spectra), np.nan)
        return Unmixed(shares=shares_of(amounts[:, :count]), thickness=unknown, misfit=misfit)

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
        self.surface = Surface(instrument.surface, bare_surface(instrument).back)
        self.ground = np.asarray(ground, float)
        self._calibrate(paints)

    def reading(
        self, absorption: np.ndarray, scattering: np.ndarray, ground: np.ndarray | float
    ) -> np.ndarray:
        """Reading of films of K d and S d on a ground."""
        return self.surface.reading(film_reflectance(absorption, scattering, ground))

    def slopes(
        self, absorption: np.ndarray, scattering: np.ndarray, ground: np.ndarray | float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the reading by the logarithms of K d and of S d, by differences."""
        up, down = 1.0 + 1e-4, 1.0 - 1e-4
        by_k = self.reading(absorption * up, scattering, ground)
        by_k -= self.reading(absorption * down, scattering, ground)
        by_s = self.reading(absorption, scattering * up, ground)
        by_s -= self.reading(absorption, scattering * down, ground)
        return by_k / (up - down), by_s / (up - down)

    def _calibrate(self, paints: Sequence[Pigment]) -> None:
        """Fit K and S of each paint and band, and how far their films are from those of the
        solver.
        """
        films_over = [(g, size) for g in (0.03, 0.93) for size in (8e-6, 25e-6, 60e-6)]
        grounds, sizes = np.array(films_over).T
        pure, bands = np.eye(len(paints)), self.ground.size
        exact = np.stack([films(paints, pure, d, np.full(bands, g)) for g, d in films_over], -1)

        def computed(logs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            thick = np.exp(logs[:, :, None]) * sizes
            slopes = self.slopes(thick[:, 0], thick[:, 1], grounds)
            return self.reading(thick[:, 0], thick[:, 1], grounds), np.stack(slopes, axis=-1)

        # One problem for each paint and band; constants of radiative transfer are the start.
        start = np.stack(
            [
                np.log(factor * np.array([getattr(paint, name) for paint in paints]) + 1.0).ravel()
                for factor, name in ((2.0, "absorption"), (0.75, "scattering"))
            ],
            axis=-1,
        )
        readings = exact.reshape(len(start), -1)
        logs, cost = least_squares(computed, readings, start, largest_step=1.0)
        self.calibration_error = float(np.sqrt(cost.mean() / len(films_over)))
        self.absorption, self.scattering = np.exp(logs.T).reshape(2, len(paints), bands)

    def opaque(self, spectra: Spectra) -> Unmixed:
        """Shares of films that hide their ground: sum of c K over sum of c S is K/S of
        the reading.
        """
        inside = self.surface.inside(spectra)
        # What a change of K/S does to the reading, so that each band counts by its noise.
        slope = 2.0 * inside**2 / (1.0 - inside**2) * self.surface.passed
        slope /= (1.0 - self.surface.inner * inside) ** 2
        # Unknown is what each paint adds to the scattering, so that weak paints are no way to fit
        # everything by nothing; one more row makes it sum to 1.
        heavy, mean = 1e3, self.scattering.mean(axis=1)
        absorption, scattering = self.absorption / mean[:, None], self.scattering / mean[:, None]
        amounts = np.zeros((len(spectra), len(mean)))
        for n, (q, weight) in enumerate(zip(hiding_ratio(inside), slope, strict=True)):
            total, weights = np.ones(len(q)), np.ones(len(mean))
            for _ in range(3):
                rows = (weight / total * (absorption - q * scattering)).T
                ends = np.vstack([rows, np.full(len(mean), heavy)])
                weights = unmix(ends, np.r_[np.zeros(len(q)), heavy][None])[0][0]
                total = np.maximum(weights @ scattering, 1e-3)
            amounts[n] = weights / mean
        shares = shares_of(amounts)
        mixed = (shares @ self.absorption) / (shares @ self.scattering)
        off = self.surface.reading(hiding_reflectance(mixed)) - spectra
        misfit = np.sqrt(np.mean(off**2, axis=1))
        return Unmixed(shares=shares, thickness=np.full(len(spectra), np.nan), misfit=misfit)

    def film(
        self, spectra: Spectra, starts: Sequence[float] = (8e-6, 30e-6), rounds: int = 60
    ) -> Unmixed:
        """Amounts of every paint in one coat over the ground, by least squares with none below
        zero.
        """
        pieces = [
            self._film(spectra[n : n + 256], starts, rounds) for n in range(0, len(spectra), 256)
        ]
        return Unmixed(*map(np.concatenate, zip(*pieces, strict=True)))

    def _film(self, spectra: Spectra, starts: Sequence[float], rounds: int) -> Unmixed:
        first = self.opaque(spectra).shares
        # Of micrometres of each paint.
        absorption, scattering = 1e-6 * self.absorption, 1e-6 * self.scattering

        def computed(amounts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            k = np.maximum(amounts @ absorption, 1e-9)
            s = np.maximum(amounts @ scattering, 1e-9)
            by_k, by_s = self.slopes(k, s, self.ground)
            slopes = (by_k / k)[:, :, None] * absorption.T + (by_s / s)[:, :, None] * scattering.T
            return self.reading(k, s, self.ground), slopes

        best, least = np.zeros_like(first), np.full(len(spectra), np.inf)
        for size in starts:
            start = (0.9 * first + 0.1 / first.shape[1]) * size * 1e6
            amounts, cost = least_squares(computed, spectra, start, least=0.0, rounds=rounds)
            won = cost < least
            best[won], least[won] = amounts[won], cost[won]
        return Unmixed(
            shares=shares_of(best),
            thickness=1e-6 * best.sum(axis=1),
            misfit=np.sqrt(least / spectra.shape[1]),
        )


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

    @classmethod
    def of(
        cls, name: str, truth: Truth, answer: Answer, names: Sequence[str], seconds: float
    ) -> "Row":
        """The line of an answer that took so long a pixel; see `score`."""
        return cls(
            name=name,
            score=score(truth, answer, names),
            seconds=seconds,
            by_coats=by_coats(truth, answer, names),
        )


def compared(scene: Painting, other: Painting, pixels: int = 2000) -> list[Row]:
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
        unmixed, seconds = time_call(lambda m=method: m(spectra))
        answer = answered(unmixed, choice)
        rows.append(Row.of(name, truth, answer, scene.names, seconds / len(spectra)))
    return rows


def by_coats(truth: Truth, answer: Answer, names: Sequence[str]) -> tuple[float, ...]:
    """Share of pixels with the right set among those of one, two and three coats; NaN where there
    are none.
    """
    return tuple(score(*only(truth, answer, truth.coats == n), names).right_set for n in (1, 2, 3))


_HEADS = (
    ("right", "set"),
    ("one", "coat"),
    ("two", "coats"),
    ("three", "coats"),
    ("right", "pigments"),
    ("main", "paint"),
    ("error", "shares"),
    ("error", "amounts"),
    ("false", "none"),
    ("none", "found"),
    ("pixels", "a second"),
)


def table(rows: Sequence[Row]) -> list[str]:
    """Lines that show scores side by side."""
    lines = [
        " " * 30 + "".join(f"{word:>10}" for word in line) for line in zip(*_HEADS, strict=True)
    ]
    for row in rows:
        s = row.score
        shares = (s.right_set, *row.by_coats, s.right_pigments, s.right_main)
        amount = "-" if np.isnan(s.amount_error) else f"{s.amount_error:.3f}"
        lines.append(
            f"{row.name:<30}{''.join(f'{share:>10.1%}' for share in shares)}{s.share_error:>10.3f}"
            f"{amount:>10}{s.false_none:>10.1%}{s.none_found:>10.1%}{1 / row.seconds:>10.0f}"
        )
    return lines


def answer_of_map(arrays: dict[str, np.ndarray]) -> Answer:
    """A map's answer for pixels, from its variables `members`, `fraction`, `thickness` and
    `explained`, in one line.
    """
    members = np.asarray(arrays["members"]).reshape(-1, PLACES).astype(int)
    return Answer(
        members=members,
        shares=np.nan_to_num(np.asarray(arrays["fraction"], float).reshape(members.shape)),
        thickness=np.asarray(arrays["thickness"], float).ravel(),
        none=np.asarray(arrays["explained"]).ravel() == 0,
    )


def only(truth: Truth, answer: Answer, rows: np.ndarray) -> tuple[Truth, Answer]:
    """Some of the pixels."""
    return Truth(*(part[rows] for part in truth)), Answer(*(part[rows] for part in answer))
