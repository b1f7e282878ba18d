import pytest

from glazejax import Pigment, catalogue

from .palette import GRID


@pytest.fixture(scope="module")
def paints() -> dict[str, Pigment]:
    return {
        name: catalogue.pigment(name).resample(GRID)
        for name in ("Vermillion", "ZincWhite", "BoneBlack")
    }


@pytest.fixture
def run(command_line, request):
    """The command that the module names, with its output on one line."""
    return command_line(request.module.COMMAND, on_one_line=True)


@pytest.fixture
def check_refusal(run):
    """Assert that the command refuses a line, in these words."""

    def refuse(said, *words):
        _, err = run(*words, fails=2)
        assert said in err

    return refuse


@pytest.fixture(scope="module")
def shelf() -> list[Pigment]:
    return list(catalogue.load("pigments").values())
