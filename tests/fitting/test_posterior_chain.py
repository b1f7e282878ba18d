from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from glazefit import simulate_films
from glazefit.film.sample import Chain
from glazefit.posterior.chain import Convergence, convergence, count_samples
from glazejax.io import write_table

from ..slow import slow
from .test_cli_recover import write

COMMAND = "posterior"
GRID = np.array([400.0, 550.0, 700.0])


def film():
    k = np.geomspace(0.05, 0.5, GRID.size)[None]
    return simulate_films(GRID, k, np.ones_like(k), names=["film"])


def white_chain(steps, walkers=16, rho=0.0):
    """A chain of known autocorrelation time, (1 + rho)/(1 - rho)."""
    rng = np.random.default_rng(0)
    values = np.empty((steps, walkers, 1))
    values[0] = rng.standard_normal((walkers, 1))
    for i in range(1, steps):
        values[i] = rho * values[i - 1] + np.sqrt(1 - rho**2) * rng.standard_normal((walkers, 1))
    return Chain(values[..., None], np.zeros(values.shape), 0.5, 1)


def judged(chain):
    return convergence(chain, chain.free)


def test_effective_samples_of_a_known_chain():
    """A Markov chain of correlation .8 has one in (1 + .8)/(1 - .8) = 9 steps."""
    samples, apart = count_samples(white_chain(5000, rho=0.8).free[..., 0])
    assert samples[0] == pytest.approx(5000 * 16 / 9.0, rel=0.1)
    assert 1.0 <= apart[0] < 1.01


def test_walkers_that_never_met_are_told_apart():
    near = white_chain(200, walkers=8).free[..., 0]
    samples, apart = count_samples(near + 3.0 * (np.arange(8) > 3)[:, None])
    assert apart[0] > 1.5
    assert samples[0] < 20


def test_long_chain_has_converged_and_short_one_not():
    assert judged(white_chain(4000, rho=0.8)).converged.all()
    short = judged(white_chain(200, rho=0.8))
    assert not short.converged.any()
    assert "would do" in short.words()


def test_lengths_and_times_of_a_thinned_chain_are_in_its_steps():
    """The same draws, of which each stands for three steps: three times as long, as many samples."""
    chain = white_chain(1000, rho=0.8)
    each, third = (judged(replace(chain, thin=n)) for n in (1, 3))
    assert_allclose(third.times, 3 * each.times)
    assert_allclose(third.samples, each.samples)
    assert (third.length, third.discarded) == (3 * each.length, 3 * each.discarded)


@pytest.mark.parametrize(
    ("samples", "apart", "enough"), [(400.0, 1.049, True), (399.0, 1.0, False), (1e6, 1.05, False)]
)
def test_a_chain_has_samples_enough_and_walkers_that_met(samples, apart, enough):
    """In every block, as the words say."""
    one = Convergence(
        samples=np.array([samples, 1e6]),
        apart=np.array([apart, 1.0]),
        walkers=16,
        length=500,
        discarded=0,
    )
    assert one.converged.tolist() == [enough, True]
    assert one.times[0] == 500 * 16 / samples
    assert "400 samples are needed, and an R-hat below 1.05" in one.words()
    assert one.words().startswith("converged" if enough else "not converged in 1 of 2 blocks")


def test_stuck_or_tiny_chain_has_not_converged():
    stuck, tiny = (
        judged(Chain(np.zeros((steps, 4, 1, 1)), np.zeros((steps, 4, 1)), 0.0, 1))
        for steps in (100, 3)
    )
    assert not stuck.converged.any()
    assert "too few" in tiny.words()


