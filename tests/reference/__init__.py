"""Values that other programs computed; see SOURCE.md."""

import csv
from pathlib import Path
from typing import Any


def isotropic_stacks() -> list[dict[str, Any]]:
    """The stacks, each as its columns: lists of one number a layer for albedo and optical_thickness, else numbers."""

    def value(name: str, text: str) -> Any:
        if name in ("albedo", "optical_thickness"):
            return [float(word) for word in text.split()]
        return text == "True" if name == "second_method" else float(text)

    with (Path(__file__).parent / "isotropic_stacks.csv").open(encoding="utf-8") as file:
        return [{name: value(name, text) for name, text in row.items()} for row in csv.DictReader(file)]
