"""A command line as it was typed, for reports that say how they were made."""

import shlex
import sys
from collections.abc import Callable, Mapping
from inspect import signature
from pathlib import Path
from typing import Any

# Arguments whose option is called otherwise.
_NAMES = {"binned": "bin"}


def option(name: str) -> str:
    """Spelling of an argument on the command line."""
    return f"--{_NAMES.get(name, name).replace('_', '-')}"


def changed(command: Callable[..., object], values: Mapping[str, Any]) -> list[str]:
    """Options of a command, of these values by argument, that are not as by default."""
    usual = signature(command).parameters
    return [option(name) for name, value in values.items() if value != usual[name].default]


def command_line() -> str:
    """The command line, as the shell passed it on."""
    return shlex.join(["glazejax", *sys.argv[1:]])


def ground_file(ground: str | None) -> Path | None:
    """The file of ``--ground``, if it is one."""
    if ground is None:
        return None
    from ..io.files.sample import split_sample
    from ..io.source import split_sheet

    # A sheet is of a file, too.
    file = split_sheet(split_sample(ground)[0])[0]
    return file if file.is_file() else None
