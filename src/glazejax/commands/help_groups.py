"""Order of a command's ``--help``: common options, then input, method, output and advanced options,
each group in its own box.
"""

from collections.abc import Callable
from typing import Any, TypeVar

_Function = TypeVar("_Function", bound=Callable[..., Any])

_TITLES = ("Common", "Input", "Method", "Output", "Advanced")
"""Titles of the boxes, in the order of the help."""


def help_groups(
    *, usual: str, given: str, written: str, fine: str, tried: str = ""
) -> Callable[[_Function], _Function]:
    """Order the options of a command's function in its ``--help``.

    Args:
        usual, given, tried, written, fine: options of each box, separated by blanks.
    """
    groups = (usual, given, tried, written, fine)
    boxes = dict(zip(_TITLES, map(str.split, groups), strict=True))

    def mark(function: _Function) -> _Function:
        setattr(function, "help_groups", boxes)  # noqa: B010
        return function

    return mark


def sort_options(function: Any, params: list[Any]) -> list[Any]:
    """Options in the order of their boxes, each with its title; arguments stay in front.

    Args:
        function: of the command; without groups, nothing changes.
        params: arguments and options as the function has them, then ``--help``.
    """
    boxes = getattr(function, "help_groups", None)
    if boxes is None:
        return params
    box_of = {name: title for title, names in boxes.items() for name in names}
    rank = {name: number for number, name in enumerate(box_of)}
    for param in params:
        if param.param_type_name == "option":
            param.rich_help_panel = box_of.get(param.opts[0], "Advanced")
    last = len(rank)
    return sorted(
        params,
        key=lambda param: (
            -1 if param.param_type_name == "argument" else rank.get(param.opts[0], last)
        ),
    )
