"""What it saves to give emcee the log-probability of all walkers in one compiled call.

    python -m benchmarks.paint.emcee_speed [--out FOLDER]

The same sampler, moves and model each time; what differs is how the log-probability is called.

- vectorised: all walkers of all blocks in one compiled call (`glazefit.film.problem`).
- one walker at a time: the same compiled program for one walker with all its blocks, called by
emcee in turn.
- one walker and block at a time: the compiled program of a single film or band, as sampling each by
itself would.
- one walker at a time, not compiled: the same formulas, operation by operation.

Problems: a film of two paints (4 unknowns), k d and s d of its 31 bands (2 unknowns each), and 30
films of two paints side by side. Milliseconds a step of the ensemble, warm medians of runs in turn;
the backend is memory. Writes a table and a plot.
"""

import statistics
import time
from collections.abc import Callable
from typing import Any

import emcee
import jax
import numpy as np

from benchmarks.paint.coverage import simulate
from benchmarks.results import Results, command_line, ends, quantities

NEEDS = ("matplotlib",)

WALKERS = (32, 128, 512)
ROUNDS = 5
ONE, UNCOMPILED = "one walker at a time", "one walker, not compiled"
# Seconds of one timed run, about.
PATIENCE = 1.0


def problems() -> dict[str, Any]:
    from glazefit import Instrument, Prior
    from glazefit.film.solve import solve
    from glazefit.posterior.bands import pose_bands
    from glazefit.posterior.film import pose_films

    films, truth = simulate(30, 2, np.random.default_rng(0), model_error=True, gloss=True)
    instrument, prior = Instrument(), Prior()
    many, _ = solve(pose_films(films, truth.paints, instrument, prior))
    return {
        "a film of two paints": pick(many, 0),
        "31 bands of a film": pose_bands(films[:1], 1.0, instrument),
        "30 films of two paints": many,
    }


def pick(problem: Any, block: int) -> Any:
    """One block of a problem."""
    from dataclasses import replace

    data = jax.tree.map(lambda a: a[block : block + 1], problem.data)
    return replace(problem, blocks=(problem.blocks[block],), data=data)


def vectorised(problem: Any) -> Callable[[np.ndarray], np.ndarray]:
    blocks = len(problem.blocks)

    def log_prob(points: np.ndarray) -> np.ndarray:
        parts = problem.log_probability(points.reshape(len(points), blocks, problem.dims))
        return (
            parts[:, 0]
            if blocks == 1
            else np.concatenate([parts.sum(axis=1, keepdims=True), parts], axis=1)
        )

    return log_prob


def by_walker(problem: Any) -> Callable[[np.ndarray], np.ndarray]:
    all_at_once = vectorised(problem)
    return lambda point: all_at_once(point[None])[0]


def by_block(problem: Any) -> Callable[[np.ndarray], np.ndarray]:
    single = [pick(problem, b) for b in range(len(problem.blocks))]

    def log_prob(point: np.ndarray) -> np.ndarray:
        points = point.reshape(len(single), 1, 1, problem.dims)
        parts = [one.log_probability(p)[0, 0] for one, p in zip(single, points, strict=True)]
        return np.array([np.sum(parts), *parts])

    return log_prob


def uncompiled(problem: Any) -> Callable[[np.ndarray], np.ndarray]:
    compiled = by_walker(problem)

    def log_prob(point: np.ndarray) -> np.ndarray:
        with jax.disable_jit():
            return compiled(point)

    return log_prob


def stepper(
    problem: Any, log_prob: Callable, walkers: int, vectorize: bool
) -> Callable[[int], None]:
    """A function that takes some steps of an ensemble that starts at random draws of the prior."""
    from emcee.moves import DEMove, StretchMove

    blocks = len(problem.blocks)
    # Walkers may be fewer than the unknowns of all blocks: what is asked for is the time of a step.
    moves = [
        (StretchMove(live_dangerously=True), 0.4),
        (DEMove(live_dangerously=True), 0.6),
    ]
    rng = np.random.default_rng(0)
    start = problem.prior_draws(rng, walkers * blocks).reshape(walkers, -1)
    sampler = emcee.EnsembleSampler(
        walkers, start.shape[1], log_prob, moves=moves, vectorize=vectorize, blobs_dtype=np.float64
    )
    state: list[Any] = [emcee.State(start)]

    def steps(count: int) -> None:
        state[0] = sampler.run_mcmc(state[0], count, skip_initial_state_check=True)
        sampler.reset()

    return steps


def seconds_a_step(ways: dict[str, Callable[[int], None]]) -> dict[str, float]:
    """Medians over rounds in turn; each run is as many steps as take about a second."""
    counts, spent = {}, PATIENCE
    for name, steps in ways.items():
        for _ in range(2):
            began = time.perf_counter()
            steps(1)
            spent = time.perf_counter() - began
            if spent > 5 * PATIENCE and name == UNCOMPILED:
                break
        counts[name] = int(np.clip(PATIENCE / spent, 1, 500))
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS):
        for name, steps in ways.items():
            # What takes longer than this is told apart by its first run.
            if times[name] and times[name][0] > 3 * PATIENCE:
                continue
            began = time.perf_counter()
            steps(counts[name])
            times[name].append((time.perf_counter() - began) / counts[name])
    return {name: statistics.median(values) for name, values in times.items()}


def main() -> None:
    options = command_line(__doc__).parse_args()
    if options.quick:
        globals().update(WALKERS=(32,), ROUNDS=2, PATIENCE=0.2)
    jax.config.update("jax_enable_x64", True)
    say = Results("emcee_speed", options.out, "emcee")
    say(
        "Milliseconds a step of emcee, by how the log-probability is called (in brackets: over "
        "vectorised)"
    )
    results: dict[str, dict[int, dict[str, float]]] = {}
    for title, problem in list(problems().items())[: 1 if options.quick else None]:
        say(f"\n{title}")
        results[title] = {}
        for walkers in WALKERS:
            ways = {
                "vectorised": (vectorised(problem), True),
                ONE: (by_walker(problem), False),
            }
            if walkers == WALKERS[0]:
                ways[UNCOMPILED] = (uncompiled(problem), False)
            if len(problem.blocks) > 1 and walkers < WALKERS[-1]:
                ways["one walker and block"] = (by_block(problem), False)
            found = seconds_a_step(
                {n: stepper(problem, f, walkers, v) for n, (f, v) in ways.items()}
            )
            results[title][walkers] = found
            cells = [
                f"{name} {1e3 * t:.3g} ({t / found['vectorised']:.0f})" for name, t in found.items()
            ]
            say(f"{walkers:>5} walkers: " + ", ".join(cells))
    rows = [row for by_walkers in results.values() for row in by_walkers.values()]
    for key, name in (("uncompiled", UNCOMPILED), ("one", ONE)):
        times = [row[name] / row["vectorised"] for row in rows if name in row]
        say.record(**quantities(ends(key, times), "times", 0))
    say.save()


if __name__ == "__main__":
    main()
