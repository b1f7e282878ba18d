"""Tables of a scene file as records: what may stand in them, and errors that say where they are.

`Keys` declare one kind of table. `TomlTable.read` holds a file's table against it.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

import msgspec
from msgspec import Meta

from ...io.source import refusal, shorten
from ...names import nearest_names

# TOML's whole numbers have no bound, and a float's has one.
_LARGEST = 10**300

Text = Annotated[str, Meta(description="a text in quotes")]
Flag = Annotated[bool, Meta(description="true or false")]
Whole = Annotated[int, Meta(description="a whole number")]
Number = Annotated[float, Meta(ge=-1e308, le=1e308, description="a number")]
Positive = Annotated[float, Meta(gt=0, le=1e308, description="a number above 0")]
Size = Annotated[
    tuple[Number, Number], Meta(description="a width and a height, such as [1.0, 1.5]")
]
Vector = Annotated[
    tuple[Number, Number, Number], Meta(description="3 numbers, such as [0.0, 1.0, 2.0]")
]
Reflectance = Annotated[
    float | str, Meta(description='a number from 0 to 1, or a file "FILE.csv:SAMPLE"')
]
LENGTHS = 'the thickness of black and white, ["0um", "20um"]'
Lengths = Annotated[tuple[str, str], Meta(description=LENGTHS)]
Named = Annotated[
    dict[str, dict[str, Any]],
    Meta(min_length=1, description="one or more tables with names, such as [lights.window]"),
]
Plain = Annotated[dict[str, Any], Meta(description="a table")]


class Keys(msgspec.Struct):
    """Keys that one kind of table may have."""


_Kind = TypeVar("_Kind", bound=Keys)


@dataclass(frozen=True)
class TomlTable:
    """A table of a TOML file.

    Attributes:
        file: name of the file, for errors.
        name: of the table, such as ``lights.window``; empty for the whole file.
        content: what it holds.
        notes: remarks on what was changed in reading, of the whole file together.
    """

    file: str
    name: str
    content: Mapping[str, Any]
    notes: list[str]

    def inner(self, key: str, content: Mapping[str, Any]) -> "TomlTable":
        """The table at a key of this one."""
        name = f"{self.name}.{key}" if self.name else key
        return TomlTable(self.file, name, content, self.notes)

    def named(self, key: str, tables: dict[str, Any]) -> Iterator[tuple[str, "TomlTable"]]:
        """Tables with names that stand in the one at a key."""
        outer = self.inner(key, tables)
        return ((name, outer.inner(name, table)) for name, table in tables.items())

    def where(self, key: str = "") -> str:
        """Words for a place in the file."""
        pieces = [self.file, f"[{self.name}]" if self.name else "", key]
        return " ".join(piece for piece in pieces if piece)

    def note(self, key: str, remark: str) -> None:
        """Say what was changed at a key."""
        self.notes.append(f"{self.where(key)}: {remark}")

    def error(self, key: str, problem: str) -> ValueError:
        """An error at a key."""
        return refusal(self.where(key), problem)

    @contextmanager
    def blame(self, key: str = "") -> Iterator[None]:
        """Name this table in the errors of what is refused inside."""
        try:
            yield
        except (ValueError, OSError) as error:
            if str(error).startswith(self.file):
                raise
            raise type(error)(f"{self.where(key)}: {shorten(str(error))}") from None

    def read(self, *kinds: type[_Kind]) -> _Kind:
        """The record of this table; where there are several kinds, their tag's key says which.

        Raises:
            ValueError: a key is missing, unknown, or holds what it must not.
        """
        kind = kinds[0]
        tag = kind.__struct_config__.tag_field
        if tag is not None:
            tags = {str(kind.__struct_config__.tag): kind for kind in kinds}
            self._require(tag, f"one of {', '.join(tags)}")
            kind = tags[self.choice(tag, self.content[tag], tags)]
        fields = {field.encode_name: field for field in msgspec.structs.fields(kind)}
        # Missing keys first: a slip of the pen shows as one that is missing and one too many.
        for key, field in fields.items():
            if field.required:
                self._require(key, _description(field.type))
        for key, value in self.content.items():
            if key not in fields and key != tag:
                near = nearest_names(key, fields)
                hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(fields)}"
                raise self.error("", f"unknown key {key!r}; {hint}")
            if not _fits(value):
                raise self.error(key, "holds a number of too many digits")
        try:
            return msgspec.convert(self.content, kind)
        except msgspec.ValidationError as error:
            # msgspec names the key by its path; what may stand there is said in our words.
            key = re.findall(r"\$\.(\w+)", str(error))[0]
            value = self.content[key]
            if get_origin(fields[key].type) is Literal:
                self.choice(key, value, get_args(fields[key].type))
            problem = f"must be {_description(fields[key].type)}, not {value!r}"
            raise self.error(key, problem) from None

    def choice(self, key: str, value: Any, choices: Iterable[str]) -> str:
        """A value that must be one of several texts.

        Raises:
            ValueError: it is none of them; the message says which is near.
        """
        choices = list(choices)
        if value in choices:
            return value
        near = nearest_names(str(value), choices)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise self.error(key, f"{value!r} must be one of {', '.join(choices)}{hint}")

    def _require(self, key: str, description: str) -> None:
        if key not in self.content:
            near = nearest_names(key, self.content)
            hint = f"; is {near[0]!r} meant to be it?" if near else f": give {description}"
            raise self.error("", f"{key} is missing{hint}")


def _description(kind: Any) -> str:
    """Words for the values of a field, which may be left out (``| None``)."""
    if get_origin(kind) is not Annotated:
        kind = get_args(kind)[0]
    return kind.__metadata__[0].description


def _fits(value: Any) -> bool:
    """Test whether a float can hold the numbers."""
    if isinstance(value, list):
        return all(map(_fits, value))
    return not isinstance(value, int) or abs(value) < _LARGEST
