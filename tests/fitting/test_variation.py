"""How far films are from their recipes, what left-out films teach of it, and one reading of a
mixture.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import Noise, simulate_films
from glazefit.film.films import SPECTRA
from glazefit.film.model.errors import ModelError, relative_errors
from glazefit.film.model.variation import (
    PRIOR,
    SIZES,
    UNSTEADY,
    SizeEvidence,
    Spread,
    Variation,
    learn,
    log_likelihood,
)
from glazefit.recover.joint.joint import UNIT
from glazefit.recover.joint.pose import Gauge
from glazefit.recover.predict.mixture import calibrate_mixture, drawn_mixture, mix, predict_mixture
from glazefit.recover.predict.next_reading import rank_next_readings
from glazefit.recover.predict_command import read_mixture, read_recipe
from glazejax import Pigment, catalogue, colour

from ..refusals import refusal
from .palette import GRID, optical_depths
from .tables import read_rows, write_films

COMMAND = "predict"
TINT = {"Vermillion": 10.0, "ZincWhite": 90.0}
QUIET = Noise(1e-5, 0)
SILENT = SizeEvidence(frozenset({"new"}), np.zeros(len(SIZES)))
"""Of a film that says nothing."""
OF_SIZE = np.eye(len(SIZES))
"""Weights of each size alone."""


def painted(paints, *metres, strength=1.0, noise=QUIET):
    """Films of the tint, so thick each, in which its colour counts for more than its weight."""
    k, s = optical_depths([paints[name] for name in TINT], np.outer(metres, [0.1 * strength, 0.9]))
    return simulate_films(GRID, k, s, names=[f"f{n}" for n in range(len(metres))], noise=noise)


def at_bands(films, bands):
    """The same, read in some bands alone."""
    spectra = {what: getattr(films, what)[:, bands] for what in SPECTRA}
    return replace(films, wavelengths=GRID[bands], **spectra)


def over_white(films, **changes):
    """Of one film only what was read over white."""
    return replace(films, seen=np.array([[False, True]]), **changes)


def calibrate(paints, films, **how):
    return calibrate_mixture(paints, TINT, films, noise=Noise(), **how)


def inside(prediction, truth, level=0.9):
    """Share of a truth's readings that lie in the bands of a prediction."""
    low, high = prediction.interval(level)
    return np.mean((low <= truth) & (truth <= high))


def predict(paints, *metres, **how):
    return predict_mixture(paints, TINT, metres, wavelengths=GRID, **how)


def evidence(*groups, seed=3):
    """Films whose errors really have the sizes that are said: how many of each, and their paint."""
    rng = np.random.default_rng(seed)

    def error(*films):
        level = 0.05 * rng.standard_normal((*films, 2, 1))
        return level + 0.02 * rng.standard_normal((*films, 2, GRID.size))

    out = []
    for size, count, paint in groups:
        known = 0.001 * rng.standard_normal((200, 2, GRID.size))
        expected = error(200)
        for _ in range(count):
            off = size * error() + 0.001 * rng.standard_normal((2, GRID.size))
            likelihood = log_likelihood(off, known, expected, GRID)
            out.append(SizeEvidence(frozenset({paint, "white"}), likelihood))
    return out


@pytest.mark.parametrize("size", [0.1, 0.6, 3.0])
def test_sizes_that_films_have_are_found(size):
    found = evidence((size, 300, "red"), seed=2)
    total = np.sum([s.log_likelihood for s in found], axis=0)
    assert SIZES[int(total.argmax())] == size
    learned = learn(found)
    assert learned.films == 300
    assert learned.weights.sum() == pytest.approx(1.0)
    assert SIZES[int(learned.weights.argmax())] == size


def test_nothing_left_out_is_as_expected_beforehand():
    assert learn([]).films == 0
    assert_array_equal(learn([]).weights, Variation().weights)
    assert_allclose(Variation().of(["red"]), PRIOR)
    assert sum(PRIOR) == pytest.approx(1.0)


def test_a_paint_that_surprised_is_expected_to_again():
    found = learn(evidence((0.1, 12, "calm"), (3.0, 12, "wild")))
    calm, both, wild = (
        found.size_of(paints) for paints in (["calm", "white"], ["other"], ["wild", "white"])
    )
    assert calm < both < wild
    # Of several paints the one that varies most decides.
    assert found.size_of(["calm", "wild"]) == wild


