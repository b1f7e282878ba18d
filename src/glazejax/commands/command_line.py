"""A command line as it was typed, from the values of a command's arguments: for reports that say
how they were made.
"""

import inspect
import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

# Arguments whose option is called otherwise.
_NAMES = {"binned": "bin"}


def option(name: str) -> str:
    """How an argument of a command is written on the command line."""
    return f"--{_NAMES.get(name, name).replace('_', '-')}"


def command_line(
    function: Callable[..., Any], name: str, typed: Mapping[str, Any], arguments: Sequence[str] = ()
) -> str:
    """The command line, with the options that differ from what they are by default.

    Args:
        function: of the command.
        name: of the command.
        typed: all options and their values.
        arguments: which of them have no name on the command line.
    """
    usual = inspect.signature(function).parameters
    line = ["glazejax", name, *(str(typed[each]) for each in arguments if typed[each] is not None)]
    for each, value in typed.items():
        if each in arguments or value == usual[each].default:
            continue
        for one in value if isinstance(value, list) else [value]:
            line += [option(each)] if one is True else [option(each), str(one)]
    return shlex.join(line)


def ground_file(ground: str | None) -> Path | None:
    """The file of ``--ground``, if it is one."""
    from ..io.files.sample import split_sample

    path = None if ground is None else split_sample(ground)[0]
    return path if path is not None and path.is_file() else None
