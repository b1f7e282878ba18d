"""Programs that are compiled by a thread of their own, while what comes before them still runs.

XLA compiles without Python's lock, so that on two cores a search's later programs are ready when it
comes to them.
"""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from typing import Any, Generic, ParamSpec, TypeVar

import jax

Given = ParamSpec("Given")
Result = TypeVar("Result")


class Program(Generic[Given, Result]):
    """A function under `jax.jit` that can be compiled ahead of its first call.

    Args:
        jitted: what `jax.jit` made.
    """

    def __init__(self, jitted: Callable[Given, Result]):
        self._jitted = jitted
        self._begun: list[Future[Any]] = []

    def ahead(self, *args: Given.args, **kwargs: Given.kwargs) -> None:
        """Begin to compile for arguments like these, whose values do not matter; return at once."""
        # JAX finds what was compiled for as long as somebody holds it: here that is the future.
        double = bool(jax.config.jax_enable_x64)  # pyright: ignore[reportAttributeAccessIssue]
        self._begun = [*self._begun[-3:], _thread().submit(self._compiled, double, *args, **kwargs)]

    def _compiled(self, double: bool, *args: Any, **kwargs: Any) -> Any:
        # The caller's precision may be set for its thread alone.
        with jax.enable_x64(double):
            lowered = self._jitted.lower(*args, **kwargs)  # type: ignore[attr-defined]
            return lowered, lowered.compile()

    def __call__(self, *args: Given.args, **kwargs: Given.kwargs) -> Result:
        """Run it, after what was begun: two threads would compile the same program twice."""
        for future in self._begun:
            # What is wrong shows, with its own words, in the call itself.
            future.exception()
        return self._jitted(*args, **kwargs)


@cache
def _thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix="compile")
