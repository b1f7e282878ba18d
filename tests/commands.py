"""A command line in this process, with its errors as exceptions."""

import sys
from typing import Any
from unittest import mock

import typer.main
from typer.testing import CliRunner

from glazejax.commands.main import make_app


def commands() -> Any:
    """All commands by their names, as typer declares them."""
    return typer.main.get_command(make_app()).commands  # pyright: ignore[reportAttributeAccessIssue]


def invoke(*words: Any):
    """What comes of a command and its words."""
    line = [*map(str, words)]
    with mock.patch.object(sys, "argv", ["glazejax", *line]):
        return CliRunner().invoke(make_app(), line)


def succeed(*words: Any):
    """The same of a command that ends well."""
    done = invoke(*words)
    assert done.exit_code == 0, done.output
    return done