def test_a_paint_with_one_film_leans_to_all_films():
    """What all films say counts as two of its own: after a film that says nothing it is as all
    are, after one that leaves a single size its weights are (2 all + that size)/3.
    """
    sure = SizeEvidence(frozenset({"sure"}), 1e3 * (OF_SIZE[5] - 1))
    found = learn([*evidence((0.1, 12, "calm")), SILENT, sure])
    assert_allclose(found.of(["new"]), found.weights, rtol=1e-12)
    assert np.max(np.abs(found.weights - PRIOR)) > 0.05
    expected = (2.0 * found.weights + OF_SIZE[5]) / 3.0
    assert_allclose(found.of(["sure"]), expected, rtol=1e-12)


def test_paint_whose_films_are_far_off_is_probably_unsteady():
    found = learn(evidence((0.3, 24, "calm"), (3.0, 4, "wild")))
    assert found.unsteady["wild"] > 0.9 > 0.1 > found.unsteady["calm"]
    # A film that says nothing leaves what was expected.
    assert learn([SILENT]).unsteady["new"] == pytest.approx(UNSTEADY)


def test_a_paint_of_a_mixture_is_called_as_in_the_recipe(paints):
    """Whatever its pigment is called; and a paint of no weight is not in it."""
    # Films of a third paint are far off.
    varied = Variation(of_paint={"black": OF_SIZE[-1]})
    shelf: dict = dict(zip(("red", "white", "black"), paints.values(), strict=True))
    found = mix(shelf, {"red": 10, "white": 90, "black": 0}, variation=varied)
    expected = mix(paints, TINT, variation=varied)
    assert found.name == "10 red + 90 white"
    assert_allclose(found.absorption, expected.absorption)
    assert found.absorption_sd is not None
    assert expected.absorption_sd is not None
    assert_allclose(found.absorption_sd, expected.absorption_sd)


def test_a_mixture_has_the_wavelengths_of_all_its_paints(paints):
    """Whichever is named first."""
    shorter = paints | {"ZincWhite": paints["ZincWhite"].resample(GRID[3:-2])}
    for recipe in (TINT, dict(reversed(TINT.items()))):
        assert_allclose(mix(shorter, recipe).wavelengths, GRID[3:-2])
    shorter["Vermillion"] = paints["Vermillion"].resample(GRID[:3])
    with refusal("they do not meet"):
        mix(shorter, TINT)


def test_modes_of_a_mixture_are_slopes_of_its_logs(paints):
    """Against finite differences: each paint's own mode, mixed anew."""

    def of(paint):
        return np.array([paint.absorption, paint.scattering])

    found = mix(paints, TINT, variation=Variation(OF_SIZE[0]))
    assert found.error_modes is not None
    step, total = 1e-4, np.zeros((2, GRID.size))
    for mode in range(len(paints["Vermillion"].error_modes)):
        moved = {
            name: Pigment(name, GRID, *(np.exp(step * paint.error_modes[mode]) * of(paint)))
            for name, paint in paints.items()
        }
        total += (np.log(of(mix(moved, TINT)) / of(found)) / step) ** 2
    # The film's own errors of size .03 add to it: .2 and .2 of each paint, as far as it counts in
    # the mixture.
    tint = [paints[name] for name in TINT]
    share = np.stack([0.1 * of(tint[0]), 0.9 * of(tint[1])])
    share /= share.sum(axis=0)
    film = (0.03 * np.hypot(0.2, 0.2)) ** 2 * np.sum(share**2, axis=0)
    # And what the paints' standard deviations say beyond their modes.
    film += np.sum((share * relative_errors(tint, ModelError())) ** 2, axis=0)
    # Eight shapes hold nearly all of the smooth error.
    assert_allclose(np.sum(found.error_modes**2, axis=0), total + film, rtol=0.03)


def test_one_reading_tells_the_strength(paints):
    films = painted(paints, 20e-6, 8e-6, 40e-6, strength=0.6)
    found = calibrate(paints, films.take([0]))
    assert found.converged
    # How thick the film is comes out on the scale of its paints.
    lengths = np.array([1.0, 0.4, 2.0]) * found.thickness[0] * UNIT
    before = predict(paints, *lengths)
    after = predict(paints, *lengths, calibrated=found)
    off = [
        [p.delta_e(*films.over_cards[i]).mean() for i, p in enumerate(some)]
        for some in (before, after)
    ]
    assert min(off[0]) > 2.0
    assert max(off[1]) < 0.3
    for row, (first, then) in enumerate(zip(before, after, strict=True)):
        assert then.expected_error() < 0.5 * first.expected_error()
        assert inside(then, films.over_cards[row], 0.98) > 0.9