@pytest.mark.parametrize(("sampler", "steps"), [("emcee", "300"), slow("hmc", "10")])
def test_command_writes_what_it_says(run, check_refusal, tmp_path, sampler, steps):
    import arviz

    write(tmp_path / "films.tsv", film())
    words = f"films.tsv --bands --sampler {sampler} --steps {steps} --walkers 12 --thin 2 --out r"
    options = words.split()
    out, _ = run(*options)
    assert "percent" in out
    assert "Not converged" in out
    folder = tmp_path / "r"
    for name in ("corner.png", "bands.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    data: Any = arviz.from_netcdf(folder / "posterior.nc")
    assert {"posterior", "sample_stats", "log_likelihood", "observed_data"} <= set(data.groups())
    assert data.posterior.attrs["converged"] == 0
    assert data.posterior["ratio"].dims == ("chain", "draw", "wavelength")
    lines = (folder / "summary.csv").read_text().splitlines()
    assert len(lines) == 1 + 3 * data.posterior.sizes["wavelength"]

    check_refusal("--overwrite", *options)
    run(*options, "--resume")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "no FILE"),
        ("--simulate --out x", "--simulate needs paints"),
        ("--simulate --paints CobaltBloo --out x", "CobaltBlue"),
        ("--simulate --bands --paints ZincWhite --out x", "--bands assumes none; leave out one"),
        ("--simulate --bands --paints oils:ZincWhite --out x", "--bands assumes none"),
        ("none.tsv --out x", "none.tsv"),
        ("none.tsv --bands --paints ZincWhite --out x", "assumes no paint"),
        ("none.tsv --bands --thickness 90um --out x", "assumes no paint; leave out --thickness"),
        ("none.tsv --bands --paint-error .5 --out x", "assumes no paint; leave out --paint-error"),
        ("none.tsv --bands --catalogue acrylics --out x", "leave out --catalogue"),
        ("none.tsv --coats Eosin:? --bands --out x", "leave out --bands, or leave out --coats"),
        ("none.tsv --coats Eosin:? --paints Eosin --out x", "leave out --paints"),
        ("--simulate --coats Eosin --out x", "write PAINT:THICKNESS"),
        ("--simulate --coats ?:?,ZincWhite:20um --out x", "name a paint in its place"),
        (
            "none.tsv --sampler nuts --out x",
            "--sampler is 'nuts'; it must be hmc, emcee or importance",
        ),
        ("none.tsv --out x --resume", "no chain to resume"),
        ("none.tsv --out x --resume --overwrite", "choose one"),
        ("none.tsv --out x --resume --steps 0", "leave out resume"),
        ("none.tsv", "--out FOLDER"),
    ],
)
def test_command_errors_are_one_line(check_refusal, tmp_path, words, message):
    (tmp_path / "none.tsv").touch()
    check_refusal(message, *words.split())


@pytest.fixture
def asked(monkeypatch):
    """Films, and paints, of which a posterior is asked; none is sampled."""
    calls = []

    def stop(film, *paints, **options):
        calls.append((film, *paints))
        raise ValueError("nothing is sampled")

    monkeypatch.setattr("glazefit.posterior.posterior.posterior_of_film", stop)
    return calls


CARDS = {"12A_b": 0.05, "12A_w": 0.8, "12A_ob": 0.1, "12A_ow": 0.3}
ONE = {"12A": 0.4}


def write_levels(path, levels, start=400, stop=701):
    """Spectra that are the same at all bands."""
    titles = ["Name", *map(str, range(start, stop, 10))]
    rows = [[title, *np.full(len(titles) - 1, level)] for title, level in levels.items()]
    write_table(path, titles, rows)


def test_a_wider_spectrum_is_cropped_to_where_the_paints_are_known(run, asked, tmp_path):
    """As identify does; a film over cards likewise."""
    for name, levels, start in (("one", ONE, 380), ("film", CARDS, 380), ("infrared", ONE, 800)):
        write_levels(tmp_path / f"{name}.csv", levels, start, start + 371)
    for words, said in (
        ("one.csv --ground 0.9", "cropped to 400-700 nm"),
        ("film.csv", "cropped to 400-700 nm"),
        ("infrared.csv --ground 0.9", "no three bands in common"),
    ):
        out, err = run(*words.split(), "--paints", "CobaltBlue", "--out", "x", fails=2)
        assert said in out + err
    read = [film.wavelengths.tolist() for film, _ in asked]
    assert read == 2 * [np.arange(400.0, 701.0, 10.0).tolist()]


@pytest.mark.parametrize(("levels", "ground"), [(CARDS, ()), (ONE, ("--ground", 0.9))])
def test_the_recipe_of_the_only_film_needs_no_name(check_refusal, asked, tmp_path, levels, ground):
    """With several the command asks for one of them, and blames no recipe."""
    write_levels(tmp_path / "one.csv", levels)
    again = {title.replace("12A", "13A"): level for title, level in levels.items()}
    write_levels(tmp_path / "two.csv", levels | again)
    (tmp_path / "mixtures.tsv").write_text("12A\tCobaltBlue|100\n")
    check_refusal("nothing is sampled", "one.csv", *ground, "--out", "x")
    ((_, (paint,)),) = asked
    assert paint.name == "CobaltBlue"
    check_refusal("--sample", "two.csv", *ground, "--out", "x")


def test_a_folder_that_holds_the_ground_is_refused(check_refusal, tmp_path):
    """summary.csv is written there."""
    (tmp_path / "x").mkdir()
    (tmp_path / "x" / "summary.csv").touch()
    (tmp_path / "none.tsv").touch()
    words = "none.tsv --bands --ground x/summary.csv --overwrite --out x"
    check_refusal("holds summary.csv, a file that is read", *words.split())
