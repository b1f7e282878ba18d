"""A stack as lines of Python, for those who want to go on from it."""

from ..paint.describe import Coat
from ..stacks import Hiding, Spectrum, Stack


def of(stack: Stack) -> str:
    """A program that prints the stack's spectrum and colour.

    Own paints and measured grounds are numbers that no ten lines hold: there the program reads the
    stack's file.
    """
    head = ["import glazejax as gj"]
    if stack.pigments or isinstance(stack.ground, Spectrum) or not stack.shown:
        return "\n".join(
            [
                *head,
                'glaze = gj.Glaze.load("stack.json")  # saved in the studio',
                *_tail(stack),
            ]
        )
    shelf = []
    names = [name for coat in stack.shown for _, name in coat.parts]
    if any("/" not in name for name in names):
        shelf.append("oils = gj.catalogue.load()")
    for group in dict.fromkeys(name.partition("/")[0] for name in names if "/" in name):
        shelf.append(f'{group} = gj.catalogue.load("{group}")')
    level = f"{stack.level():g}" if not isinstance(stack.ground, Hiding) else "0.5"
    note = "  # the white half of the card" if stack.ground == "card" else ""
    coats = [f"    gj.Layer({_medium(coat)}, {coat.total:.6g})," for coat in stack.shown]
    return "\n".join(
        [
            *head,
            *shelf,
            "glaze = gj.Glaze([",
            *coats,
            f"], {level}, {stack.refractive_index:g}){note}",
            *_tail(stack),
        ]
    )


def _tail(stack: Stack) -> list[str]:
    return [
        f'spectrum = gj.reflectance(glaze, "{stack.instrument}")',
        "print(gj.colour.lab(glaze.wavelengths, spectrum))",
    ]


def _paint(name: str) -> str:
    group, slash, own = name.partition("/")
    return f'{group}["{own}"]' if slash else f'oils["{name}"]'


def _medium(coat: Coat) -> str:
    if len(coat.parts) == 1:
        return _paint(coat.parts[0][1])
    total = sum(weight for weight, _ in coat.parts)
    paints = ", ".join(_paint(name) for _, name in coat.parts)
    weights = ", ".join(repr(weight / total) for weight, _ in coat.parts)
    return f"gj.Mixture([{paints}], [{weights}])"
