"""Records of arrays of as many rows: some rows of one, several joined, kept in files."""

from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

Record = TypeVar("Record", bound=NamedTuple)


class Columns:
    """Arrays, the fields of a dataclass, or further records of them."""

    def take(self, rows: np.ndarray | slice | list[int]) -> Self:
        """Some of the rows."""
        return type(self)(**{name: values[rows] for name, values in self.arrays().items()})

    def arrays(self) -> dict[str, np.ndarray]:
        """All arrays by name, to be kept in a file."""
        columns: dict[str, np.ndarray] = {}
        for field in fields(self):  # pyright: ignore[reportArgumentType]
            value = getattr(self, field.name)
            columns |= value.arrays() if isinstance(value, Columns) else {field.name: value}
        return columns

    @classmethod
    def join(cls, records: Sequence[Self]) -> Self:
        """Several records as one."""
        return cls.joined(len(records), lambda number, name: records[number].arrays()[name])

    @classmethod
    def joined(cls, count: int, load: Callable[[int, str], np.ndarray]) -> Self:
        """Several records as one; only one array of theirs at a time is held twice.

        Args:
            count: how many there are.
            load: array of one of them, by its number and name, as `arrays` gave it.
        """

        def column(name: str, kind: Any) -> Any:
            if is_dataclass(kind):
                return kind.joined(count, load)  # pyright: ignore[reportAttributeAccessIssue]
            return np.concatenate([load(number, name) for number in range(count)])

        return cls(**{field.name: column(field.name, field.type) for field in fields(cls)})  # pyright: ignore[reportArgumentType]


def take_rows(record: Record, rows: np.ndarray) -> Record:
    """Some rows of every array of a named tuple."""
    return record._make(values[rows] for values in record)
