"""Functions that run as compiled programs: compiled ahead by threads of their own, and kept
between runs as JAX traced them.

XLA compiles without Python's lock, so that on two cores a search's later programs are ready when it
comes to them. JAX's own cache keeps what XLA made of a program; but to find it there a function has
to be traced and lowered again, which is half of a command's second run. So the lowered program is
kept next to it, under its function, the shapes of its arguments, and all that it was made from.
"""

import functools
import hashlib
import inspect
import os
import pickle
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType
from typing import Any, Generic, NamedTuple, TypeVar

import jax
import jax.export
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .whole_file import whole_file

Result = TypeVar("Result")

# What programs are made with, besides the two packages here.
_MAKERS = ("jax", "jaxlib", "numpy", "equinox", "lineax", "optimistix")
_LAPACK = b"lapack_"
# JAX does not declare the settings that it makes.
_CONFIG: Any = jax.config
_folder: Path | None = None


def keep_traced(folder: Path | None) -> None:
    """Keep programs in a folder as they are traced, which nobody else may write to: what is found
    there is run. None keeps none.
    """
    global _folder
    _folder = folder


def let_programs_go() -> None:
    """Hold no compiled program any longer, JAX's own among them: the next call makes its own
    again.
    """
    for program in list(_programs):
        program.let_go()
    jax.clear_caches()


class _ProgramRequest(NamedTuple):
    """A function's arguments: those fixed in its program, and arrays."""

    fixed: tuple[tuple[str, Any], ...]
    structure: Any
    leaves: list[Any]
    double: bool  # the caller's precision, which may be set for its thread alone

    @property
    def key(self) -> tuple[Any, ...]:
        """Key that separates programs of one function while the process runs."""
        return self.fixed, self.structure, tuple(map(_kind, self.leaves)), self.double

    def file_name(self) -> str | None:
        """The same between runs; None where an argument's words do not give its value, and on
        other devices than the processor, where nobody has tried it.
        """
        if jax.default_backend() != "cpu" or _CONFIG.jax_default_device is not None:
            return None
        if not all(_plain(value) for _, value in self.fixed):
            return None
        fixed = [(name, _words(value)) for name, value in self.fixed]
        text = repr((fixed, self.key[1:], _made_with()))
        # Words of a thing that says no more of itself than where it lies in memory.
        return None if " at 0x" in text else hashlib.sha256(text.encode()).hexdigest()


def _kind(leaf: Any) -> tuple[Any, ...]:
    """Shape and type of an array, and whether JAX may take another type for it."""
    # Searches ask this of thousands of arrays; JAX's own answer takes ten times as long.
    if isinstance(leaf, np.ndarray):
        return leaf.shape, leaf.dtype, False
    kind = jax.typeof(leaf)
    return kind.shape, kind.dtype, kind.weak_type


class _Made(NamedTuple):
    """A program, and what JAX compiled for it and finds for as long as somebody holds it."""

    run: Callable[[list[Any]], Any] | None  # from arrays in a row; None where JAX's function does
    references: Any


class _Kept(NamedTuple):
    """A traced program, of arrays in a row, and how its results stand in the function's."""

    exported: jax.export.Exported
    result: Any  # with numbers of arrays in their places


