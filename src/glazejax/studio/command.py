"""The command `glazejax studio`: a page to play with stacks of paint, local or as a file."""

import contextlib
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..commands import options

if TYPE_CHECKING:
    from ..paint.media import Pigment


def studio(
    stack: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            callback=options.there,
            help="First stack, as saved by the studio.",
            show_default=False,
        ),
    ] = None,
    page: Annotated[
        Path | None,
        options.option(
            metavar="FILE.html",
            help="Write the page to one file that opens offline, and stop.",
        ),
    ] = None,
    catalogue: Annotated[
        Path | None,
        options.option(
            metavar="FILE.csv",
            callback=options.there,
            help="Your own paints, added to the catalogues', as written by `recover`.",
        ),
    ] = None,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Print the link without opening a browser.")
    ] = False,
    port: Annotated[
        int,
        typer.Option(
            callback=options.between(0, 65535),
            help="Port on this computer, 0 for any free one.",
        ),
    ] = 0,
    overwrite: options.Overwrite = False,
) -> None:
    """Stack coats of paint in a browser, and see them at once.

    A page on this computer alone opens in the browser: paints, coats with
    sliders, spectrum and colour under several lamps, a canvas, recipes for
    a colour, paints in a spectrum. Ctrl-C ends it.

    --page writes the page to one file instead, which opens offline and on a
    phone, without Python. Searches and measured files need the studio.

    Example: glazejax studio
    """
    options.check_outputs({"--page": page}, overwrite, pictures=(), inputs=[stack, catalogue])
    from ..commands.main import start_jax

    start_jax()
    begin = None
    if stack is not None:
        from ..stacks import read_stack, stack_to_dict

        begin = stack_to_dict(read_stack(stack))
    own_paints = {} if catalogue is None else _own(catalogue)
    if page is None:
        import json
        from urllib.parse import quote

        # A stack is the fragment of a link.
        text = json.dumps(begin, separators=(",", ":"), ensure_ascii=False)
        fragment = "" if begin is None else f"#{quote(text)}"
        serve(port, fragment, open_browser=not no_open, own_paints=own_paints)
        return
    from ..whole_file import whole_file
    from .one_file import one_file

    text = one_file(own_paints, begin)
    with whole_file(page) as temporary:
        temporary.write_text(text, encoding="utf-8")
    typer.echo(f"{page}: the studio as one file of {len(text.encode()) / 1e6:.2f} MB.")


def _own(path: Path) -> "dict[str, Pigment]":
    """One's own paints, by names that no catalogue has."""
    from ..paint.pigment_table import read_pigments
    from ..stacks import own_name

    # The page lists one's own paints with those of the catalogues, by one set of names.
    paints = [paint.renamed(own_name(name)) for name, paint in read_pigments(path).items()]
    return {paint.name: paint for paint in paints}


def serve(
    port: int,
    fragment: str,
    *,
    open_browser: bool,
    own_paints: "Mapping[str, Pigment] | None" = None,
) -> None:
    """Start the server, say where it is, and serve until Ctrl-C; then the process ends."""
    from .server import Studio

    try:
        server = Studio(port, own_paints=own_paints)
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
    # A thread may still read a file for a page, and nobody waits for it.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)
