"""Is it true? What identification says of films whose paints it has not seen in them, compared with
simpler methods.

    python -m benchmarks.paint.truth [--out FOLDER]

Every film of the revigo set is left out of a joint fit of all others, unless a paint of it would be
unknown without. It is then searched among that fit's paints: once with all of them, once without the
family of its main paint, where the right answer is 'none'. The tints and shades are searched again as
a conservator may meet them: noise and a varnish that nobody mentioned, another ground than stated,
another instrument. The curve of 'none' is refitted without each family.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from benchmarks.measured import measured_data
from benchmarks.paint.identification import UNIT, family
from benchmarks.paintbench.tasks import area_under_curve
from benchmarks.results import Quantity, Results, command_line, percent, quantities, quantity
from benchmarks.rivals.truth_peers import PEERS, Query
from glazefit import Films, Identification, ground_from_air, identify, identify_films
from glazefit.film.readers import read_films, read_recipes
from glazefit.recover.joint.joint import recover_jointly
from glazefit.recover.predict.crossvalidation import without
from glazejax import Bidirectional, Pigment
from glazejax.commands.main import start_jax

NEEDS = ("data/revigo",)
# Bins of probabilities that a small run may leave empty.
NEEDS_SIZE = ("stated_", "count_", "true_")

# Identification with errors of each band by itself.
BEFORE = "errors band by band"
# Methods by the names of what is recorded of them.
MIXTURES = {
    BEFORE: "bands",
    "spectral angle, nearest film": "angle",
    "derivative of -log R, nearest film": "slope",
    "unmixing of -log R (NNLS)": "unmixing",
    "Kubelka-Munk, the same paints": "kubelka_munk",
}
COLOURLESS = ("ZincWhite", "LeadWhite", "BoneBlack", "BariumSulphate", "CalciumCarbonate")
BINS = (0.0, 0.3, 0.5, 0.7, 0.9, 1.0001)
# Each film is left out; of a quick run one in several.
EVERY = 1


class Answer(NamedTuple):
    """What a method says of one film."""

    film: str
    truth: dict[str, float]  # by family
    ranked: list[frozenset[str]]  # different sets of families, most probable first
    fractions: dict[str, float]  # of the first, by family
    probability: float  # of the first set
    delta_e: float  # of the first
    words: str
    accepted: bool  # given as an answer
    misfit: float  # what `none` is judged by
    held: tuple[
        bool, ...
    ]  # whether each true fraction lies in its 90 % interval, where the first is right

    @property
    def right(self) -> bool:
        """Whether these pigments come first."""
        return self.ranked[0] == frozenset(self.truth)

    @property
    def mixed(self) -> bool:
        """Whether the film is of several paints."""
        return len(self.truth) > 1


class Case(NamedTuple):
    """One film left out."""

    row: int
    name: str
    truth: dict[str, float]
    pigments: list[Pigment]

    @property
    def main(self) -> str:
        """The largest part that has a colour, or else the largest."""
        coloured = {paint: share for paint, share in self.truth.items() if paint not in COLOURLESS}
        return max(coloured or self.truth, key=(coloured or self.truth).__getitem__)

    @property
    def rest(self) -> list[Pigment]:
        """The paints without the family of the main one."""
        return [paint for paint in self.pigments if set(family({paint.name: 1.0})) != {self.main}]


def cases(films: Films, recipes: dict[str, dict[str, float]]) -> list[Case]:
    """All films that can be left out, each with the paints of a fit that has not seen it."""
    whole = recover_jointly(films, recipes)
    count = (whole.shares > 0).sum(axis=0)
    out = []
    for row, name in enumerate(films.names):
        if (count[whole.shares[row] > 0] < 2).any() or row % EVERY:
            continue
        rest = without(whole, films, recipes, row)
        out.append(
            Case(
                row,
                name,
                by_family(recipes[name]),
                [rest.pigment(paint, UNIT) for paint in rest.paints],
            )
        )
    return out


def by_family(recipe: dict[str, float]) -> dict[str, float]:
    """Fractions of a recipe by pigment family."""
    total = sum(recipe.values())
    return family({paint: share / total for paint, share in recipe.items() if share > 0})


def answer(case: Case, found: Identification) -> Answer:
    """One identification by families."""
    ranked = found.ranked(0)
    chances: dict[frozenset[str], float] = {}
    for candidate in ranked:
        pigments = frozenset(family(dict.fromkeys(candidate.paints, 1.0)))
        chances[pigments] = chances.get(pigments, 0.0) + candidate.probability
    first = ranked[0]
    fractions = family(dict(zip(first.paints, first.fractions.tolist(), strict=True)))
    own = frozenset(fractions)
    held = ()
    if len(own) > 1 and own == frozenset(case.truth) and len(first.paints) == len(own):
        ends = zip(first.paints, first.fractions_90.tolist(), strict=True)
        held = tuple(
            low <= case.truth[next(iter(family({p: 1.0})))] <= high for p, (low, high) in ends
        )
    ordered = sorted(chances, key=lambda pigments: (pigments != own, -chances[pigments]))
    return Answer(
        case.name,
        case.truth,
        ordered,
        fractions,
        chances[own],
        first.delta_e,
        found.words(0),
        bool(found.explained[0]),
        float(found.misfit[0]),
        held,
    )


def main_table(
    results: Results, films: Films, recipes: dict[str, dict[str, float]], left: list[Case]
) -> dict[str, tuple[list[Answer], list[Answer]]]:
    """All methods on all films, with and without the family of the main paint."""
    methods: dict[str, Callable[[Case, list[Pigment]], Answer]] = {
        "glazejax": lambda case, paints: answer(
            case, identify_films(films.take([case.row]), paints)
        ),
        BEFORE: lambda case, paints: answer(
            case, identify_films(films.take([case.row]), [_bare(p) for p in paints])
        ),
        **{words: _peer(films, recipes, method) for words, method in PEERS.items()},
    }
    several = sum(len(case.truth) > 1 for case in left)
    results(f"FILMS LEFT OUT ({len(left)}; {several} of several paints)")
    results.record(**quantities({"films": len(left), "mixtures": several}, digits=0))
    results(
        f"{'':<36}right first            first three  weight fraction  none          AUC of\n"
        f"{'':<36}all         mixtures   (mixtures)   mean (median)    false, found  the misfit"
    )
    scored = {}
    for words, method in methods.items():
        full = [method(case, case.pigments) for case in left]
        gone = [method(case, case.rest) for case in left]
        scored[words] = full, gone
        mixed = [a for a in full if a.mixed]
        off = [abs(a.fractions.get(p, 0.0) - part) for a in mixed for p, part in a.truth.items()]
        three = np.mean([frozenset(a.truth) in a.ranked[:3] for a in mixed])
        false, seen = (np.mean([not a.accepted for a in some]) for some in (full, gone))
        settings = (
            f"{false:5.0%} {seen:5.0%}"
            if words.startswith(("glazejax", "errors"))
            else "    -     -"
        )
        results(
            f"{words:<34}  {_share(full)} {_share(mixed)}  {three:5.0%}        {np.mean(off):.3f} "
            f"({np.median(off):.3f})    {settings}   {_auc(full, gone):.2f}"
        )
        key = MIXTURES.get(words, words)
        results.record(**{f"{key}_mixtures": _percent([a.right for a in mixed])})
        if words == "glazejax":
            results.record(
                glazejax_films=_percent([a.right for a in full]),
                first_three=_percent([frozenset(a.truth) in a.ranked[:3] for a in mixed]),
                fraction_mean=quantity(np.mean(off), digits=3, n=len(off)),
                fraction_median=quantity(np.median(off), digits=3, n=len(off)),
                none_false=_percent([not a.accepted for a in full]),
                none_found=_percent([not a.accepted for a in gone]),
                not_none=quantity(sum(a.accepted for a in gone), digits=0, n=len(gone)),
            )
        if words == BEFORE:
            results.record(bands_false=_percent([not a.accepted for a in full]))
    return scored


def _percent(true: Sequence[bool] | np.ndarray) -> Quantity:
    """The share that is true, to be recorded."""
    return percent(np.mean(true), n=len(true))


def _bare(pigment: Pigment) -> Pigment:
    """The pigment with standard deviations band by band only."""
    return Pigment(
        pigment.name,
        pigment.wavelengths,
        pigment.absorption,
        pigment.scattering,
        absorption_sd=pigment.absorption_sd,
        scattering_sd=pigment.scattering_sd,
    )


def _peer(
    films: Films, recipes: dict[str, dict[str, float]], method
) -> Callable[[Case, list[Pigment]], Answer]:
    known_as = {name: by_family(recipe) for name, recipe in recipes.items()}

    def look(case: Case, paints: list[Pigment]) -> Answer:
        known = {frozenset(family({paint.name: 1.0})) for paint in paints}
        names = [n for n in films.names if n != case.name]
        library = [n for n in names if all(frozenset({p}) in known for p in known_as[n])]
        ranked, fractions, misfit = method(Query(films, case.row, library, known_as, paints))
        return Answer(
            case.name, case.truth, ranked, fractions, 1.0, float("nan"), "", True, misfit, ()
        )

    return look


def _share(answers: Sequence[Answer]) -> str:
    right = sum(a.right for a in answers)
    return f"{right / len(answers):5.0%} {right:>2}/{len(answers)}"


def _auc(full: list[Answer], gone: list[Answer]) -> float:
    one, other = (np.array([a.misfit for a in some]) for some in (full, gone))
    return area_under_curve(other, one)


def nested_none(results: Results, full: list[Answer], gone: list[Answer], left: list[Case]) -> None:
    """'None' judged by a logistic curve that has not seen the film's family, and what is accepted
    wrongly.
    """
    misfit = np.log(np.maximum([[a.misfit for a in full], [a.misfit for a in gone]], 0.1))
    truth = np.array([[0.0], [1.0]]) * np.ones_like(misfit)
    mains = np.array([case.main for case in left])
    share = np.empty_like(misfit)
    for main in np.unique(mains):
        here = mains == main
        intercept, slope = logistic(misfit[:, ~here].ravel(), truth[:, ~here].ravel())
        share[:, here] = intercept + slope * misfit[:, here]
    intercept, slope = logistic(misfit.ravel(), truth.ravel())
    results(
        "\n'NONE', by the misfit\n"
        f"logistic curve, all films: {intercept:.2f} {slope:+.2f} log misfit"
    )
    false, found = (_percent(some > 0) for some in share)
    results(f"fitted without the film's family: {found.value:.0f}% found, {false.value:.0f}% false")
    limit = np.quantile(misfit[0], 0.95)
    results(
        f"at 5 % false on these films: {np.mean(misfit[1] > limit):.0%} found (the limit is "
        "chosen on them)"
    )
    wrong = [a for a in [*(a for a in full if not a.right), *gone] if a.accepted]
    worst = max((a.delta_e for a in wrong), default=0.0)
    results(
        f"wrong and accepted: {len(wrong)} of {2 * len(full)}, off by Delta E00 {worst:.1f} at most"
    )
    results.record(
        curve_found=found, curve_false=false, wrong_delta_e=quantity(worst, digits=1, n=len(wrong))
    )


def logistic(x: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Intercept and slope of a logistic regression."""
    sign = 2.0 * truth - 1.0
    return minimize(
        lambda w: np.logaddexp(0.0, -sign * (w[0] + w[1] * x)).sum(), np.array([-1.0, 1.0])
    ).x


