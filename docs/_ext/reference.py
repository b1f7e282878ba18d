"""Pages of the reference: public names, from the packages' own lists, and commands with their
options.
"""

import importlib
import inspect
import re
from pathlib import Path
from types import ModuleType, UnionType
from typing import TYPE_CHECKING, Any, Literal, get_args, get_origin

from pages_of_repository import DOCS, write_if_new

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOMS = {
    "Forward: from paint to colour": [
        "glazejax",
        "glazejax.catalogue",
        "glazejax.colour",
        "glazejax.samples",
        "glazejax.io",
        "glazejax.studio",
    ],
    "Backward: from measurements to paint": ["glazefit"],
    "The solvers on arrays": [
        "glazejax.radiative",
        "glazejax.radiative.auxiliary",
        "glazejax.radiative.manyflux",
        "glazejax.radiative.rough",
        "glazejax.radiative.twoflux",
        "glazejax.radiative.plan",
        "glazejax.radiative.phase",
        "glazejax.radiative.fresnel",
    ],
    "Appearance": [
        "glazejax.appearance",
        "glazejax.appearance.display",
        "glazejax.appearance.exports",
        "glazejax.appearance.mitsuba",
        "glazejax.appearance.interreflection",
        "glazejax.appearance.metals",
        "glazejax.appearance.shading",
        "glazejax.appearance.scene",
    ],
}
"""Rooms whose names are public; a thing is described in the first that offers it."""


