"""Templates of the HTML reports. What they fill in is escaped, and a name without a value is an
error.
"""

from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

from .words import chance, typeset

if TYPE_CHECKING:
    from jinja2 import Environment


def fill_template(path: str, /, **values: Any) -> Iterator[str]:
    """A page or a part of one, piece by piece.

    Args:
        path: of the template, in the package.
        values: what it is filled with, by the names that it uses.
    """
    return _environment().get_template(path).generate(**values)


@cache
def _environment() -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("glazefit", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["words"] = typeset
    environment.filters["chance"] = lambda probability: typeset(chance(probability))
    return environment
