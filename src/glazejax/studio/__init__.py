"""The glaze studio: a local page, and a widget for notebooks, where stacks of paint are played
with, live.

The page is plain ES modules in `page/`, which compute every colour themselves (`page/solver.js`)
from what `page_data` gives them; `one_file` joins all of it into one text. For what needs Python
`session` reads messages, `server` guards the door, `jobs` runs searches in parallel.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    # Made by `glazejax.studio.widget.make_widget` when it is asked for.
    Widget: Any
    """A glaze studio in a notebook, `Widget(stack=None, tasks=None)`: of a `glazejax.Glaze`, a
    `glazejax.stacks.Stack` or its JSON (by default two coats), and with searches (by default those
    installed).

    Its attribute `stack` is what is stacked: set it, and the page follows; `seen` is what the page
    computed of it. `help(Widget)` has the rest.
    """

__all__ = ["Widget"]


def __getattr__(name: str) -> Any:
    """`Widget`, once it is asked for: it needs the package anywidget."""
    if name == "Widget":
        from .widget import make_widget

        return make_widget()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
