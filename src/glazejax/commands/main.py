"""The command `glazejax`: gathers sub-commands of both packages and turns bad input into one clear
line.

The entry points `glazejax.commands` name their functions, so that this package never imports the
inverse one. Heavy imports belong inside the commands that need them.
"""

import gc
import logging
import os
import re
import sys
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

from ..extras import advice
from . import interrupts
from .help_groups import sort_options

if TYPE_CHECKING:
    import typer

# What a shell reports of a wrong command line.
_WRONG = 2


def start_jax(*, optimisation: int = 1) -> None:
    """Double precision, quick compilation and a persistent compilation cache for a command (never
    at import).

    A second run of the same command then takes 25 to 70 % of the first one's time
    (`benchmarks.cold_start`).

    Args:
        optimisation: of programs, XLA's levels: 0 where one runs once, 3 where they may run for
            minutes.
    """
    from ..program_cache import compile_quickly, enable_program_cache
    from .progress import follow

    # Python's search for circles of garbage, at its default of every 700 objects, is a fifth of a
    # command's work.
    gc.set_threshold(100_000, 20, 50)
    # It says for lines how it gets on where it can't keep a list of fonts.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    compile_quickly(optimisation)
    with follow("starting"), interrupts.loading():
        import jax

        jax.config.update("jax_enable_x64", True)
        _check_platforms()
        enable_program_cache()


def _check_platforms() -> None:
    """Say which device was asked for and is not there, before a program is compiled for it.

    Raises:
        ValueError: `JAX_PLATFORMS` names none that JAX finds.
    """
    import jax

    asked = os.environ.get("JAX_PLATFORMS", "")
    if not asked:
        return
    try:
        jax.devices()
    except (RuntimeError, AssertionError):  # The latter without the plug-in for CUDA.
        raise ValueError(
            f"JAX_PLATFORMS is {asked!r}, and JAX finds no such device here: unset it, or set "
            "JAX_PLATFORMS=cpu"
        ) from None


def make_app() -> "typer.Typer":
    """The application with all its sub-commands.

    Raises:
        ModuleNotFoundError: typer is not installed.
    """
    from importlib.metadata import entry_points, version

    import typer
    import typer.core

    # Some versions of typer write <bool> next to a flag, as if it took a value.
    def without_bool(params: list[Any]) -> list[Any]:
        for param in params:
            if getattr(param, "is_flag", False) and param.metavar is None:
                param.metavar = ""
        return params

    class Command(typer.core.TyperCommand):
        def __init__(self, *args: Any, **settings: Any) -> None:
            super().__init__(*args, **settings)
            self.params = sort_options(self.callback, self.params)

        def get_params(self, ctx: Any) -> list[Any]:
            return without_bool(sort_options(self.callback, super().get_params(ctx)))

    class Group(typer.core.TyperGroup):
        def get_params(self, ctx: Any) -> list[Any]:
            return without_bool(super().get_params(ctx))

    app = typer.Typer(
        name="glazejax",
        cls=Group,
        help="Colour of stacked paint glazes: from pigments to reflectance, and back.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
    )

    def tell_version(asked: bool | None) -> None:
        if asked:
            typer.echo(f"glazejax {version('glazejax')}")
            raise typer.Exit

    version_option = typer.Option(
        "--version", callback=tell_version, is_eager=True, help="Show the version and exit."
    )

    @app.callback()
    def _(asked: Annotated[bool | None, version_option] = None) -> None:
        """Colour of stacked paint glazes: from pigments to reflectance, and back."""

    for point in sorted(entry_points(group="glazejax.commands"), key=lambda p: p.name):
        app.command(point.name, cls=Command)(point.load())
    return app


class _PipeOutput:
    """Standard output that nobody may read to its end, as `head` does: the rest is dropped, and
    files are still written.
    """

    def __init__(self, stream: Any):
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        return self._unless_closed(self._stream.write, text)

    def flush(self) -> None:
        self._unless_closed(self._stream.flush)

    def _unless_closed(self, method: Any, *arguments: str) -> Any:
        try:
            return method(*arguments)
        except BrokenPipeError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
            return method(*arguments)


def run_command() -> None:
    """Entry point: `main` in a process of its own, which ends at once at Ctrl-C."""
    # Closed from the beginning, it is None.
    sys.stdout = _PipeOutput(sys.stdout or open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
    interrupts.watch()
    main()


def main() -> None:
    """Run a sub-command; what the user can fix ends as one line and exit status 2."""
    # Before NumPy is loaded: its matrices are small here, and threads for them only wait for each
    # other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        with interrupts.loading():
            app = make_app()
        _run(app)
    except KeyboardInterrupt:
        interrupts.leave()
    except ModuleNotFoundError as error:
        if (message := advice(error.name)) is None:
            raise
        _stop(message)
    except OSError as error:
        _stop(
            str(error)
            if error.strerror is None
            else f"{error.filename or 'a file'}: {error.strerror}"
        )
    except ValueError as error:
        _stop(str(error))


def _run(app: "typer.Typer") -> NoReturn:
    """Run what the command line asks for; a wrong option is one line too, not typer's box."""
    import typer

    # typer names the family of these errors in no version's public part.
    usage_error: type[Exception] = typer.BadParameter.__bases__[0]
    try:
        status = app(prog_name="glazejax", standalone_mode=False)
    except typer.Abort:
        interrupts.leave()
    except usage_error as error:
        message = error.format_message()  # type: ignore[attr-defined]
        if type(error).__name__ == "NoArgsIsHelpError":
            typer.echo(message)
            sys.exit(_WRONG)
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "glazejax"
        if "unexpected extra argument" in message and context:
            message = _say_extra(message, context)
        elif number := re.search(r"'(-\S+)'.*\b(integer|number|float)\b", message):
            kind = "a whole number" if number[2] == "integer" else "a number"
            message = f"'{number[1]}' must be {kind}"
        _stop(f"{message[:1].lower()}{message[1:].rstrip('.')} (see {command} --help)")
    if status in (interrupts.INTERRUPTED, interrupts.TERMINATED):
        interrupts.leave(status=status)
    sys.exit(status or 0)


def _say_extra(message: str, context: Any) -> str:
    """Words for a value without its option, with the command's own example of a line."""
    extra_values = re.search(r"\((?!s\))(.*)\)", message)
    extra = extra_values[1] if extra_values else ""
    example = re.search(r"Example: (.*)", context.command.callback.__doc__ or "")
    if context.command.name == "render":
        return f"coats stand behind --coats: glazejax render --coats {extra!r}"
    line = f", as in: {example[1]}" if example else ""
    return f"{extra!r} is too many: a value stands behind its option{line}"


def _stop(message: str) -> NoReturn:
    print(f"error: {message}", file=sys.stderr)
    sys.exit(_WRONG)