def reliability(answers: list[Answer]) -> dict[int, tuple[float, float, int]]:
    """Stated probability of the first pigments, share that is right, and how many, by the number
    of each bin that is not empty.
    """
    out = {}
    for number, (low, high) in enumerate(itertools.pairwise(BINS)):
        here = [a for a in answers if low <= a.probability < high]
        if here:
            stated = float(np.mean([a.probability for a in here]))
            share = float(np.mean([a.right for a in here]))
            out[number] = stated, share, len(here)
    return out


def conditions(results: Results, films: Films, left: list[Case]) -> None:
    """Tints and shades as they may be met, with nothing stated but what is said."""
    rng = np.random.default_rng(5)
    mixed = [case for case in left if len(case.truth) > 1]
    grid = films.wavelengths
    # A varnish by its absorbance, of another form than the program's: a cubic that falls to 0 at
    # 720 nm.
    resin = 10 ** (-2 * 0.2 * ((720.0 - grid) / 320.0) ** 3)
    over = films.over_cards
    under = ground_from_air(films.bare_cards)
    noise = rng.standard_normal((2, *over.shape))
    other = np.clip((over[:, 1] - 0.0405) * 1.045 * resin + 0.005 * noise[1, :, 1], 0.0, 1.0)
    noisy = np.clip(over + 0.01 * noise[0], 0.0, 1.0)
    varnished = 0.04 + (over - 0.04) * resin[None, None]
    all_wrong = "45:0, noise .005, varnish, said to be opaque"
    ways = (
        ("", "as they are, cards known", over, under, None),
        ("noise", "noise of .01, not stated", noisy, under, None),
        ("varnish", "yellowed varnish, not stated", varnished, under, None),
        ("opaque", "over white, said to be opaque", over[:, 1], None, None),
        ("ground", "over white, ground stated as .5", over[:, 1], 0.5, None),
        ("all_wrong", all_wrong, other, None, Bidirectional(45, 0)),
    )
    results(
        f"\nAS THEY MAY BE MET ({len(mixed)} tints and shades, paints of fits without them)\n"
        "                                                right first   first three   stated   "
        "wrong above .9   as none"
    )
    for key, words, spectra, grounds, geometry in ways:
        answers = []
        for case in mixed:
            ground = grounds[case.row] if isinstance(grounds, np.ndarray) else grounds
            found = identify(
                grid,
                spectra[case.row][None],
                case.pigments,
                ground=ground,
                opaque=ground is None,
                instrument=geometry,
            )
            answers.append(answer(case, found))
        three = np.mean([frozenset(a.truth) in a.ranked[:3] for a in answers])
        sure = sum(a.probability > 0.9 and not a.right for a in answers)
        results(
            f"{words:<46} {_share(answers)}      {three:5.0%}        "
            f"{np.mean([a.probability for a in answers]):.2f}"
            f"         {sure:>2}         {sum(not a.accepted for a in answers):>2}"
        )
        if key:
            results.record(**{f"met_{key}": _percent([a.right for a in answers])})


