"""What a program would be on an NVIDIA GPU, as far as a machine without one can tell: lowered for
it, not compiled.

Lowering fails for an operation that JAX has on the CPU only, such as Schur's form.
"""

import re
import sys
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import pytest
from jax.core import Tracer

from glazejax.programs import Program

_JITTED: type = type(jax.jit(abs))
_FILTERED: type = type(eqx.filter_jit(abs))


def lowered(program: Any, *args: Any, **kwargs: Any) -> str:
    """StableHLO of a program, jitted or not, by JAX or by equinox, for CUDA.

    Raises:
        RuntimeError: the program calls the host.
        NotImplementedError: JAX has one of its operations for other devices only.
    """
    if isinstance(program, _FILTERED):
        arrays, rest = eqx.partition((args, kwargs), eqx.is_array)

        def plain(arrays: Any) -> Any:
            given, named = eqx.combine(arrays, rest)
            return eqx.filter(program.__wrapped__(*given, **named), eqx.is_array)

        return lowered(plain, arrays)
    if isinstance(program, Program):
        return lowered(program.jitted, *args, **kwargs)
    jitted = program if isinstance(program, _JITTED) else jax.jit(program)
    traced = jitted.trace(*args, **kwargs)
    if hosts := {
        name for name in operations(traced.jaxpr) if "callback" in name or "debug" in name
    }:
        raise RuntimeError(f"calls the host: {', '.join(sorted(hosts))}")
    return traced.lower(lowering_platforms=("cuda",)).as_text()


def operations(jaxpr: Any) -> set[str]:
    """Names of all operations of a traced program, those of its inner programs included."""

    def is_program(leaf: Any) -> bool:
        return hasattr(leaf, "eqns") or hasattr(leaf, "jaxpr")

    found = set()
    for equation in getattr(jaxpr, "jaxpr", jaxpr).eqns:
        found.add(equation.primitive.name)
        leaves = jax.tree.leaves(equation.params, is_leaf=is_program)
        found = found.union(*map(operations, filter(is_program, leaves)))
    return found


def trouble(text: str) -> list[str]:
    """What a GPU could not run, or only by asking the host in the midst of it."""
    targets = set(re.findall(r'(?:custom_call @|call_target_name = ")([^"(\s]+)', text))
    hosts = [name for name in targets if "callback" in name.lower() or "lapack" in name.lower()]
    return sorted(hosts) + sorted(
        set(re.findall(r"stablehlo\.(?:infeed|outfeed|send|recv)\b", text))
    )


def assert_runs_there(program: Callable[..., Any], *args: Any) -> None:
    """Lowers for CUDA, without a call of the host."""
    assert trouble(lowered(program, *args)) == []


class Programs:
    """Names of the compiled programs that ran, and what is wrong with each on a GPU."""

    def __init__(self) -> None:
        self.seen: set[str] = set()
        self.trouble: dict[str, str] = {}

    def wrap(self, name: str, program: Any) -> Callable[..., Any]:
        """The program; when it is called from outside any other, it is lowered first."""

        def run(*args: Any, **kwargs: Any) -> Any:
            inside = any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((args, kwargs)))
            if not inside and name not in self.seen:
                self.seen.add(name)
                try:
                    found = trouble(lowered(program, *args, **kwargs))
                except (NotImplementedError, RuntimeError) as error:
                    found = [str(error)]
                if found:
                    self.trouble[name] = "; ".join(found)
            return program(*args, **kwargs)

        if isinstance(program, Program):
            run.ahead = program.ahead  # type: ignore[attr-defined]
        return run


def watch(monkeypatch: pytest.MonkeyPatch, *packages: str) -> Programs:
    """From here on, every function of these packages' loaded modules that is jitted is lowered when
    first called.
    """
    programs = Programs()
    for module in [
        m for name, m in sys.modules.items() if name.split(".")[0] in packages and m is not None
    ]:
        for name, value in list(vars(module).items()):
            if isinstance(value, (_JITTED, _FILTERED, Program)):
                found = (
                    getattr(value, "__module__", module.__name__),
                    getattr(value, "__qualname__", name),
                )
                monkeypatch.setattr(module, name, programs.wrap(".".join(found), value))
    return programs
