"""Names of linear RGB and of layering rules, which a command checks before anything is loaded that
computes.
"""

from typing import Literal, TypeAlias, get_args

Space: TypeAlias = Literal["lin_rec709", "acescg"]
"""Names as MaterialX has them: linear sRGB, and the space of ACES for rendering."""
Layering: TypeAlias = Literal["materialx", "specification", "reciprocal"]
"""Rules by which programs put OpenPBR's layers together, see `openpbr`."""
LAYERINGS: tuple[Layering, ...] = get_args(Layering)


def find_space(name: str) -> Space:
    """The space of a name in any case; linear sRGB is also known as sRGB.

    Raises:
        ValueError: no such space.
    """
    key = name.strip().lower().replace(" ", "").replace("-", "_")
    aliases = {
        "lin_rec709": "lin_rec709",
        "srgb": "lin_rec709",
        "linearsrgb": "lin_rec709",
        "acescg": "acescg",
    }
    if key not in aliases:
        raise ValueError(
            f"the colour space {name!r} is not known: choose srgb (linear sRGB) or acescg"
        )
    return aliases[key]  # pyright: ignore[reportReturnType]
