"""The frame of a report: one HTML file that needs nothing from elsewhere, and its lists and tables.

Arguments that end up as text are escaped here; those that are called HTML are put in as they are.
"""

from collections.abc import Mapping
from html import escape
from importlib.resources import files

END = "</main>\n</body>\n</html>\n"
"""What closes the page that `page_start` opens."""


def page_start(title: str, head: str, *, style: str = "", images: str = "") -> str:
    """The page down to its main part.

    Args:
        title: of the page, and its heading.
        head: HTML below the heading.
        style: further CSS.
        images: where images may come from, such as "data:"; by default there are none.
    """
    css = files("glazefit.page").joinpath("page.css").read_text(encoding="utf-8") + style
    policy = (
        f"default-src 'none'; {f'img-src {images}; ' if images else ''}style-src 'unsafe-inline'; "
        "base-uri 'none'; form-action 'none'"
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{css}</style>\n</head>\n<body>\n"
        f"<header>\n<h1>{escape(title)}</h1>\n{head}</header>\n<main>\n"
    )


def facts_html(facts: Mapping[str, str]) -> str:
    """Names and words as a list of definitions; those without words are left out."""
    pairs = "".join(
        f"<dt>{escape(name)}</dt><dd>{escape(str(words))}</dd>"
        for name, words in facts.items()
        if words
    )
    return f"<dl>{pairs}</dl>\n"


def table_html(head: str, rows: str, attributes: str = "") -> str:
    """A table that scrolls by itself where it is too wide.

    Args:
        head: HTML of the heading's cells.
        rows: HTML of the rows.
        attributes: of the table, with a blank before them.
    """
    return (
        f'<div class="scroll"><table{attributes}>\n<thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{rows}</tbody></table></div>\n"
    )
