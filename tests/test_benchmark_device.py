"""`--device` of the benchmarks: one sentence where there is no GPU, and a file of its own where
there is one.
"""

import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks import device

ROOT = Path(__file__).parents[1]


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, timeout=300
    )


@pytest.mark.processor
@pytest.mark.parametrize(
    "benchmark", ["solver.on_gpu", pytest.param("paint.identification", marks=pytest.mark.slow)]
)
def test_without_a_gpu_one_sentence_says_so(benchmark, tmp_path):
    done = run(f"benchmarks.{benchmark}", "--device", "gpu", "--out", str(tmp_path))
    if done.returncode == 0:
        pytest.skip("there is a GPU here")
    lines = [line for line in done.stderr.splitlines() if not line.startswith(("W", "E", "I"))]
    assert lines == [
        "--device gpu: JAX finds no NVIDIA GPU in this machine; install '.[cuda]' on one that "
        "has it, "
        "or leave the option out"
    ]
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


def test_results_of_a_gpu_stand_beside_those_of_the_processor():
    assert device.file_name("frontier", "cpu") == "frontier"
    assert device.file_name("frontier", "gpu") == "frontier_gpu"


@pytest.mark.slow
@pytest.mark.processor
def test_the_command_for_a_gpu_runs_its_goals_on_a_processor(tmp_path):
    done = run("benchmarks.solver.on_gpu", "--device", "cpu", "--quick", "--out", str(tmp_path))
    text = (tmp_path / "on_gpu_cpu.txt").read_text()
    assert done.returncode == 0, done.stderr
    assert "failed" not in text
    goals = "10000 stacks of 2 layers, float32", "400 x 400 pixels", "ALL SINGLES AND PAIRS"
    for words in ("Device: the processor", *goals):
        assert words in text
