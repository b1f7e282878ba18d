import io
import os
import signal
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from rich.console import Console

from glazefit import Noise, posterior_of_bands, simulate_films
from glazefit.film.chain_file import Chain
from glazefit.film.model.errors import Prior
from glazefit.film.problem import FilmProblem
from glazefit.film.sample import draw_chain
from glazefit.film.sampling import Sampling
from glazefit.posterior import command
from glazefit.posterior.chain import Convergence, convergence, count_samples
from glazejax import catalogue
from tests.fitting.test_cli_recover import write

GRID = np.array([400.0, 550.0, 700.0])
SHORT: dict = {"sampler": "emcee", "walkers": 12, "thin": 2}
OTHER: dict = {**SHORT, "walkers": 14}


def film(seed=0):
    k, s = np.geomspace(0.05, 0.5, GRID.size)[None], np.full((1, GRID.size), 1.0)
    return simulate_films(GRID, k, s, names=["film"], seed=seed)


class Gaussians:
    """Blocks of known Gaussians, in place of a problem."""

    blocks = ("a", "b", "c")
    dims = 3
    fingerprint = "gaussians"

    def __init__(self):
        self.means = np.array([[0.0, 1.0, 2.0], [5.0, 5.0, 5.0], [-1.0, 0.0, 1.0]])
        self.scales = np.array([1.0, 100.0, 0.01])

    def log_probability(self, free):
        return -0.5 * np.sum(((free - self.means) / self.scales[:, None]) ** 2, axis=-1)

    def draws(self, n, rng):
        return self.means + self.scales[:, None] * rng.standard_normal((n, 3, 3))


def sampled(problem: Any, **options) -> Chain:
    """The stand-in is its own approximation."""
    settings = Sampling(sampler="emcee", walkers=20, seed=3, **options)
    return draw_chain(problem, problem, settings)


@pytest.mark.slow
@pytest.mark.usefixtures("unchecked")  # a stand-in is sampled
def test_blocks_of_very_different_size_are_all_sampled_rightly():
    problem = Gaussians()
    chain = sampled(problem, steps=12000, thin=4)
    free = chain.free[200:].reshape(-1, 3, 3)
    kept = chain.free[200:]
    samples = count_samples(kept.reshape(*kept.shape[:2], -1))[0].reshape(3, 3)
    error = problem.scales[:, None] / np.sqrt(samples)
    assert np.all(np.abs(free.mean(axis=0) - problem.means) < 5 * error)
    assert_allclose(free.std(axis=0), np.broadcast_to(problem.scales[:, None], (3, 3)), rtol=0.12)
    assert 0.2 < chain.accepted < 0.8


@pytest.mark.usefixtures("unchecked")  # a stand-in is sampled
def test_a_chain_thinned_by_three_keeps_every_third_step():
    problem = Gaussians()
    whole, thinned = (sampled(problem, steps=31, thin=n) for n in (1, 3))
    assert (len(whole.free), len(thinned.free)) == (31, 10)
    assert_array_equal(thinned.free, whole.free[2::3])
    assert_array_equal(thinned.log_probability, whole.log_probability[2::3])


def white_chain(steps, walkers=16, rho=0.0, seed=0):
    """A chain of known autocorrelation time, (1 + rho)/(1 - rho)."""
    rng = np.random.default_rng(seed)
    values = np.empty((steps, walkers, 1))
    values[0] = rng.standard_normal((walkers, 1))
    for i in range(1, steps):
        values[i] = rho * values[i - 1] + np.sqrt(1 - rho**2) * rng.standard_normal((walkers, 1))
    return Chain(values[..., None], np.zeros(values.shape), 0.5, 1), values[..., None]


def test_effective_samples_of_a_known_chain():
    """A Markov chain of correlation .8 has one in (1 + .8)/(1 - .8) = 9 steps."""
    _, values = white_chain(5000, rho=0.8)
    samples, apart = count_samples(values[..., 0])
    assert samples[0] == pytest.approx(5000 * 16 / 9.0, rel=0.1)
    assert 1.0 <= apart[0] < 1.01


def test_walkers_that_never_met_are_told_apart():
    _, values = white_chain(200, walkers=8)
    far = values[..., 0] + 3.0 * (np.arange(8) > 3)[:, None]
    samples, apart = count_samples(far)
    assert apart[0] > 1.5
    assert samples[0] < 20


def test_long_chain_has_converged_and_short_one_not():
    good = convergence(*white_chain(4000, rho=0.8))
    assert good.converged.all()
    assert good.words().startswith("converged")
    short = convergence(*white_chain(200, rho=0.8))
    assert not short.converged.any()
    assert short.words().startswith("not converged")
    assert "would do" in short.words()


def test_lengths_and_times_of_a_thinned_chain_are_in_its_steps():
    """The same draws, of which each stands for three steps: three times as long, as many samples."""
    chain, values = white_chain(1000, rho=0.8)
    each, third = (convergence(replace(chain, thin=n), values) for n in (1, 3))
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
    stuck = Chain(np.zeros((100, 4, 1, 1)), np.zeros((100, 4, 1)), 0.0, 1)
    assert not convergence(stuck, stuck.free).converged.any()
    tiny = Chain(np.zeros((3, 4, 1, 1)), np.zeros((3, 4, 1)), 0.0, 1)
    assert "too few" in convergence(tiny, tiny.free).words()


