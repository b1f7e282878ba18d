"""Values that other programs computed; see SOURCE.md."""

import csv
from pathlib import Path
from typing import Any

import numpy as np

_HERE = Path(__file__).parent


def isotropic_stacks() -> list[dict[str, Any]]:
    """The stacks, each as its columns: lists of one number a layer for albedo and
    optical_thickness, else numbers.
    """

    def value(name: str, text: str) -> Any:
        if name in ("albedo", "optical_thickness"):
            return [float(word) for word in text.split()]
        return text == "True" if name == "second_method" else float(text)

    with (_HERE / "isotropic_stacks.csv").open(encoding="utf-8") as file:
        return [
            {name: value(name, text) for name, text in row.items()} for row in csv.DictReader(file)
        ]


def slopes() -> np.ndarray:
    """Of the reflectance factor of 20 random stacks by five albedos, five thicknesses, ground and
    cosines, (20, 13).
    """
    return np.loadtxt(_HERE / "slopes.csv", delimiter=",", skiprows=1)
