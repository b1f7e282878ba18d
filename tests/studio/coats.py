"""Coats of the stacks that these tests see."""

from typing import Any


def coat(paint: str, um: Any) -> dict[str, Any]:
    """A coat of one paint, as a stack has it."""
    return {"paint": {paint: 1}, "um": um}
