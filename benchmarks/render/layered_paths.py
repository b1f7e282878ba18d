"""Paths by chance for the stacks of `layered_stacks`, added up in a file round by round: a run may
be stopped.
"""

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from tests.oracles import position_free
from tests.oracles.position_free import Stack, Tally, Views

from benchmarks.render.layered_stacks import INCIDENCES, STACKS, VIEWS, LayeredStack
from glazejax.whole_file import whole_file

KINDS = ("albedo", "factor")
CHUNK = 20_000
"""Paths side by side: their arrays stay in a cache."""
GOAL = {"albedo": 1.0, "factor": 4.0}
"""Of the standard errors, relative to each other."""


def oracle_stack(stack: LayeredStack) -> Stack:
    """The stack as `tests.oracles.position_free` takes it."""
    return Stack(
        stack.scattering,
        stack.absorption,
        stack.g,
        np.array(stack.indices),
        stack.ground,
        stack.roughness,
    )


def chunk(
    stack: LayeredStack, kind: str, incidence: float, paths: int, rng: np.random.Generator
) -> Tally:
    """Sums over some paths: albedo (bands,), or reflectance factor (views, bands)."""
    cosine = float(np.cos(np.deg2rad(incidence)))
    if kind == "albedo":
        return position_free.albedo(oracle_stack(stack), cosine, paths, rng)
    angle, azimuth = np.array(VIEWS).T
    views = Views(np.cos(np.deg2rad(angle)), azimuth)
    return position_free.reflectance_factor(oracle_stack(stack), cosine, views, paths, rng)


def read(path: Path) -> dict[str, Tally]:
    """Sums so far, by 'stack | kind | incidence'."""
    if not path.exists():
        return {}
    kept = json.loads(path.read_text())
    return {
        key: Tally(one["paths"], *(np.array(one[name]) for name in ("total", "squares")))
        for key, one in kept.items()
    }


def key_of(stack: LayeredStack, kind: str, incidence: float) -> str:
    """Its name in the file."""
    return f"{stack.name} | {kind} | {incidence:g}"


def write(path: Path, tallies: dict[str, Tally]) -> None:
    """All sums, or the old file if this is interrupted."""
    plain = {
        key: {"paths": one.paths, "total": _digits(one.total), "squares": _digits(one.squares)}
        for key, one in tallies.items()
    }
    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in plain.items()]
    with whole_file(path) as part:
        part.write_text("{\n" + ",\n".join(lines) + "\n}\n")


def run(
    path: Path,
    minutes: float,
    stacks: Sequence[LayeredStack] = STACKS,
    paths: int = CHUNK,
    say: Callable[[str], None] = print,
) -> dict[str, Tally]:
    """Add paths for so long, and until each stack has some, always where the error is largest; the
    file grows.

    Args:
        path: file of the sums.
        minutes: how long at least.
        stacks: those of `STACKS` to follow paths in.
        paths: how many side by side.
        say: gets a line a minute.
    """
    tallies, end = read(path), time.monotonic() + 60.0 * minutes
    jobs = {
        key_of(s, k, i): (n, s, k, i)
        for n, s in enumerate(STACKS)
        if s in stacks
        for k in KINDS
        for i in INCIDENCES
    }
    left = {
        key: float(tallies[key].error.max()) / GOAL[job[2]] if key in tallies else np.inf
        for key, job in jobs.items()
    }
    kept = time.monotonic()
    while time.monotonic() < end or max(left.values()) == np.inf:
        key = max(left, key=left.__getitem__)
        number, stack, kind, incidence = jobs[key]
        done = tallies[key].paths if key in tallies else 0
        # Paths so far are part of the seed: a later run draws others.
        rng = np.random.default_rng([number, KINDS.index(kind), int(incidence), done])
        fresh = chunk(stack, kind, incidence, paths, rng)
        tallies[key] = tallies[key].plus(fresh) if key in tallies else fresh
        left[key] = float(tallies[key].error.max()) / GOAL[kind]
        if time.monotonic() > kept + 60.0:
            write(path, tallies)
            total = sum(one.paths for one in tallies.values())
            say(f"{total:.3g} paths in all, largest error of an albedo {max(left.values()):.1e}")
            kept = time.monotonic()
    write(path, tallies)
    return tallies


def _digits(values: np.ndarray) -> list:
    return json.loads(
        json.dumps(values.tolist()), parse_float=lambda text: float(f"{float(text):.12g}")
    )
