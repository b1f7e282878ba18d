"""Annotations are checked while tests run: jaxtyping's import hook with beartype, for each function's first calls.

jaxtyping binds and checks the arguments of a call twice, which takes longer than many a call. What a loop does a
thousand times with the same types is checked a hundred times in each test.
"""

import functools
import inspect
from collections.abc import Callable
from types import CodeType
from typing import Any

import jaxtyping

_BEARTYPE = "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"
"""A whole number counts as a float, as for type checkers (PEP 484)."""

_calls: dict[CodeType, int] = {}
"""Calls of each function that were checked in this test; one inside another counts as one, however often made."""


def check_annotations(packages: list[str], most: float) -> None:
    """Check what is called in packages that are imported from now on.

    Args:
        packages: their names.
        most: calls of a function that are checked in each test.
    """
    whole = jaxtyping.jaxtyped

    def first_calls(fn: Any, *, typechecker: Any) -> Any:
        if not inspect.isfunction(fn):
            return whole(fn, typechecker=typechecker)
        checked: Callable[..., Any] | None = None

        @functools.wraps(fn)
        def called(*args: Any, **given: Any) -> Any:
            nonlocal checked
            __tracebackhide__ = True
            count = _calls.get(fn.__code__, 0)
            if count >= most or jaxtyping.config.jaxtyping_disable:
                return fn(*args, **given)
            _calls[fn.__code__] = count + 1
            if checked is None:  # A program is made of it, which takes milliseconds: not at import.
                checked = whole(fn, typechecker=typechecker)
            return checked(*args, **given)

        return called

    def jaxtyped(fn: Any = None, *, typechecker: Any) -> Any:
        return (
            functools.partial(first_calls, typechecker=typechecker)
            if fn is None
            else whole(fn, typechecker=typechecker)
        )

    jaxtyping.jaxtyped = jaxtyped  # The hook writes `@jaxtyping.jaxtyped(typechecker=...)` above each function.
    jaxtyping.install_import_hook(packages, _BEARTYPE)


def begin_test() -> None:
    """Every function's calls count anew."""
    _calls.clear()