def room_of(name: str) -> ModuleType:
    """A room by its public name, which need not be a module's own (`glazejax.radiative.phase`)."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        parent, _, last = name.rpartition(".")
        return getattr(importlib.import_module(parent), last)


def public_names(room: ModuleType) -> list[str]:
    """Names that a room offers: its list, or else what is defined in it and has no underscore."""
    listed = getattr(room, "__all__", None)
    if listed is not None:
        return [name for name in listed if not name.startswith("_")]
    return [
        name
        for name, value in vars(room).items()
        if not name.startswith("_")
        and getattr(value, "__module__", None) == room.__name__
        and callable(value)
    ]


def first_sentence(value: Any) -> str:
    """What a name is, in a line: the beginning of its docstring; of a union of types, which has
    none, their names.
    """
    if get_origin(value) is Literal:
        return " or ".join(f"``{one!r}``" for one in get_args(value)) + "."
    if isinstance(value, UnionType):
        return " or ".join(f":py:obj:`~.{one.__name__}`" for one in get_args(value)) + "."
    words = " ".join((inspect.getdoc(value) or "").partition("\n\n")[0].split())
    return words.partition(": ")[0] if len(words) > 140 else words


def _directive(room: str, name: str, value: Any) -> list[str]:
    if inspect.isclass(value):
        return [f".. autoclass:: {name}", "   :members:", ""]
    if get_origin(value) is Literal or isinstance(value, UnionType):
        return [f".. py:data:: {name}", "", f"   {first_sentence(value)}", ""]
    if callable(value) and hasattr(value, "__doc__") and not isinstance(value, type):
        return [f".. autofunction:: {name}", ""]
    return [f".. py:data:: {name}", ""]


def _page(name: str, seen: dict[int, str]) -> str:
    room = room_of(name)
    lines = [
        name,
        "=" * len(name),
        "",
        f".. currentmodule:: {name}",
        "",
        inspect.getdoc(room) or "",
        "",
    ]
    rows, bodies = [], []
    for public in sorted(public_names(room), key=str.lower):
        value = getattr(room, public)
        if isinstance(value, ModuleType):
            rows.append(
                (
                    f":doc:`{public} <{name}.{public}>`"
                    if f"{name}.{public}" in ALL
                    else f"``{public}``",
                    value,
                )
            )
            continue
        home = seen.setdefault(id(value), f"{name}.{public}")
        rows.append((f":py:obj:`{public} <{home}>`", value))
        if home == f"{name}.{public}":
            bodies += _directive(name, public, value)
    lines += [".. list-table::", "   :widths: 38 62", "   :class: names", ""]
    for link, value in rows:
        described = (
            first_sentence(value) if inspect.isroutine(value) or not _is_plain(value) else ""
        )
        lines += [f"   * - {link}", f"     - {described}"]
    return "\n".join([*lines, "", *bodies])


def _is_plain(value: Any) -> bool:
    return isinstance(value, str | int | float | tuple | list | dict)


ALL = [name for names in ROOMS.values() for name in names]


def _index() -> str:
    lines = [
        "Reference",
        "=========",
        "",
        "Every public name, from the code itself. Everything else may change.",
        "",
    ]
    for title, names in ROOMS.items():
        lines += [
            title,
            "-" * len(title),
            "",
            ".. list-table::",
            "   :widths: 38 62",
            "   :class: names",
            "",
        ]
        for name in names:
            lines += [f"   * - :doc:`{name}`", f"     - {first_sentence(room_of(name))}"]
        lines += ["", ".. toctree::", "   :hidden:", ""]
        lines += [f"   {name}" for name in names] + [""]
    lines += ["Commands", "--------", "", ".. toctree::", "   :maxdepth: 1", "", "   commands", ""]
    return "\n".join(lines)


def as_markdown(words: str) -> str:
    """Options and whole command lines of a help text as code; its asterisks are asterisks."""

    def command(found: re.Match[str]) -> str:
        lines = [line.strip() for line in found[1].splitlines()]
        return (
            f": `{lines[0]}`" if len(lines) == 1 else "\n".join([":", "", "```sh", *lines, "```"])
        )

    words = re.sub(
        r":\s+(glazejax [a-z][^\n`]*(?:\n +glazejax [^\n`]*)*)$", command, words, flags=re.MULTILINE
    )
    parts = re.split(r"(```.*?```|`[^`]*`)", words, flags=re.DOTALL)
    return "".join(
        part
        if part[:1] == "`"
        else re.sub(r"(?<![\w-])(--[a-z][a-z-]*)", r"`\1`", part.replace("*", "\\*"))
        for part in parts
    )


def _commands() -> str:
    import typer.main

    from glazejax.commands.main import make_app

    group = typer.main.get_command(make_app())
    lines = ["# The command `glazejax`", "", "As `--help` says it.", ""]
    for name, command in sorted(group.commands.items()):  # type: ignore[attr-defined]
        # Words of a command's help are laid out by blank lines; single backquotes are code in
        # Markdown, too.
        words = as_markdown(inspect.cleandoc(command.help or "").replace("\b\n", ""))
        lines += [f"## glazejax {name}", "", words, "", "| option | what it does |", "|---|---|"]
        box = None
        for one in command.params:
            if getattr(one, "hidden", False) or one.name == "help":
                continue
            if (title := getattr(one, "rich_help_panel", None)) != box:
                lines.append(f"| **{title}** | |")
                box = title
            flags = ", ".join(f"`{flag}`" for flag in [*one.opts, *one.secondary_opts])
            if one.param_type_name == "argument":
                flags = f"`{(one.metavar or one.name).upper()}`"
            said = " ".join((getattr(one, "help", None) or "").split()).replace("|", "\\|")
            lines.append(f"| {flags} | {as_markdown(said)} |")
        lines.append("")
    return "\n".join(lines)


def _write(app: "Sphinx") -> None:
    folder = DOCS / "reference"
    seen: dict[int, str] = {}
    for name in ALL:
        write_if_new(folder / f"{name}.rst", _page(name, seen))
    write_if_new(folder / "index.rst", _index())
    write_if_new(folder / "commands.md", _commands())
    wanted = {f"{name}.rst" for name in ALL} | {"index.rst", "commands.md"}
    for path in Path(folder).iterdir():
        if path.name not in wanted:
            path.unlink()


def setup(app: "Sphinx") -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
