"""Programs in a Python of their own."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).parents[1]
PATHS = os.pathsep.join(str(_ROOT / name) for name in ("src", "fitting", "."))
"""Where a program of its own finds the packages and the tests."""


def run_python(
    code: str,
    *words: Any,
    cwd: Path | None = None,
    timeout: float = 600.0,
    env: dict[str, str] | None = None,
    status: int = 0,
) -> subprocess.CompletedProcess[str]:
    """A program that has ended as it must, with words and further variables of its environment, and
    what it says.
    """
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, words)],
        cwd=cwd,
        timeout=timeout,
        env=os.environ | {"PYTHONPATH": PATHS} | (env or {}),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == status, done.stderr
    return done