@pytest.mark.slow
def test_one_card_leaves_the_thickness_open(paints):
    """A film half as strong and a thinner one look alike over white: the bands say so."""
    films = painted(paints, 20e-6, strength=0.6)
    wide, narrow = (calibrate(paints, some) for some in (over_white(films), films))
    sd = [found.draws.films[:, 0, 0].std() for found in (wide, narrow)]
    assert sd[0] > 1.3 * sd[1]
    (found,) = predict(paints, wide.thickness[0] * UNIT, calibrated=wide)
    off = found.delta_e(*films.over_cards[0])
    assert off[1] < 0.1  # the reading itself
    assert off[0] < 3 * found.expected_error()


def test_a_gauge_moves_what_one_card_cannot_tell(paints):
    """The thickness that is said is nearly what is found; the rest is strength."""
    alone = over_white(painted(paints, 20e-6))
    thin, thick = (
        calibrate(paints, alone, gauge=Gauge({"f0": metres}, 0.02, 0.02))
        for metres in (15e-6, 30e-6)
    )
    assert thick.thickness[0] / thin.thickness[0] == pytest.approx(2.0, rel=0.2)
    assert np.log(thin.absorption / thick.absorption).mean() > 0.1
    assert np.log(thin.scattering / thick.scattering).mean() > 0.1


def test_films_that_scatter_less_are_known_better(paints):
    alone = over_white(painted(paints, 25e-6))
    sd = [
        calibrate(paints, alone, spread=Spread(thickness)).draws.films[:, 0, 0].std()
        for thickness in (0.02, 0.3)
    ]
    assert sd[0] < 0.022
    assert sd[1] > 3 * sd[0]


@pytest.mark.slow
def test_a_reading_that_is_too_bright_is_gain_as_far_as_films_have_it(paints):
    """A factor of 1.1 at all bands: with a gain it is met far better, and bands are wider by it."""
    films = painted(paints, 25e-6)
    bright = over_white(films, over_white=1.1 * films.over_white)
    tied, free = (calibrate(paints, bright, spread=Spread(0.02, gain)) for gain in (0.0, 0.1))
    met, missed = (np.mean((found.residual / found.residual_sd) ** 2) for found in (free, tied))
    assert met < 0.5 * missed
    widths = []
    for found in (tied, free):
        # Another film: its gain is its own.
        (made,) = predict(paints, 50e-6, calibrated=found)
        low, high = made.interval()
        widths.append(np.mean((high - low) / made.reflectance))
    assert widths[1] > np.hypot(widths[0], 0.2)


def test_what_a_reading_was_off_holds_over_the_other_card(paints):
    """A film that hides its ground reads the same over both, texture and all: the nearer the more
    alike errors are. A film of another thickness has errors of its own.
    """
    films = painted(paints, 400e-6)
    wave = 1.0 + 0.03 * np.sin(GRID / 10.0)
    rough = over_white(films, over_white=wave * films.over_white)
    found = calibrate(paints, rough, gauge=Gauge({"f0": 400e-6}))
    own = found.thickness[0] * UNIT
    off, wide, others = [], [], []
    for alike in (0.0, 0.8, 1.0):
        same, other = predict(paints, own, 2.0 * own, calibrated=found, spread=Spread(alike=alike))
        off.append(np.abs(same.over_black - wave * films.over_black[0]).mean())
        low, high = same.interval()
        wide.append(np.mean((high - low)[0]))
        others.append(other)
    assert off[2] < 0.2 * off[0]
    assert off[2] < off[1] < off[0]
    assert wide[2] < 0.5 * wide[0]
    assert wide[2] < wide[1] < wide[0]
    for other in others[1:]:
        assert_allclose(other.reflectance, others[0].reflectance, rtol=1e-9)
        assert_allclose(other.draws, others[0].draws, rtol=1e-9)


def test_errors_of_a_reading_are_one_draw_for_all_thicknesses(paints):
    """Two films that hide their ground are off alike in each draw, not each by another error."""
    found = calibrate(paints, painted(paints, 400e-6), gauge=Gauge({"f0": 400e-6}))
    thick, thicker = predict(paints, 800e-6, 1600e-6, calibrated=found)
    assert_allclose(thick.deviations["paint"], thicker.deviations["paint"], atol=1e-4)


