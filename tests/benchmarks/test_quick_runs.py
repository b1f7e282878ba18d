"""Every benchmark at small size, in a process of its own: it runs to its end, and records all that
texts quote.
"""

import ast
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks import results

ROOT = Path(__file__).parents[2]
FILES = [
    path
    for path in sorted((ROOT / "benchmarks").rglob("*.py"))
    if "Results(" in path.read_text() and path.name != "results.py"
]


def module_of(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts).removesuffix(".__main__")


def declared(path, name):
    """The words of `NEEDS = ("gpu",)` at the top of a module, without importing it."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            return ast.literal_eval(node.value)
    return ()


def lacking(needs):
    """Those of `data/NAME`, `program/NAME`, `gpu` and packages that are not here."""
    data = Path(os.environ.get("GLAZEJAX_DATA") or ROOT.parent / "shared" / "data")
    there = {
        "data": lambda name: (data / name).is_dir(),
        "program": shutil.which,
        "": lambda name: (
            shutil.which("nvidia-smi") if name == "gpu" else importlib.util.find_spec(name)
        ),
    }
    return [need for need in needs if not there[need.rpartition("/")[0]](need.rpartition("/")[2])]


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=module_of)
def test_a_benchmark_runs_at_small_size_and_records_what_texts_quote(path, tmp_path):
    if missing := lacking(declared(path, "NEEDS")):
        pytest.skip(f"needs {', '.join(missing)}")
    command = [sys.executable, "-m", module_of(path), "--quick", "--out", str(tmp_path)]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=1200, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    written = sorted(tmp_path.glob("*.txt"))
    assert written
    parts = lacking(declared(path, "PARTS_NEED"))
    needs_size = declared(path, "NEEDS_SIZE")
    for result in written:
        recorded = json.loads(result.with_suffix(".json").read_text())["values"].keys()
        quoted = (
            results.read(result.stem)["values"].keys() if result.stem in results.names() else ()
        )
        missing = [name for name in quoted if name not in recorded]
        assert parts or all(name.startswith(needs_size) for name in missing), missing
