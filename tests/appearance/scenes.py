"""Small scenes that the tests share."""

import numpy as np

from glazejax.appearance.scene.scene import Scene

GRID = np.arange(400.0, 701.0, 30.0)


def scene(shapes, materials, lights, camera, **options):
    """A scene on `GRID`, 32 x 24 pixels unless the options say otherwise."""
    return Scene(GRID, shapes, materials, lights, camera, **({"width": 32, "height": 24} | options))