def test_a_reading_in_a_few_bands_tells_the_others(paints):
    """Four filters of a camera: the strength that they tell holds between them."""
    films = painted(paints, 20e-6, strength=0.6, noise=Noise())
    few = [2, 6, 10, 13]
    read = at_bands(films, few)
    found = calibrate(paints, read, wavelengths=GRID)
    assert_array_equal(found.wavelengths, GRID)
    (before,) = predict(paints, 20e-6)
    (after,) = predict(paints, found.thickness[0] * UNIT, calibrated=found)
    off = [p.delta_e(*films.over_cards[0]).mean() for p in (before, after)]
    assert off[1] < 0.2 * off[0]
    assert inside(after, films.over_cards[0], 0.98) > 0.9
    # What was not read is not fitted.
    assert_array_equal(found.films.over_black[0, few], read.over_black[0])
    assert_array_equal(found.residual[:, :, [0, 1, 3]], 0.0)
    # Nor does anything hold there that a reading was off.
    assert np.isinf(found.residual_sd[:, :, [0, 1, 3]]).all()
    assert np.isfinite(found.residual_sd[:, :, few]).all()


def test_what_follows_a_reading_is_seen_by_its_instrument(paints):
    found = calibrate(paints, over_white(painted(paints, 20e-6)), instrument="45:0")
    first, second, other = (
        predict(paints, 10e-6, calibrated=found, instrument=instrument)[0].reflectance
        for instrument in (None, "45:0", "d:8")
    )
    assert_array_equal(first, second)
    assert np.abs(other - first).max() > 0.01
    first, second, other = (
        rank_next_readings(found, [10e-6], instrument=instrument).now
        for instrument in (None, "45:0", "d:8")
    )
    assert first == second != other


def test_the_film_that_was_read_is_the_yardstick(paints):
    """Over white a stronger and thinner film looks the same: what is known of the product is not
    lost in the bands of that film.
    """
    found = calibrate(paints, painted(paints, 25e-6))
    depth = found.draws.films[:, 0, 0]
    log_s = found.draws.bands[:, :, 1].mean(axis=1)
    together = np.std(depth + log_s - found.unknowns.films[0, 0])
    assert together < 0.7 * np.std(log_s)
    off = drawn_mixture(found)
    assert np.std(off[:, 1].mean(axis=1)) == pytest.approx(together, rel=1e-6)


def test_the_other_card_is_the_reading_that_helps_most(paints):
    """And with it films are known about as well as was foretold."""
    films = painted(paints, 20e-6, strength=0.8)
    white, both = (calibrate_mixture(paints, TINT, some) for some in (over_white(films), films))
    length = [20e-6]
    further = rank_next_readings(white, length)
    expected = [film.expected for film in further.films]
    assert expected == sorted(expected)
    assert expected[0] < further.now
    assert further.films[0].film == "the same film over black"
    assert not any("over white" in film.film and "same" in film.film for film in further.films)
    known = rank_next_readings(both, length).now
    assert expected[0] == pytest.approx(known, rel=0.5)
    hides = replace(films, opaque=np.array([True]))
    opaque = rank_next_readings(calibrate_mixture(paints, TINT, hides), length)
    assert {film.film for film in opaque.films} == {
        f"a film {words} as thick over black and white" for words in ("half", "twice")
    }


def test_further_readings_are_ranked_by_the_light_and_the_eye_of_the_colours(paints):
    found = calibrate(paints, over_white(painted(paints, 20e-6)))
    usual = rank_next_readings(found, [20e-6])
    warm = rank_next_readings(found, [20e-6], illuminant="A", observer=2)
    (film,) = predict(paints, 20e-6, calibrated=found)
    ratio = film.expected_error("A", 2) / film.expected_error()
    assert warm.now / usual.now == pytest.approx(ratio, rel=0.1)


def test_a_prediction_without_errors_is_the_film(paints):
    (found,) = predict(paints, 12e-6)
    assert_allclose(found.reflectance, painted(paints, 12e-6).over_cards[0], atol=2e-4)


def test_more_variation_is_a_wider_band(paints):
    small, large = (
        predict_mixture(paints, TINT, [12e-6], variation=Variation(OF_SIZE[place]))[0]
        for place in (1, 5)
    )
    ratio = large.expected_error(parts=("film",)) / small.expected_error(parts=("film",))
    assert ratio == pytest.approx(SIZES[5] / SIZES[1], rel=0.2)
    assert large.expected_error(parts=("scale",)) == pytest.approx(
        small.expected_error(parts=("scale",))
    )
    assert large.expected_error() > small.expected_error()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("10 Vermillion + 90 ZincWhite", TINT),
        ("0.1*Vermillion+0.9*ZincWhite", {"Vermillion": 0.1, "ZincWhite": 0.9}),
        ("10% Vermillion + 90 % ZincWhite", TINT),
        ("Vermillion", {"Vermillion": 1.0}),
    ],
)
def test_recipes_are_read(text, expected):
    assert read_recipe(text) == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("10 Vermillion + ZincWhite", "cannot read 'ZincWhite'"),
        ("10 Vermillion + ", "cannot read ''"),
        ("1 Eosin + 2 Eosin", "Eosin is named twice"),
        ("0 Eosin", "are 0"),
        (
            "50 cobalt blue + 50 ZincWhite",
            "'cobalt blue' is a family of 9 paints: name one, such as 'cobalt blue/",
        ),
    ],
)
def test_recipes_that_are_none(text, words):
    with refusal(words):
        read_mixture(text, dict(catalogue.load("pigments")))