class Program(Generic[Result]):
    """A function under `jax.jit`, which is all that it is to a caller that JAX traces.

    Args:
        function: of arrays and trees of them.
        fixed: names of arguments that are fixed in the program.

    Attributes:
        jitted: the function under `jax.jit`.
    """

    def __init__(self, function: Callable[..., Result], *, fixed: tuple[str, ...] = ()):
        functools.update_wrapper(self, function)
        self._name = f"{function.__module__}.{function.__name__}"
        self._function = function
        self._fixed = fixed
        self.jitted: Any = jax.jit(function, static_argnames=fixed)
        self._signature = inspect.signature(function)
        self._begun: dict[Any, Future[_Made]] = {}
        self._asked_for: set[Any] = set()
        _programs.add(self)

    def ahead(self, *args: Any, **kwargs: Any) -> None:
        """Begin to compile for arguments like these, whose values do not matter; return at once."""
        request = self._request(*args, **kwargs)
        key = request.key
        # What JAX has run once it keeps itself, after it was let go here too.
        if key not in self._asked_for:
            future = _threads().submit(self._make, request, *args, **kwargs)
            self._asked_for.add(key)
            self._begun[key] = future
            self._let_old_ones_go()

    def __call__(self, *args: Any, **kwargs: Any) -> Result:
        """Run it, after what was begun: two threads would compile the same program twice."""
        if _folder is None and not self._begun:
            return self.jitted(*args, **kwargs)
        request = self._request(*args, **kwargs)
        # JAX is tracing the caller.
        if any(isinstance(leaf, Tracer) for leaf in request.leaves):
            return self.jitted(*args, **kwargs)
        key = request.key
        begun = self._begun.get(key)
        if begun is None and _folder is not None:
            future: Future[_Made] = Future()
            self._asked_for.add(key)
            begun = self._begun.setdefault(key, future)
            self._let_old_ones_go()
            # Of several threads the first one makes it.
            if begun is future:
                try:
                    future.set_result(self._make(request, *args, **kwargs))
                except BaseException as error:
                    future.set_exception(error)
                    # An interrupt ends this thread's work too.
                    if not isinstance(error, Exception):
                        raise
        if begun is not None and begun.exception() is None:
            run = begun.result().run
            if run is not None:
                return run(request.leaves)
        # What was wrong with compiling ahead shows, with its own words, in the call itself.
        return self.jitted(*args, **kwargs)

    def let_go(self) -> None:
        """Hold none of its programs any longer."""
        self._begun.clear()
        self._asked_for.clear()

    def _let_old_ones_go(self) -> None:
        """Hold the newest programs only: each takes some megabytes."""
        # A process that keeps programs on disk asks for more shapes of one function.
        most = 4 if _folder is None else 32
        for key in list(self._begun)[:-most]:
            self._begun.pop(key, None)

    def _request(self, *args: Any, **kwargs: Any) -> _ProgramRequest:
        bound = self._signature.bind(*args, **kwargs)
        bound.apply_defaults()
        arguments = dict(bound.arguments)
        fixed = tuple((name, arguments.pop(name)) for name in self._fixed)
        leaves, structure = jax.tree.flatten(arguments)
        return _ProgramRequest(fixed, structure, leaves, bool(_CONFIG.jax_enable_x64))

    def _make(self, request: _ProgramRequest, *args: Any, **kwargs: Any) -> _Made:
        """A compiled program for arguments like these."""
        with jax.enable_x64(request.double):
            program = None if _folder is None else self._kept(_folder, request)
            if program is None:
                lowered = self.jitted.lower(*args, **kwargs)
                return _Made(run=None, references=(lowered, lowered.compile()))
            if _LAPACK in program.exported.mlir_module_serialized:
                _load_lapack()
            lowered = jax.jit(_named(program.exported.call, self._name)).lower(*request.leaves)
            # As it is compiled, not as a function of JAX's: that would compile again for arrays
            # which an exported program gave.
            compiled = lowered.compile()
            structure = jax.tree.structure(program.result)

            def run(leaves: list[Any]) -> Result:
                return jax.tree.unflatten(structure, compiled(*leaves))

            return _Made(run=run, references=lowered)

    def _kept(self, folder: Path, request: _ProgramRequest) -> _Kept | None:
        """The program as a former run traced it, or traced now and kept; None where JAX can't write
        it.
        """
        try:
            name = request.file_name()
            if name is None:
                return None
            path = folder / f"traced-{self._name}-{name}"
            if (earlier := _read(path)) is not None:
                return earlier
            traced = self._traced(request)
            # JAX's own cache, in the same folder, says what is wrong with it.
            with suppress(OSError), whole_file(path) as temporary:
                temporary.write_bytes(pickle.dumps(traced))
        except Exception:  # What this JAX cannot export or describe runs as always.
            return None
        return traced

    def _traced(self, request: _ProgramRequest) -> _Kept:
        results: list[Any] = []

        def flat(*leaves: Any) -> list[Any]:
            arguments = jax.tree.unflatten(request.structure, leaves)
            arrays, structure = jax.tree.flatten(self._function(**arguments, **dict(request.fixed)))
            results.append(jax.tree.unflatten(structure, range(len(arrays))))
            return arrays

        kinds = map(jax.typeof, request.leaves)
        shapes = [
            jax.ShapeDtypeStruct(kind.shape, kind.dtype, weak_type=kind.weak_type) for kind in kinds
        ]
        exported = jax.export.export(jax.jit(_named(flat, self._name)))(*shapes)
        # Its derivative, which nobody asks for, is a function, and can't be written.
        return _Kept(replace(exported, _get_vjp=None), results[-1])


_programs: weakref.WeakSet[Program[Any]] = weakref.WeakSet()
"""All that this process has."""


def _named(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """The function, by whose name XLA's cache and logs call its program."""

    def call(*leaves: Any) -> Any:
        return function(*leaves)

    call.__name__ = call.__qualname__ = name.rpartition(".")[2]
    return call


@functools.cache
def _load_lapack() -> None:
    """Let JAX find LAPACK, which it does where a function is lowered that asks for it: a kept
    program would call what is not there, and the process would end.
    """
    jax.jit(jnp.linalg.cholesky).lower(jnp.eye(1))


def _plain(value: Any) -> bool:
    """Test whether words give all of a value: numbers, text, a module's function, and records of
    the former.
    """
    if isinstance(value, FunctionType):
        return value.__name__ == value.__qualname__ != "<lambda>"
    if isinstance(value, tuple):
        return all(map(_plain, value))
    if is_dataclass(value):
        return all(_plain(getattr(value, field.name)) for field in fields(value))
    return value is None or isinstance(value, bool | int | float | str)


def _words(value: Any) -> str:
    """Words that identify a plain value: a module's function by its name."""
    if isinstance(value, FunctionType):
        return f"{value.__module__}.{value.__qualname__}"
    return repr(value)


@functools.cache
def _made_with() -> tuple[Any, ...]:
    """Dependencies of a traced program: versions, settings, the device, files of both packages."""
    settings = _CONFIG.values
    return (
        [version(name) for name in _MAKERS],
        sorted((k, repr(v)) for k, v in settings.items() if k != "jax_compilation_cache_dir"),
        jax.default_backend(),
        os.cpu_count(),
        [state for package in ("glazejax", "glazefit") for state in _files(package)],
    )


def _files(package: str) -> Iterator[tuple[str, int, int]]:
    """Path, size and time of each file of a package: what is traced may come from any of them."""
    spec = find_spec(package)
    for root in (spec and spec.submodule_search_locations) or ():
        for folder, _, names in sorted(os.walk(root)):
            for name in sorted(names):
                if not name.endswith(".pyc"):
                    path = os.path.join(folder, name)
                    state = os.stat(path)
                    yield path, state.st_size, state.st_mtime_ns


def _read(path: Path) -> _Kept | None:
    try:
        program = pickle.loads(path.read_bytes())
    except Exception:  # Not there, or written in part: it is traced again.
        return None
    return program if isinstance(program, _Kept) else None


@functools.cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(2, thread_name_prefix="compile")
