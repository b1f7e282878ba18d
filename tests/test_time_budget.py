"""The clock that guards CI: past its time no test begins, and the run names those that it left
out.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_a_run_names_the_tests_that_it_left_out():
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/test_progress.py"],
        cwd=ROOT,
        env={**os.environ, "GLAZEJAX_TEST_SECONDS": "0"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "not begun: its time was up" in done.stdout
    assert "tests/test_progress.py::" in done.stdout
    assert " passed" not in done.stdout