@pytest.mark.slow
def test_interrupt_keeps_what_is_done_and_the_rest_can_follow(tmp_path, monkeypatch):
    path = tmp_path / "c.h5"
    calls = [0]
    original = FilmProblem.log_probability

    def counting(self, free):
        calls[0] += free.shape[0] == SHORT["walkers"] // 2
        if calls[0] == 25:
            os.kill(os.getpid(), signal.SIGINT)
        return original(self, free)

    monkeypatch.setattr(FilmProblem, "log_probability", counting)
    stopped = posterior_of_bands(film(), steps=100, path=path, **SHORT)
    monkeypatch.undo()
    assert stopped.chain is not None
    assert stopped.chain.interrupted
    assert 0 < len(stopped.chain.free) < 50
    assert stopped.words().startswith("stopped early")
    rest = posterior_of_bands(film(), steps=100, path=path, resume=True, **SHORT)
    whole = posterior_of_bands(film(), steps=100, **SHORT)
    assert rest.chain is not None
    assert whole.chain is not None
    assert_array_equal(rest.chain.free, whole.chain.free)


@pytest.mark.slow
def test_a_chain_of_other_walkers_or_of_another_kind_is_refused(tmp_path):
    path = tmp_path / "c.h5"
    posterior_of_bands(film(), steps=20, path=path, **SHORT)
    with pytest.raises(ValueError, match="12 walkers"):
        posterior_of_bands(film(), steps=40, path=path, resume=True, **OTHER)
    path.write_text("no")
    with pytest.raises(ValueError, match="no chain of emcee"):
        posterior_of_bands(film(), steps=40, path=path, resume=True, **SHORT)


@pytest.fixture
def run(command_line):
    return command_line("posterior")


@pytest.mark.parametrize(
    ("sampler", "steps"),
    [("emcee", "300"), pytest.param("hmc", "10", marks=pytest.mark.slow)],
)
def test_command_writes_what_it_says(run, tmp_path, sampler, steps):
    import arviz

    file = write(tmp_path / "films.tsv", film())
    options = f"{file} --bands --sampler {sampler} --steps {steps} --walkers 12".split()
    options += ("--thin", "2")
    status, out, _ = run(*options, "--out", "r")
    assert status == 0
    assert "percent" in out
    assert "Not converged" in out
    folder = tmp_path / "r"
    for name in ("corner.png", "bands.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    data: Any = arviz.from_netcdf(folder / "posterior.nc")
    assert {"posterior", "sample_stats", "log_likelihood", "observed_data"} <= set(data.groups())
    assert data.posterior.attrs["converged"] == 0
    assert data.posterior["ratio"].dims == ("chain", "draw", "wavelength")
    bands = data.posterior.sizes["wavelength"]
    lines = (folder / "summary.csv").read_text().splitlines()
    assert len(lines) == 1 + 3 * bands

    status, _, err = run(*options, "--out", "r")
    assert status == 2
    assert "--overwrite" in err
    status, _, _ = run(*options, "--out", "r", "--resume")
    assert status == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "no FILE"),
        ("--simulate --out x", "--simulate needs paints"),
        ("--simulate --paints CobaltBloo --out x", "CobaltBlue"),
        ("none.tsv --out x", "none.tsv"),
        ("none.tsv --bands --paints ZincWhite --out x", "assumes no paint"),
        (
            "none.tsv --coats Eosin:? --bands --out x",
            "leave out --bands, or leave out --coats",
        ),
        (
            "none.tsv --coats Eosin:? --paints Eosin --out x",
            "leave out --paints",
        ),
        ("--simulate --coats Eosin --out x", "write PAINT:THICKNESS"),
        (
            "--simulate --coats ?:?,ZincWhite:20um --out x",
            "name a paint in its place",
        ),
        (
            "none.tsv --sampler nuts --out x",
            "--sampler is 'nuts'; it must be hmc, emcee or importance",
        ),
        ("none.tsv --out x --resume", "no chain to resume"),
        ("none.tsv --out x --resume --overwrite", "choose one"),
        ("none.tsv", "--out FOLDER"),
    ],
)
def test_command_errors_are_one_line(run, tmp_path, words, message):
    (tmp_path / "none.tsv").touch()
    status, _, err = run(*words.split())
    assert status == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1


def test_a_wider_spectrum_is_cropped_to_where_the_paints_are_known(tmp_path, monkeypatch):
    """As identify does; a film over cards likewise."""
    grid = np.arange(380.0, 751.0, 10.0)
    rows = {"": 0.4, "f_b": 0.05, "f_w": 0.8, "f_ob": 0.1, "f_ow": 0.3}
    lines = [
        ["Name", *grid],
        *([name or "one", *np.full(grid.size, v)] for name, v in rows.items()),
    ]
    for file, kept in (("one.csv", lines[:2]), ("film.csv", [lines[0], *lines[2:]])):
        (tmp_path / file).write_text("\n".join(",".join(map(str, line)) for line in kept))
    known = dict(catalogue.load())
    made_of = command._StatedPaints(
        names=["CobaltBlue"], coats="", bands=False, shelf=known, prior=Prior()
    )
    for file, ground in (("one.csv", "0.9"), ("film.csv", None)):
        printed = io.StringIO()
        console = Console(file=printed, width=500)
        task: Any = command._read_measured(
            tmp_path / file, "", {}, made_of, ground, Noise(), console
        )
        assert task.args[0].wavelengths.tolist() == np.arange(400.0, 701.0, 10.0).tolist()
        assert "cropped to 400-700 nm" in printed.getvalue()
    infrared = "Name,900,910,920,930\none,.4,.4,.4,.4\n"
    (tmp_path / "infrared.csv").write_text(infrared)
    with pytest.raises(ValueError, match="no three bands in common"):
        command._read_measured(
            tmp_path / "infrared.csv", "", {}, made_of, "0.9", Noise(), Console(file=io.StringIO())
        )
