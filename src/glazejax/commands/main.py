"""The command `glazejax`: gathers sub-commands of both packages and turns bad input into one clear line.

Commands register through the entry-point group `glazejax.commands`, so that this package never imports the
inverse one. Heavy imports belong inside the commands that need them.
"""

import os
import sys
from importlib.metadata import entry_points
from pathlib import Path

import typer

app = typer.Typer(
    name="glazejax",
    help="Colour of stacked paint glazes: from pigments to reflectance, and back.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback()
def _root() -> None:
    """Colour of stacked paint glazes: from pigments to reflectance, and back."""


def start_jax() -> None:
    """Double precision and a persistent compilation cache for a command (never at import).

    A second run of the same command then starts 2-6 times faster.
    """
    import jax

    # XLA reports every program it takes from that cache as an error, harmlessly, and for pages.
    jax.config.update("jax_logging_level", "CRITICAL")
    jax.config.update("jax_enable_x64", True)
    folder = os.environ.get("GLAZEJAX_CACHE") or Path.home() / ".cache" / "glazejax" / "xla"
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def main() -> None:
    """Entry point: run a sub-command; what the user can mend ends as one line and exit status 2."""
    for point in sorted(entry_points(group="glazejax.commands"), key=lambda p: p.name):
        point.load()(app)
    try:
        app()
    except (ValueError, FileNotFoundError, FileExistsError, IsADirectoryError, PermissionError) as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(2)
