"""Figures in README and docs are those of the result files that they link."""

import re
from pathlib import Path

import pytest
from benchmarks import figures
from benchmarks.results import FOLDER

from glazefit.film.errors import MISFIT

ROOT = Path(__file__).parents[1]

# Sentences that must stand in a document: in braces the name of a figure.
_STUDIO = {
    "slider's event to the swatch's new pixels, 1 coat": "one_coat",
    "3 coats": "three_coats",
    "8 coats": "eight_coats",
    "a touch of the brush to pixels": "brush",
    "all 512 x 512 pixels anew": "canvas",
}
_PROGRAMS = {
    "CDISORT, threaded batch, no surface: value": "cdisort",
    "sasktran2, no surface, one azimuth mode: value and gradient": "sasktran2",
    "sasktran2, no surface, as it comes: value and gradient": "sasktran2_all_modes",
}
_FLUXES = {
    "as the paper counts: paths for 303 incidences, fluxes for 13 by symmetry": "paper",
    "13 incidences for both, by symmetry": "both",
    "303 incidences for both": "neither",
    "303 for both, the fluxes as one matrix of 312 directions each way, as printed": "matrix",
}
_RIVALS = ("angle", "nnls", "nnls_log", "opaque", "film", "map")
_COMMANDS = ("render", "recover", "recover_into", "identify", "recipe", "chart")
SENTENCES = [
    ("README.md", "worst of 1000 stacks a setting | {calibrate_directions.worst}"),
    ("README.md", "both at an error of 1e-4; 1e-8 | {frontier.cdisort_1e4}; {frontier.cdisort_1e8} |"),
    (
        "README.md",
        "tolerance 1e-6; the worst of nine tolerances | {frontier.gradient}; {frontier.gradient_most} |",
    ),
    ("README.md", "at a tolerance of 1e-4, one geometry | {scaling.million_seconds} s"),
    (
        "README.md",
        "ΔE00 | {colourchecker_recipes.within_one} of 24, {colourchecker_recipes.median}, "
        "{colourchecker_recipes.largest} |",
    ),
    (
        "README.md",
        "with an unknown paint | {coverage.least}-{coverage.most} %; "
        "{layers_inverted.one_ground}-{layers_inverted.shelf} % |",
    ),
    (
        "README.md",
        "one matrix as printed | {many_flux_claims.both}; {many_flux_claims.neither}; {many_flux_claims.matrix} |",
    ),
    ("README.md", "left out of the fit; with noise of .01 | {truth.glazejax_mixtures} %; {truth.met_noise} % |"),
    ("README.md", "in the same fit | {prediction.median}; {prediction.kubelka_munk_median} |"),
    (
        "README.md",
        "and right, 2000 pixels of a million | {painting.seconds} s, {painting.large_memory} GiB; "
        "{painting.same_set} %, {painting.map_right} % |",
    ),
    (
        "README.md",
        "over assembly by quadrature¹ | {paper_tables.own_least}-{paper_tables.own_most} %; "
        "{paper_tables.conventional_least}-{paper_tables.conventional_most} %",
    ),
    (
        "docs/accuracy.md",
        "All 24 take {colourchecker_recipes.first} s the first time, with compilation, and "
        "{colourchecker_recipes.again} s again",
    ),
    (
        "docs/accuracy.md",
        "At a tolerance of 1e-3, 41 wavelengths take {profile_solver.call} µs in {profile_solver.kernels} kernels "
        "of {profile_solver.kernel} µs each",
    ),
    (
        "docs/accuracy.md",
        "its error is {auxiliary_order.times_smaller_rms} to {auxiliary_order.times_smaller_largest} times smaller",
    ),
    (
        "docs/accuracy.md",
        "fixed step over own step, both decomposed | 3.7-6.6 % | {paper_tables.own_least}-{paper_tables.own_most} %",
    ),
    (
        "docs/accuracy.md",
        "{emcee_speed.uncompiled_least} to {emcee_speed.uncompiled_most} times as fast as the same formulas called "
        "walker by walker, uncompiled, and {emcee_speed.one_least} to {emcee_speed.one_most} times",
    ),
    (
        "docs/accuracy.md",
        "ray-traced with one bounce (figure 15) | {object_colour_figures.planes_mean} | "
        "{object_colour_figures.planes_most}",
    ),
    *(
        ("docs/accuracy.md", f"| {words} | {{frontier.{key}_1e4}} | {{frontier.{key}_1e8}} |")
        for words, key in _PROGRAMS.items()
    ),
    *(
        ("docs/accuracy.md", f"| {words} | {{many_flux_claims.{key}}} | {{many_flux_claims.{key}_scaled}} |")
        for words, key in _FLUXES.items()
    ),
    ("docs/accuracy.md", "Over all pairs it is nearer in {paper_rounding.all_nearer} %"),
    ("docs/accuracy.md", "though the paints are there | | {truth.none_false} % |"),
    ("docs/accuracy.md", "the first is right | {truth.held} % of {truth.held_of} | |"),
    ("docs/accuracy.md", "with the family of the main paint taken out | | {truth.none_found} % |"),
    (
        "docs/accuracy.md",
        "is predicted over black within {prediction.reading} on average and {prediction.reading_median} in the median",
    ),
    *(
        (
            "docs/accuracy.md",
            f"| {{painting.{size}_pixels}} | {{painting.{size}_seconds}} | {{painting.{size}_rate}} | "
            f"{{painting.{size}_memory}} GiB |",
        )
        for size in ("small", "million", "large")
    ),
    (
        "docs/accuracy.md",
        "{painting.same_set} % have the same first set and {painting.same_none} % the same answer to 'none'",
    ),
    *(
        (
            "docs/accuracy.md",
            f"| {{painting.{name}_right}} % | {{painting.{name}_main}} % | {{painting.{name}_shares}} | "
            f"{{painting.{name}_false}} % | {{painting.{name}_found}} % |",
        )
        for name in _RIVALS
    ),
    *(
        (
            "docs/accuracy.md",
            f"| {{cold_start.{name}_before_empty}} → {{cold_start.{name}_empty}} | "
            f"{{cold_start.{name}_before_again}} → {{cold_start.{name}_again}} | "
            f"{{cold_start.{name}_before_programs}} → {{cold_start.{name}_programs}} |",
        )
        for name in _COMMANDS
    ),
    *(
        ("docs/studio.md", f"{words} | {{studio.{key}_median}} ms | {{studio.{key}_95}} ms |")
        for words, key in _STUDIO.items()
    ),
    (
        "docs/studio.md",
        "The page is usable {studio.second_start} s after it is opened, and {studio.first_start} s the very first time",
    ),
]


def words(document: str) -> str:
    """A document as one line, so that its line breaks do not matter."""
    return " ".join((ROOT / document).read_text().split())


@pytest.mark.parametrize(("document", "sentence"), SENTENCES, ids=lambda value: value[:60])
def test_the_figure_is_that_of_its_result(document, sentence):
    wanted = re.sub(r"\{([\w.]+)\}", lambda name: figures.figure(name[1]), sentence)
    assert wanted in words(document), f"{document} should say: {wanted}"


@pytest.mark.parametrize("name", figures.names())
def test_a_figure_stands_in_its_result(name):
    assert figures.figure(name)


def test_none_grows_with_the_misfit_as_films_left_out_say():
    """The curve is not today's (see `log_odds_of_none`), but grows as that does, and lies lower by less than one."""
    curve = re.search(r"logistic curve, all films: (\S+) \+(\S+)", (FOLDER / "truth.txt").read_text())
    assert curve
    intercept, slope = map(float, curve.groups())
    assert MISFIT[1] == pytest.approx(slope, abs=0.3)
    assert intercept - 1.0 < MISFIT[0] < intercept + 0.3
