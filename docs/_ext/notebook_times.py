"""A notebook that runs for longer than a minute is a warning, which ends a build with -W: a reader would not wait.

`GLAZEJAX_DOCS_SECONDS` is another limit, for a machine that is slow or has other work. Times count compiling; those of
a notebook that is kept from an earlier build are of that build.
"""

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

LIMIT = 60.0
"""Seconds."""


def seconds(env: "BuildEnvironment") -> dict[str, float | None]:
    """How long each notebook ran for."""
    ran: dict[str, dict[str, Any]] = getattr(env, "nb_metadata", {})
    return {page: known["exec_data"]["runtime"] for page, known in ran.items() if known.get("exec_data")}


def too_slow(took: Mapping[str, float | None], limit: float) -> list[str]:
    """A sentence for each notebook that took longer than the limit, the slowest first."""
    slow = sorted(((long, page) for page, long in took.items() if long is not None and long > limit), reverse=True)
    return [
        f"{page} ran for {long:.0f} s, and a notebook may take {limit:g}: do less in it, or set GLAZEJAX_DOCS_SECONDS"
        for long, page in slow
    ]


def _look(app: "Sphinx", env: "BuildEnvironment") -> None:
    from sphinx.util import logging

    for fault in too_slow(seconds(env), float(os.environ.get("GLAZEJAX_DOCS_SECONDS") or LIMIT)):
        logging.getLogger(__name__).warning(fault, type="notebooks", subtype="slow")


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("env-check-consistency", _look)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
