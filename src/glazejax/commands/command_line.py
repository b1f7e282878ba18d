"""A command line as it was typed, for reports that say how they were made."""

import shlex
import sys
from pathlib import Path

# Arguments whose option is called otherwise.
_NAMES = {"binned": "bin"}


def option(name: str) -> str:
    """Spelling of an argument on the command line."""
    return f"--{_NAMES.get(name, name).replace('_', '-')}"


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
