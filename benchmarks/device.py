"""Which device a benchmark computes on: `--device cpu`, the default, or `--device gpu`.

On a GPU the results go to a file of their own, NAME_gpu.txt, which names the device. `python -m
benchmarks.solver.on_gpu` fills all of them.
"""

import argparse
from typing import Any

import jax

CHOICES = ("cpu", "gpu")


def add_option(parser: argparse.ArgumentParser) -> None:
    """`--device {cpu,gpu}`."""
    parser.add_argument(
        "--device", choices=CHOICES, default="cpu", help="where to compute (default: %(default)s)"
    )


def start(device: str) -> Any:
    """Let JAX compute on this device by default, and nowhere else unless asked to; the device (of
    JAX).

    Before anything is computed. With a GPU the processor stays at hand for what is compared with
    it.

    Raises:
        SystemExit: there is no GPU, or JAX for it is not installed; says so in one sentence.
    """
    jax.config.update("jax_platforms", "cpu" if device == "cpu" else "cuda,cpu")
    try:
        found = jax.devices()[0]
    except RuntimeError:
        found = None
    # Of several platforms JAX passes over, without a word, one that is not there.
    if found is None or (device == "gpu" and found.platform == "cpu"):
        raise SystemExit(
            "--device gpu: JAX finds no NVIDIA GPU in this machine; install '.[cuda]' on one "
            "that has it, "
            "or leave the option out"
        )
    return found


def file_name(benchmark: str, device: str) -> str:
    """Name of the file of results: those of a GPU stand next to those of the processor."""
    return benchmark if device == "cpu" else f"{benchmark}_{device}"


def words(device: Any) -> str:
    """One line for the results."""
    return (
        f"Device: {device.device_kind if device.platform != 'cpu' else 'the processor'} "
        f"({device.platform})"
    )