@pytest.mark.parametrize(
    ("recipe", "words"),
    [
        ({"Blue": 1.0}, "no paint is called 'Blue'"),
        ({"Vermillion": -1.0, "ZincWhite": 2.0}, "weight of Vermillion is -1"),
        ({"Vermillion": np.nan}, "weight of Vermillion is nan"),
        ({"Vermillion": 0.0}, "no paint with a weight above 0"),
    ],
)
def test_mixtures_that_are_none(paints, recipe, words):
    with refusal(words):
        mix(paints, recipe)


@pytest.mark.parametrize("ground", [(5.0, 84.0), (0.03, np.nan), (np.full(GRID.size, -0.1), 0.9)])
def test_grounds_that_are_none(paints, ground):
    with refusal(r"a ground's internal reflectance is .*; it must lie in \[0, 1\]"):
        predict(paints, 10e-6, ground=ground)


def test_command_says_how_sure_it_is(run, tmp_path):
    out, err = run("10 vermillion + 90 zincwhite", "--thickness", "10um,30um", "--csv", "p.csv")
    assert err == ""
    assert "10 µm" in out
    assert "30 µm" in out
    assert "Two mixings of Vermillion+ZincWhite differ by about ΔE00" in out
    rows = read_rows(tmp_path / "p.csv")
    assert {row["film"] for row in rows} == {"10 µm", "30 µm"}
    assert all(
        float(r["lower_90"]) <= float(r["reflectance"]) <= float(r["upper_90"]) for r in rows
    )


def test_command_learns_from_a_reading(run, tmp_path, paints):
    films = painted(paints, 20e-6, strength=0.6, noise=Noise())
    file = write_films(tmp_path / "one.tsv", films)
    out, err = run("10 Vermillion + 90 ZincWhite", "--reading", file)
    assert err == ""
    assert "Reading f0: met to" in out
    assert "No further reading would improve this much." in out
    assert "is it as stated" not in out
    another, _ = run("10 ChromeYellow + 90 CobaltBlue", "--reading", file)
    assert "The reading is met, but by k and s that this mixture hardly has" in another
    white = write_films(tmp_path / "white.tsv", films, ("b", "w", "ow"))
    out, err = run("10 Vermillion + 90 ZincWhite", "--reading", white)
    assert err == ""
    assert "Most useful next reading: the same film over black." in out
    before, after = out.split("ΔE00")[2].split()[0], out.split("without the reading,")[1].split()[0]
    assert float(after) < 0.5 * float(before)
    assert "to the next" not in out


def test_command_refuses_in_one_line(check_refusal, tmp_path, paints):
    write_films(tmp_path / "two.tsv", painted(paints, 9e-6, 20e-6))
    for said, recipe, words in (
        ("takes one film, and there are 2", "10 Vermillion + 90 ZincWhite", "--reading two.tsv"),
        ("no.tsv", "10 Vermillion + 90 ZincWhite", "--reading no.tsv"),
        ("--unit is for the film of --reading", "ZincWhite", "--unit percent"),
        ("--samples is for the film of --reading", "10 Vermilion + 90 ZincWite", "--samples a"),
        ("Zinkweiss", "10 Vermillion + 90 Zinkweiss", ""),
        ("above 0", "10 Vermillion + 90 ZincWhite", "--thickness 0um"),
    ):
        check_refusal(said, recipe, *words.split())


@pytest.mark.parametrize(
    ("light", "degrees", "geometry"), [("D65", 10, "d:8"), ("A", 2, "d:8"), ("D65", 10, "45:0")]
)
def test_light_and_eye_reach_the_colours(run, light, degrees, geometry):
    (paint,) = predict_mixture(catalogue.load(), {"Vermillion": 1.0}, [10e-6], instrument=geometry)
    words = ["--illuminant", light, "--observer", degrees, "--instrument", geometry]
    out, _ = run("Vermillion", "--thickness", "10um", *words)
    lab = colour.lab(paint.wavelengths, paint.over_white, illuminant=light, observer=degrees)
    printed = [float(word) for word in out.split("white")[1].split()[:3]]
    assert_allclose(printed, lab, rtol=0, atol=0.051)
