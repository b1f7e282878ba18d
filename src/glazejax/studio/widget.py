"""The studio as a widget of Jupyter and marimo: the same page, its messages by the kernel instead
of a socket.
"""

from copy import deepcopy
from functools import cache
from typing import Any

from ..extras import require
from ..paint.media import Glaze
from ..stacks import Stack, stack_from_dict, stack_of, stack_to_dict
from .jobs import Jobs
from .one_file import bundle, page_text
from .session import Session

_USUAL = {
    "glazejax": "stack",
    "version": 1,
    "coats": [{"paint": {"CobaltBlue": 1}, "um": 0.5}, {"paint": {"ZincWhite": 1}, "um": 8}],
    "ground": "card",
}


@cache
def make_widget() -> type:
    """The class `Widget`.

    Raises:
        ModuleNotFoundError: anywidget is not installed.
    """
    require("anywidget")
    import anywidget
    import traitlets

    class Widget(anywidget.AnyWidget):
        """A glaze studio in a notebook.

        Args:
            stack: a `glazejax.Glaze`, a `glazejax.stacks.Stack`, or what
                `glazejax.stacks.stack_from_dict` takes; two coats if left out.
            tasks: searches, see `glazejax.studio.jobs`; those installed if left out.

        Attributes:
            stack: what is stacked, as `stack_to_dict` gives it, with a dictionary's parts as they
                were written; set it, and the page follows.
            seen: wavelengths, reflectance (on the ground, of a card on white), L*a*b* and sRGB (8
                bits) of the stack under the first lamp, as the page computed them; None until it
                has.

        Raises:
            ValueError: a stack that is none.
        """

        _esm = bundle("notebook")
        _css = page_text("style.css")
        stack = traitlets.Any().tag(sync=True)
        seen = traitlets.Dict(default_value=None, allow_none=True).tag(sync=True)

        def __init__(
            self,
            stack: Glaze | Stack | dict[str, Any] | None = None,
            tasks: dict[str, str] | None = None,
        ):
            super().__init__(stack=_plain(_USUAL if stack is None else stack))
            self._session = Session(
                Jobs(tasks), lambda message: self.send({"glaze": "answer"}, [message])
            )
            self.on_msg(self._take)

        def _take(self, _: Any, content: Any, buffers: Any) -> None:
            """A message of the page."""
            if isinstance(content, dict) and content.get("glaze") == "question" and buffers:
                self._session.handle(bytes(buffers[0]))

        @traitlets.validate("stack")
        def _checked(self, proposal: Any) -> dict[str, Any]:
            stack = proposal["value"]
            plain = _plain(stack)
            # In the page's own words: sent back in others it would be another stack there. A
            # copy, so that who edits their dictionary and sets it again is heard.
            return {**plain, **deepcopy(stack)} if isinstance(stack, dict) else plain

        def close(self) -> None:
            """End its searches too."""
            if hasattr(self, "_session"):
                self._session.jobs.close()
            super().close()

    return Widget


def _plain(stack: Glaze | Stack | dict[str, Any]) -> dict[str, Any]:
    """A stack as the page has it, checked."""
    if isinstance(stack, Glaze):
        stack = stack_of(stack)
    return stack_to_dict(stack if isinstance(stack, Stack) else stack_from_dict(stack))
