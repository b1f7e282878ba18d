"""The command `glazejax studio`: a local page where stacks of paint are played with."""

import contextlib
import os
import sys
from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command `studio` to the application."""
    app.command("studio")(studio)


def studio(
    stack: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="A stack to begin with, as the studio saves it.",
            show_default=False,
        ),
    ] = None,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Print the link, and open no browser.")
    ] = False,
    port: Annotated[int, typer.Option(help="Port on this computer; 0 for any that is free.")] = 0,
) -> None:
    """Stack coats of paint in a browser, and see them at once.

    A page on this computer alone opens in the browser: paints, coats with
    sliders, spectrum and colour under several lamps, a canvas, recipes for
    a colour, paints in a spectrum. Ctrl-C ends it.

    Example: glazejax studio
    """
    if not 0 <= port <= 65535:
        raise ValueError(
            f"--port is {port}; it must be between 0 and 65535, 0 for any that is free"
        )
    fragment = "" if stack is None else _fragment(stack)
    from ..commands.main import start_jax

    start_jax()
    serve(port, fragment, open_browser=not no_open)


def _fragment(path: Path) -> str:
    """A stack as the fragment of a link."""
    import json
    from urllib.parse import quote

    from ..stacks import read_stack, stack_to_dict

    return "#" + quote(
        json.dumps(stack_to_dict(read_stack(path)), separators=(",", ":"), ensure_ascii=False)
    )


def serve(port: int, fragment: str, *, open_browser: bool) -> None:
    """Start the server, say where it is, and serve until Ctrl-C; then the process ends."""
    from .server import Studio

    try:
        server = Studio(port)
    except OSError as error:
        raise ValueError(
            f"--port {port} cannot be used ({error.strerror}); leave it out for a free one"
        ) from None
    typer.echo(
        f"The studio is at {server.link}{fragment}\nThe link is yours alone. Ctrl-C ends the "
        "studio."
    )
    if open_browser:
        import threading
        import webbrowser

        # The socket listens already: the browser waits for its answer.
        threading.Timer(0.3, webbrowser.open, [server.link + fragment]).start()
    with contextlib.suppress(KeyboardInterrupt):
        server.run()
    typer.echo("The studio is closed. What you made lives on in its link, and in what you saved.")
    # A thread may still be compiling for a page, and Python's own end under it is a crash.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)
