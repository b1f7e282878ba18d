"""Names of arguments and attributes before version 0.2, which still work for that version."""

import functools
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def accept_former_keywords(**names: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorate a function so that keywords by their former names reach it under their new ones.

    A former name warns with DeprecationWarning; both names in one call are a TypeError.

    Args:
        names: former name = new name.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @functools.wraps(function)
        def call(*args: P.args, **given: P.kwargs) -> T:
            for former in names.keys() & given.keys():
                new = names[former]
                if new in given:
                    raise TypeError(
                        f"{function.__name__}() takes {new}, of which {former} is the former name; "
                        "both are given: leave the former one out"
                    )
                warnings.warn(
                    f"the argument {former} of {function.__name__}() is called {new} now",
                    DeprecationWarning,
                    stacklevel=2,
                )
                given[new] = given.pop(former)
            return function(*args, **given)

        return call

    return decorate


def accept_name_first(keyword: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Decorate a function so that a name, or names, before all other arguments reach it by keyword.

    They warn with DeprecationWarning.

    Args:
        keyword: what the function calls them.
    """

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        @functools.wraps(function)
        def call(*args: P.args, **given: P.kwargs) -> T:
            names = args[0] if args else None
            texts = [names] if isinstance(names, str) else names
            if not (isinstance(texts, list | tuple) and texts and isinstance(texts[0], str)):
                return function(*args, **given)
            warnings.warn(
                f"the first argument of {function.__name__}() is given by keyword now: "
                f"{keyword}=...",
                DeprecationWarning,
                stacklevel=2,
            )
            return function(*args[1:], **{keyword: names}, **given)  # type: ignore[arg-type]

        return call

    return decorate


def accept_former_grounds(function: Callable[P, T]) -> Callable[P, T]:
    """Decorate a function so that `grounds`, as `ground` was called, works: None was for films that
    hide it, which are `opaque` now.
    """

    @functools.wraps(function)
    def call(*args: P.args, **given: P.kwargs) -> T:
        if "grounds" in given:
            warnings.warn(
                f"the argument grounds of {function.__name__}() is called ground now, and None is "
                "opaque=True",
                DeprecationWarning,
                stacklevel=2,
            )
            ground = given.pop("grounds")
            given["opaque" if ground is None else "ground"] = True if ground is None else ground
        return function(*args, **given)

    return call


def former_attribute(former: str, new: str) -> property:
    """A property that gives an attribute by its former name, with a DeprecationWarning."""

    def get(self: Any) -> Any:
        warnings.warn(
            f"{type(self).__name__}.{former} is called {new} now", DeprecationWarning, stacklevel=2
        )
        return getattr(self, new)

    return property(get, doc=f"`{new}` by its former name.")