def main() -> None:
    options = command_line(__doc__).parse_args()
    if options.quick:
        globals().update(EVERY=7)
    start_jax()
    results = Results("truth", options.out)
    folder = measured_data("revigo")
    films, recipes = read_films(folder / "reflectance.tsv"), read_recipes(folder / "mixtures.tsv")
    left = cases(films, recipes)
    scored = main_table(results, films, recipes, left)
    full, gone = scored["glazejax"]
    nested_none(results, full, gone, left)
    results("\nSTATED -> TRUE, the first pigments (count)")
    for words in ("glazejax", BEFORE):
        cells = [
            f"{stated:.2f} -> {seen:.2f} ({n})"
            for stated, seen, n in reliability(scored[words][0]).values()
        ]
        results(f"{words:<34} {'   '.join(cells)}")
    for number, (stated, seen, n) in reliability(full).items():
        # No text quotes the least sure answers, nor of the surest how many are right.
        if number > 0:
            values = {f"stated_{number}": quantity(stated, n=n)}
            results.record(**values, **{f"count_{number}": quantity(n, digits=0)})
        if 0 < number < len(BINS) - 2:
            results.record(**{f"true_{number}": percent(seen, n=n)})
    held = [inside for a in full for inside in a.held]
    results(
        f"\n90 % INTERVALS of fractions, where the first is right: {np.mean(held):.0%} of "
        f"{len(held)} hold the true one"
    )
    results.record(held=_percent(held), held_of=quantity(len(held), digits=0))
    conditions(results, films, left)
    results("\nFILM BY FILM: truth -> answer; and without the main paint's family")
    for a, b in zip(full, gone, strict=True):
        recipe = " + ".join(f"{100 * part:.3g} {paint}" for paint, part in a.truth.items())
        results(
            f"{a.film}  {'right' if a.right else 'WRONG'}  {recipe:<40} {a.words}\n"
            f"              without: {b.words}"
        )
    results.save()


if __name__ == "__main__":
    main()
