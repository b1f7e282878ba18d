"""Programs that are kept between runs as they were traced, and compiled ahead."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import programs
from glazejax.programs import Program, keep_traced

from .fresh import run_python
from .refusals import refusal


class Sums(NamedTuple):
    """A result with names, beside one more."""

    of_rows: jax.Array
    all: jax.Array


class Counted:
    """A function that counts how often JAX traces it."""

    def __init__(self):
        self.times = 0

    def program(self, **settings) -> Program:
        def sums(values, more, *, power=2, turn=None):
            self.times += 1
            raised = values**power + more["shift"]
            raised = raised if turn is None else turn(raised)
            return Sums(raised.sum(axis=1), raised.sum()), {"shift": more["shift"] * 2}

        return Program(sums, fixed=("power", "turn"), **settings)


@pytest.fixture
def counted():
    return Counted()


@pytest.fixture
def folder(tmp_path):
    keep_traced(tmp_path)
    yield tmp_path
    keep_traced(None)


VALUES = np.arange(6.0).reshape(2, 3)
MORE = {"shift": np.array([1.0, 2.0, 3.0])}


def check(found, power=2):
    sums, more = found
    raised = VALUES**power + MORE["shift"]
    assert type(sums) is Sums
    assert_allclose(sums.of_rows, raised.sum(axis=1))
    assert_allclose(sums.all, raised.sum())
    assert_allclose(more["shift"], MORE["shift"] * 2)


def test_a_second_run_traces_nothing(folder, counted):
    check(counted.program()(VALUES, MORE))
    once = counted.times
    assert once
    check(counted.program()(VALUES, MORE))
    assert counted.times == once
    assert len(list(folder.iterdir())) == 1


@pytest.mark.parametrize("what", ["power", "shape", "kind", "precision", "files"])
def test_another_program_is_traced_anew(folder, counted, monkeypatch, what):
    counted.program()(VALUES, MORE)
    once = counted.times
    values, more, settings, double = VALUES, MORE, {}, True
    if what == "power":
        settings = {"power": 3}
    elif what == "shape":
        values = VALUES[:1]
    elif what == "kind":
        values, more = VALUES.astype(np.float32), {"shift": MORE["shift"].astype(np.float32)}
    elif what == "precision":
        double = False
    else:
        monkeypatch.setattr(programs, "_files", lambda _: iter([("changed.py", 1, 1)]))
        programs._made_with.cache_clear()
    with jax.enable_x64(double):
        found = counted.program()(values, more, **settings)
    programs._made_with.cache_clear()
    assert counted.times > once
    assert len(list(folder.iterdir())) == 2
    if what == "power":
        check(found, power=3)
    if what == "precision":
        assert found[0].all.dtype == np.float32


def test_a_file_that_was_written_in_part_is_written_again(folder, counted):
    counted.program()(VALUES, MORE)
    once = counted.times
    (kept,) = folder.iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(whole[: len(whole) // 2])
    check(counted.program()(VALUES, MORE))
    assert counted.times > once
    assert kept.stat().st_size == len(whole)


def test_what_words_do_not_tell_is_not_kept(folder, counted):
    """Two functions may have one name."""
    for factor in (1.0, 2.0):
        sums, _ = counted.program()(
            VALUES, MORE, turn=lambda raised, factor=factor: factor * raised
        )
        assert_allclose(sums.all, factor * (VALUES**2 + MORE["shift"]).sum())
    assert not list(folder.iterdir())


def test_a_folder_that_is_gone_changes_nothing(folder, counted):
    keep_traced(folder / "gone")
    check(counted.program()(VALUES, MORE))


def test_traced_callers_and_gradients_see_the_function(folder, counted):
    program = counted.program()
    program(VALUES, MORE)
    slope = jax.grad(lambda values: program(values, MORE)[0].all)(jnp.asarray(VALUES))
    assert_allclose(slope, 2 * VALUES)
    check(jax.jit(program)(VALUES, MORE))


def test_numbers_of_python_and_arrays_are_programs_of_their_own(folder):
    program = Program(lambda a, b: a * b)
    single = jnp.ones(2, jnp.float32)
    assert program(single, 2.0).dtype == np.float32
    with refusal("promotion"):
        program(single, np.float64(2.0))


@pytest.mark.parametrize("kept", [True, False])
def test_what_was_compiled_ahead_is_not_compiled_again(folder, counted, kept):
    compiled = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, duration_secs, **_: (
            compiled.append(duration_secs) if "backend_compile" in event else None
        )
    )
    keep_traced(folder if kept else None)
    try:
        program = counted.program()
        # Tests' own rule of promotion is for this thread alone.
        with jax.numpy_dtype_promotion("standard"):
            program.ahead(np.zeros_like(VALUES), {"shift": np.zeros(3)})
            for begun in program._begun.values():
                begun.result()
            assert len(compiled) == 1
            check(program(VALUES, MORE))
        assert len(compiled) == 1
    finally:
        jax.monitoring.clear_event_listeners()


def test_what_is_wrong_ahead_shows_in_the_call(counted):
    program = counted.program()
    program.ahead(VALUES, {"shift": np.zeros(7)})
    with refusal("broadcast"):
        program(VALUES, {"shift": np.zeros(7)})
    check(program(VALUES, MORE))


@pytest.mark.slow
def test_a_kept_program_that_calls_lapack_runs_in_a_new_process(tmp_path):
    """JAX loads LAPACK when it lowers a call of it, which nobody does for a kept program: once that
    ended the process.
    """
    code = f"""
import pathlib, jax.numpy as jnp
from glazejax.programs import Program, keep_traced
keep_traced(pathlib.Path({str(tmp_path)!r}))
def root(matrix):
    return jnp.linalg.cholesky(matrix)
print(Program(root)(jnp.array([[4.0, 2.0], [2.0, 5.0]])).tolist())
"""
    for _ in range(2):
        assert run_python(code).stdout == "[[2.0, 0.0], [1.0, 2.0]]\n"
        assert len(list(tmp_path.glob("traced-*"))) == 1


def twice(value):
    return 2.0 * value


def test_functions_of_modules_are_told_apart_by_their_names(folder):
    def apply(values, *, change):
        return change(values)

    program = Program(apply, fixed=("change",))
    assert_array_equal(program(VALUES, change=twice), 2.0 * VALUES)
    assert len(list(folder.glob("traced-*"))) == 1


def test_of_many_shapes_the_newest_are_held(counted):
    """Each is some megabytes, and a process may see hundreds."""
    import gc
    import weakref

    program = counted.program()
    held = []
    for rows in range(1, 9):
        program.ahead(np.ones((rows, 3)), MORE)
        program(np.ones((rows, 3)), MORE)
        held.append(weakref.ref(list(program._begun.values())[-1]))
    gc.collect()
    assert [made() is not None for made in held] == [False] * 4 + [True] * 4
    # JAX holds what it has run: it is not compiled a second time.
    newest = list(program._begun)
    program.ahead(np.ones((1, 3)), MORE)
    assert list(program._begun) == newest
