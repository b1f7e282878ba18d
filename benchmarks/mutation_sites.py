"""Which small faults a source file can get: sites and their changes, from cosmic-ray's operators.

Left out is what no test should hold: docstrings, annotations, `raise` and `warnings.warn` with
their words, f-strings,
`TYPE_CHECKING`, `__all__`, decorators, and operators that make no sense for the operands (`<<` for
`+`, `is` for `==`).
"""

import ast
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ARITHMETIC = ("Add", "Sub", "Mul", "Div", "FloorDiv", "Pow")
LOGIC = ("BitOr", "BitAnd", "BitXor")
ORDER = ("Eq", "NotEq", "Lt", "LtE", "Gt", "GtE")
SAME = ("Is", "IsNot")
OTHERS = (
    "ReplaceUnaryOperator_USub_UAdd",
    "ReplaceUnaryOperator_Delete_Not",
    "ReplaceUnaryOperator_Delete_Invert",
    "AddNot",
    "ReplaceTrueWithFalse",
    "ReplaceFalseWithTrue",
    "ReplaceAndWithOr",
    "ReplaceOrWithAnd",
    "ReplaceBreakWithContinue",
    "ReplaceContinueWithBreak",
    "ExceptionReplacer",
    "NumberReplacer",
    "ZeroIterationForLoop",
)
POOR = re.compile(r"(^|_)(plots?|page|report)(_|$)|^__init__$")
"""Names of files that draw and word; what they say is no number that a mutant could make wrong."""

Position = tuple[int, int]


@dataclass(frozen=True)
class Mutant:
    """One change at one place of a file."""

    file: str
    line: int
    code: str
    change: str
    operator: str
    occurrence: int

    @property
    def key(self) -> str:
        """Says which mutant it is, wherever its line has moved."""
        return "\t".join((self.file, self.code, self.change))


def names() -> list[str]:
    """Operators of cosmic-ray that are used."""
    pairs = [
        f"Replace{kind}Operator_{one}_{other}"
        for kind, group in (
            ("Binary", ARITHMETIC),
            ("Binary", LOGIC),
            ("Comparison", ORDER),
            ("Comparison", SAME),
        )
        for one in group
        for other in group
        if one != other
    ]
    return [*pairs, *OTHERS]


def files(root: Path, room: str) -> list[Path]:
    """Source files of a room (`io`, `radiative`, `colour`, ...), or of one file in it
    (`film/errors`).
    """
    found: list[Path] = []
    for package in ("src/glazejax", "fitting/glazefit"):
        folder = root / package / room
        found += sorted(folder.rglob("*.py")) if folder.is_dir() else []
        found += [path] if (path := folder.with_suffix(".py")).is_file() else []
    if not found:
        raise ValueError(
            f"{room} is neither a folder nor a file of glazejax or glazefit; write e.g. io or "
            "film/errors"
        )
    return [path for path in found if not POOR.search(path.stem)]


def _spans(source: str) -> list[tuple[Position, Position]]:
    """From where to where no change is made."""
    spans: list[tuple[Position, Position]] = []
    lines = source.split("\n")

    def place(line: int, column: int) -> Position:
        return line, len(lines[line - 1].encode()[:column].decode())

    def leave_out(node: ast.AST | None) -> None:
        if node is not None:
            at: Any = node
            spans.append((place(at.lineno, at.col_offset), place(at.end_lineno, at.end_col_offset)))

    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                leave_out(node.returns)
                for decorator in node.decorator_list:
                    leave_out(decorator)
            case ast.ClassDef():
                for decorator in node.decorator_list:
                    leave_out(decorator)
            case ast.arg() | ast.AnnAssign():
                leave_out(node.annotation)
            case ast.Raise() | ast.JoinedStr() | ast.Import() | ast.ImportFrom():
                leave_out(node)
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                leave_out(node)
            case ast.Assign(targets=[ast.Name(id="__all__")]):
                leave_out(node)
            case ast.Call(func=ast.Attribute(value=ast.Name(id="warnings"))):
                leave_out(node)
            case _:
                pass
    return spans


def _nodes(node: Any) -> Iterator[Any]:
    yield node
    for child in getattr(node, "children", ()):
        yield from _nodes(child)


def sites(path: Path) -> dict[tuple[Position, str], list[tuple[str, int]]]:
    """Places where a file can be changed, each with its changes (operator, which
    occurrence of it).
    """
    import cosmic_ray.plugins  # pyright: ignore[reportMissingImports]
    from cosmic_ray.ast import get_ast  # pyright: ignore[reportMissingImports]

    source = path.read_text()
    spans = _spans(source)
    nodes = list(_nodes(get_ast(source)))
    found: dict[tuple[Position, str], list[tuple[str, int]]] = {}
    for name in names():
        operator = cosmic_ray.plugins.get_operator(f"core/{name}")()
        places = [start for node in nodes for start, _ in operator.mutation_positions(node)]
        for occurrence, start in enumerate(places):
            if not any(first <= start < last for first, last in spans):
                found.setdefault((start, name.split("_")[0]), []).append((name, occurrence))
    return found


def mutated(source: str, operator: str, occurrence: int) -> str | None:
    """Source with the change in it; None where that is no Python or the same Python."""
    import cosmic_ray.plugins  # pyright: ignore[reportMissingImports]
    from cosmic_ray.mutating import MutationVisitor  # pyright: ignore[reportMissingImports]

    class Visitor(MutationVisitor):
        """Keeps the spaces before what is changed, so that lines stay lines."""

        def visit(self, node: Any) -> Any:
            prefix = node.prefix if node.type == "number" else None
            node = super().visit(node)
            if prefix is not None and node.value.startswith(" "):
                node.value, node.prefix = node.value[1:], prefix
            return node

    text = Visitor.mutate_code(
        source, cosmic_ray.plugins.get_operator(f"core/{operator}")(), occurrence
    )
    try:
        same = text is None or ast.dump(ast.parse(text)) == ast.dump(ast.parse(source))
    except SyntaxError:
        return None
    return None if same else text


def sample(root: Path, rooms: list[str], seed: int) -> Iterator[Mutant]:
    """Mutants without end of any room before the other: each room's sites in random order, one
    change a site.
    """

    def of(room: str) -> Iterator[Mutant]:
        chance = random.Random(f"{seed} {room}")
        everything = [(path, *site) for path in files(root, room) for site in sites(path).items()]
        chance.shuffle(everything)
        for path, ((line, _), _), changes in everything:
            source = path.read_text()
            operator, occurrence = chance.choice(changes)
            if (text := mutated(source, operator, occurrence)) is None:
                continue
            code, change = source.split("\n")[line - 1].strip(), text.split("\n")[line - 1].strip()
            yield Mutant(str(path.relative_to(root)), line, code, change, operator, occurrence)

    waiting = [of(room) for room in rooms]
    while waiting:
        for one in list(waiting):
            if (mutant := next(one, None)) is None:
                waiting.remove(one)
            else:
                yield mutant
