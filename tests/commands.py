"""One command in this process, with its errors as exceptions."""

import sys
from collections.abc import Callable
from typing import Any
from unittest import mock

import typer
from typer.testing import CliRunner


def invoke(register: Callable[[typer.Typer], None], name: str, *words: Any):
    """What comes of a command and its words."""
    app = typer.Typer()
    register(app)
    app.callback()(lambda: None)
    line = [name, *map(str, words)]
    with mock.patch.object(sys, "argv", ["glazejax", *line]):
        return CliRunner().invoke(app, line)
