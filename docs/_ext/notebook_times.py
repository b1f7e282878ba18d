"""How long each notebook ran: a line in the log for those that a reader would not wait for.

It is no warning, so a slow machine ends no build. Times count compiling; those of a notebook that
is kept from an earlier build are of that build.
"""

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

PATIENCE = 60.0
"""Seconds."""


def seconds(env: "BuildEnvironment") -> dict[str, float | None]:
    """How long each notebook ran for."""
    ran: dict[str, dict[str, Any]] = getattr(env, "nb_metadata", {})
    return {
        page: known["exec_data"]["runtime"] for page, known in ran.items() if known.get("exec_data")
    }


def slow_notebooks(took: Mapping[str, float | None]) -> list[str]:
    """A line for each notebook that ran for longer than a minute, the slowest first."""
    slow = sorted(
        ((long, page) for page, long in took.items() if long is not None and long > PATIENCE),
        reverse=True,
    )
    return [f"{page} ran for {long:.0f} s" for long, page in slow]


def _tell(app: "Sphinx", env: "BuildEnvironment") -> None:
    # Not through Sphinx, whose quiet builds would swallow it.
    for line in slow_notebooks(seconds(env)):
        print(line, file=sys.stderr)


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("env-check-consistency", _tell)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
