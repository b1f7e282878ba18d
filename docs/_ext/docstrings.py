"""Docstrings with the types of the code: as they are written there, so `Float[Array, "*batch
bands"]` and `Numbers`.
"""

import ast
import inspect
import re
import textwrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

_SHORT = ("property", "attribute", "data")
_kept: dict[str, list[str]] = {}


def written_types(thing: Any) -> dict[str, str]:
    """Parameter, or attribute of a class -> its type as the source has it; "return" is what comes
    back.
    """
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(thing)))).body[0]
    except (OSError, TypeError, SyntaxError, IndexError):
        return {}
    found: dict[str, str] = {}
    if isinstance(tree, ast.ClassDef):
        for part in tree.body:
            if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
                found[part.target.id] = ast.unparse(part.annotation)
        for part in tree.body:
            if isinstance(part, ast.FunctionDef) and part.name == "__init__":
                found |= {k: v for k, v in _of_function(part).items() if k != "return"}
    elif isinstance(tree, ast.FunctionDef):
        found = _of_function(tree)
    # Quoted names are for Python alone.
    return {name: re.sub(r"^(['\"])(.*)\1$", r"\2", words) for name, words in found.items()}


def _of_function(tree: ast.FunctionDef) -> dict[str, str]:
    given = [
        *tree.args.posonlyargs,
        *tree.args.args,
        *tree.args.kwonlyargs,
        tree.args.vararg,
        tree.args.kwarg,
    ]
    found = {
        one.arg: ast.unparse(one.annotation)
        for one in given
        if one is not None and one.annotation is not None
    }
    if tree.returns is not None:
        found["return"] = ast.unparse(tree.returns)
    return found


def as_links(kind: str) -> str:
    """A type in reStructuredText: names alone, as in `Instrument | None`, are links where they are
    ours.
    """
    parts = kind.split(" | ")
    # Not inside of brackets: the bars there are of the type in them.
    if any(part.count("[") != part.count("]") for part in parts):
        parts = [kind]
    # The point before it: in whatever room it is.
    return " | ".join(
        f"`~.{part}`" if re.fullmatch(r"(?!None$)[A-Z]\w*", part) else f"``{part}``"
        for part in parts
    )


def _list_attributes(
    app: "Sphinx", what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """A section `Attributes:` becomes a list; napoleon would make links of its names, to whatever
    is called so.

    Of a property it would take what stands before a colon as its type.
    """
    if lines and lines[0].startswith("Alias for field number"):
        lines.clear()  # Python's words of a named tuple; the class says what it is.
    if what in _SHORT:
        _kept[name] = list(lines)
    if "Attributes:" not in lines:
        return
    at = lines.index("Attributes:")
    types = written_types(thing)
    made = ["**Attributes**", ""]
    end = at + 1
    while end < len(lines) and (not lines[end] or lines[end].startswith(" ")):
        line = lines[end]
        if found := re.match(r" {4}(\w+(?:, \w+)*): (.*)", line):
            kind = types.get(found[1].partition(",")[0])
            made.append(
                f"* **{found[1]}**" + (f" ({as_links(kind)})" if kind else "") + f": {found[2]}"
            )
        else:
            made.append(f"  {line.strip()}" if line.strip() else "")
        end += 1
    lines[at:end] = [*made, ""]


def _add_types(
    app: "Sphinx", what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """After napoleon: a type for each parameter that the docstring describes, and for what comes
    back.
    """
    if what in _SHORT:
        lines[:] = _kept.pop(name, lines)
    types = written_types(thing)
    for at in range(len(lines) - 1, -1, -1):
        # `m.`, alone, would begin a list: it is metres.
        lines[at] = re.sub(r"^(:param \w+: )(\w\.)$", r"\1\\\2", lines[at])
        if (found := re.match(r":param (\w+):", lines[at])) and found[1] in types:
            lines.insert(at, f":type {found[1]}: {as_links(types[found[1]])}")
    join_returns(lines)
    if what in ("function", "method") and types.get("return", "None") != "None":
        if lines and lines[-1] and not lines[-1].startswith((":", " ")):
            lines.append("")
        lines += [f":rtype: {as_links(types['return'])}", ""]


def join_returns(lines: list[str]) -> None:
    """Napoleon takes what stands before a colon in `Returns:` for the type; it is words, and goes
    back to them.
    """
    before = [at for at, line in enumerate(lines) if line.startswith(":rtype: ")]
    after = [at for at, line in enumerate(lines) if line.startswith(":returns: ")]
    if before and after:
        words = lines[before[0]].removeprefix(":rtype: ")
        lines[after[0]] = f":returns: {words}: {lines[after[0]].removeprefix(':returns: ')}"
        del lines[before[0]]


def _dashes(app: "Sphinx", doctree: "nodes.document", page: str) -> None:
    """Sphinx parts a parameter from its text by two hyphens, and would make a dash of those in
    options too.
    """
    from docutils import nodes

    for field in doctree.findall(nodes.field_body):
        for text in list(field.findall(nodes.Text)):
            if text.astext() == " -- ":
                text.parent.replace(text, nodes.Text(" – "))


def short_defaults(signature: str | None) -> str | None:
    """A signature without what Python prints of a default that has no words: `<factory>`,
    `<function <lambda>>`.

    A class that is made by others, of nothing but private parts, has no signature.
    """
    if signature is None or re.fullmatch(r"\(_\w+(, _\w+)*\)", signature):
        return signature and ""
    return re.sub(r"=<(?:[^<>]|<[^<>]*>)*>", "=...", signature)


def _sign(
    app: "Sphinx",
    what: str,
    name: str,
    thing: Any,
    options: Any,
    args: str | None,
    back: str | None,
) -> Any:
    return short_defaults(args), back


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    from pygments.lexers.special import TextLexer

    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _list_attributes, priority=400)
    app.connect("autodoc-process-docstring", _add_types, priority=600)
    app.connect("autodoc-process-signature", _sign)
    app.connect("doctree-resolved", _dashes)
    app.add_lexer("rooms", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
