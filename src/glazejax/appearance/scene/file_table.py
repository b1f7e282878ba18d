"""One table of a scene file: its values by name, checked, with errors that say where they are."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, overload

from ...io.source import refusal, shorten
from ...names import nearest_names

_REQUIRED: Any = object()
_LARGEST = 10**300


class TomlTable:
    """A table of a TOML file.

    Args:
        file: name of the file, for errors.
        name: of the table, such as ``lights.window``; empty for the whole file.
        content: what it holds.
        outer: the table that it stands in.

    Attributes:
        notes: remarks on what was changed in reading, those of the whole file together.
    """

    def __init__(
        self, file: str, name: str, content: Mapping[str, Any], outer: "TomlTable | None" = None
    ):
        self.file: str = file
        self.name: str = name
        self._content = content
        self.notes: list[str] = [] if outer is None else outer.notes
        self._used: list[str] = []

    def where(self, key: str = "") -> str:
        """Words for a place in the file."""
        parts = [self.file, f"[{self.name}]" if self.name else "", key]
        return " ".join(part for part in parts if part)

    def note(self, key: str, words: str) -> None:
        """Say what was changed at a key."""
        self.notes.append(f"{self.where(key)}: {words}")

    def error(self, key: str, words: str) -> ValueError:
        """An error at a key."""
        return refusal(self.where(key), words)

    @contextmanager
    def blame(self, key: str = "") -> Iterator[None]:
        """What is refused inside is said to be here."""
        try:
            yield
        except (ValueError, OSError) as error:
            if str(error).startswith(self.file):
                raise
            raise type(error)(f"{self.where(key)}: {shorten(str(error))}") from None

    def done(self) -> None:
        """Refuse keys that nobody asked for.

        Raises:
            ValueError: there is one; the message says what is near.
        """
        for key in self._content:
            if key not in self._used:
                near = nearest_names(key, self._used)
                known = (
                    f"did you mean {near[0]!r}?"
                    if near
                    else f"known here are {', '.join(self._used)}"
                )
                raise self.error("", f"unknown key {key!r}; {known}")

    def _get(self, key: str, default: Any) -> Any:
        self._used.append(key)
        if key in self._content:
            value = self._content[key]
            if not _fits(value):
                raise self.error(key, "holds a number of too many digits")
            return value
        if default is _REQUIRED:
            near = nearest_names(key, self._content)
            raise self.error(
                "", f"{key} is missing" + (f"; is {near[0]!r} meant to be it?" if near else "")
            )
        return default

    def has(self, key: str) -> bool:
        """Whether a key is there; it need not be asked for otherwise."""
        self._used.append(key)
        return key in self._content

    def table(self, key: str, default: Any = _REQUIRED) -> "TomlTable":
        """A table inside this one."""
        value = self._get(key, default)
        name = f"{self.name}.{key}" if self.name else key
        if not isinstance(value, Mapping):
            raise self.error(key, f"must be a table [{name}], not {value!r}")
        return TomlTable(self.file, name, value, self)

    def tables(self, key: str) -> dict[str, "TomlTable"]:
        """Named tables inside a table, at least one."""
        outer = self.table(key, {})
        if not outer._content:
            raise self.error("", f"there are no {key}: give at least one table [{key}.NAME]")
        return {name: outer.table(name) for name in outer._content}

    def text(self, key: str, default: Any = _REQUIRED) -> str:
        """A text."""
        value = self._get(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"must be a text in quotes, not {value!r}")
        return value

    def choice(self, key: str, choices: Sequence[str], default: Any = _REQUIRED) -> str:
        """One of several texts."""
        value = self.text(key, default)
        if value not in choices:
            near = nearest_names(value, choices)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise self.error(key, f"{value!r} must be one of {', '.join(choices) or 'none'}{hint}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self._get(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"must be true or false, not {value!r}")
        return value

    def whole(self, key: str, default: Any = _REQUIRED) -> int:
        """A whole number."""
        value = self._get(key, default)
        if not isinstance(value, int) or isinstance(value, bool):
            raise self.error(key, f"must be a whole number, not {value!r}")
        return value

    def number(self, key: str, default: Any = _REQUIRED) -> float:
        """A finite number."""
        value = self._get(key, default)
        if not _is_finite(value):
            raise self.error(key, f"must be a number, not {value!r}")
        return float(value)

    @overload
    def above_zero(self, key: str) -> float: ...
    @overload
    def above_zero(self, key: str, default: float) -> float: ...
    @overload
    def above_zero(self, key: str, default: None) -> float | None: ...
    def above_zero(self, key: str, default: Any = _REQUIRED) -> float | None:
        """A number above zero, or None if it may be left out and is."""
        if default is None and key not in self._content:
            self._used.append(key)
            return None
        value = self.number(key, default)
        if value <= 0:
            raise self.error(key, f"must be above 0, not {value:g}")
        return value

    def numbers(self, key: str, count: int, default: Any = _REQUIRED) -> list[float] | None:
        """So many finite numbers, or None if they may be left out and are."""
        value = self._get(key, default)
        if value is None:
            return None
        good = isinstance(value, list | tuple) and len(value) == count
        if not good or not all(map(_is_finite, value)):
            raise self.error(
                key, f"must be {count} numbers, such as {[0.0, 1.0, 2.0][:count]}, not {value!r}"
            )
        return [float(v) for v in value]

    def vector(self, key: str, default: Any = _REQUIRED) -> Any:
        """Three finite numbers, or None if they may be left out and are."""
        return self.numbers(key, 3, default)

    def raw(self, key: str, default: Any = _REQUIRED) -> Any:
        """A value of any kind."""
        return self._get(key, default)


def _is_finite(value: Any) -> bool:
    """Whether a value that `_fits` is a finite number; NumPy knows none beyond 64 bits."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _fits(value: Any) -> bool:
    """Whether numbers are such as a float can hold; TOML's whole numbers have no bound."""
    if isinstance(value, list):
        return all(map(_fits, value))
    return not isinstance(value, int) or abs(value) < _LARGEST
