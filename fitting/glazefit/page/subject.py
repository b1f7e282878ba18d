"""Subject of a report, as who files it says: free text at its head."""

from pathlib import Path
from typing import Annotated, Any

import typer

TITLES = {
    "object": "Object",
    "inventory": "Inventory number",
    "spot": "Spot",
    "operator": "Operator",
}
"""Titles of the texts at a page's head, by the names of their options."""
# Characters of a text: more is no line of a page's head.
_LONGEST = 200


def _text(name: str, description: str) -> Any:
    return typer.Option(
        name, metavar="TEXT", help=f"{description}, for the head of --report.", show_default=False
    )


Object = Annotated[str, _text("--object", "What was measured")]
Inventory = Annotated[str, _text("--inventory", "Its inventory number")]
Spot = Annotated[str, _text("--spot", "Where on it was measured")]
Operator = Annotated[str, _text("--operator", "Who measured")]


def check_subject(report: Path | None, **texts: str) -> dict[str, str]:
    """Texts of a report on its subject, by their names; empty ones are left out.

    Args:
        report: the page, or None if there is none.
        texts: by the names of their options.

    Raises:
        ValueError: a text of more than 200 characters, one with a control character such as a line
            break, or one without a report.
    """
    subject = {name: text.strip() for name, text in texts.items() if text.strip()}
    for name, text in subject.items():
        if report is None:
            raise ValueError(f"--{name} stands at the head of a report: give --report too")
        if len(text) > _LONGEST:
            raise ValueError(
                f"--{name} has {len(text)} characters; a report's head has room for {_LONGEST}"
            )
        if not text.isprintable():
            odd = next(c for c in text if not c.isprintable())
            raise ValueError(
                f"--{name} holds the character U+{ord(odd):04X}, which is not printed: leave it out"
            )
    return subject


def beside(path: Path) -> tuple[Path, Path]:
    """The table and the JSON that are written with a page.

    Raises:
        ValueError: the page's name does not end in .html.
    """
    if path.suffix != ".html":
        raise ValueError(
            f"--report {path}: a report ends in .html, such as {path.with_suffix('.html')}"
        )
    return path.with_suffix(".csv"), path.with_suffix(".json")
