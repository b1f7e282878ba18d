"""A process that waits for searches: a line of JSON in for each, lines of progress and one of the
result out.
"""

import importlib
import json
import os
import sys
from typing import Any, TextIO


def main() -> None:
    """Answer requests until there are no more."""
    # What a library prints must not get among the answers.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    from ..commands.main import start_jax

    start_jax()
    for line in sys.stdin:
        answer(json.loads(line), out)


def answer(asked: dict[str, Any], out: TextIO) -> None:
    """One search: its progress and its end, a line each."""

    def send(message: dict[str, Any]) -> None:
        out.write(json.dumps(message) + "\n")
        out.flush()

    module, _, name = asked["target"].partition(":")
    try:
        task = getattr(importlib.import_module(module), name)
        message = {"result": task(asked["given"], lambda stage: send({"words": stage}))}
    except (ValueError, ModuleNotFoundError) as error:
        message = {"error": str(error)}
    except Exception as error:  # The page must hear of it.
        message = {"error": f"the search failed ({type(error).__name__}: {error})"}
    send(message)


if __name__ == "__main__":
    main()
