"""The words for a geometry, read into angles without JAX: a slip in them is an error at once."""

GEOMETRIES = (
    "d:8 or di:8 (integrating sphere, mirror reflection included), de:8 (excluded), 45:0, 0:45, "
    "or another ANGLE:ANGLE of light and view in degrees"
)
"""The words for a geometry, as help and errors list them."""

_SPHERES = {"d": True, "di": True, "de": False}


def split_geometry(text: str, argument: str) -> tuple[bool | None, tuple[float, ...], bool]:
    """Split a notation: whether a sphere takes the mirror reflection in (None without a sphere),
    the angles in degrees, and whether two equal ones see it; see
    `glazejax.geometry.parse_geometry`.

    Raises:
        ValueError: other words, an angle out of range, or a mirror reflection that is not in view.
    """
    fields = [
        field.strip().lower().removesuffix("°") for field in text.replace("/", ":").split(":")
    ]
    specular = len(fields) == 3 and fields[2] == "specular"
    pair = fields[:2] if specular else fields
    spheres = [_SPHERES[field] for field in pair if field in _SPHERES]
    try:
        angles = tuple(float(field) for field in pair if field not in _SPHERES)
    except ValueError:
        angles = ()
    if len(pair) != 2 or len(spheres) + len(angles) != 2 or not angles or (spheres and specular):
        raise ValueError(f"{argument} is {text!r:.60}; it must be {GEOMETRIES}")
    for angle in angles:
        if not 0 <= angle < 90:
            raise ValueError(
                f"{argument} is {text!r:.60}: angles must lie in [0, 90) degrees from the normal, "
                f"not {angle:g}"
            )
    if specular and angles[0] != angles[1]:
        raise ValueError(
            f"{argument} is {text!r:.60}: at {angles[0]:g}:{angles[1]:g} the mirror reflection is "
            "not in view; use equal angles, or a sphere, d:8"
        )
    return (spheres[0] if spheres else None), angles, specular
