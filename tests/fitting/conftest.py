import pytest

from glazejax import Pigment, catalogue

from .palette import GRID


@pytest.fixture(scope="module")
def paints() -> dict[str, Pigment]:
    return {
        name: catalogue.pigment(name).resample(GRID)
        for name in ("Vermillion", "ZincWhite", "BoneBlack")
    }


@pytest.fixture(scope="module")
def shelf() -> list[Pigment]:
    return list(catalogue.load("pigments").values())
