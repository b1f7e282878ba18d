"""The names of `glazejax.appearance`: all there, loaded only when asked for, enough to make a
picture.
"""

import subprocess
import sys

import numpy as np
import pytest

from glazejax import appearance


def test_every_name_is_there():
    for name in appearance.__all__:
        assert getattr(appearance, name).__name__.rpartition(".")[2] == name
    assert set(appearance.__all__) <= set(dir(appearance))
    with pytest.raises(AttributeError, match="Ball"):
        _ = appearance.Ball  # pyright: ignore[reportAttributeAccessIssue]


def test_nothing_is_loaded_unasked():
    code = (
        "import sys, glazejax.appearance as a; before = set(sys.modules); a.Sphere; "
        "loaded = {m for m in before | set(sys.modules) if m.startswith('glazejax.appearance.')}; "
        "print(sorted(loaded & before), 'glazejax.appearance.scene.shapes' in loaded, "
        "sorted({'colour', 'matplotlib', 'trimesh'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.strip() == "[] True []", done.stdout + done.stderr


def test_a_picture_by_these_names_alone():
    grid = np.arange(400.0, 701.0, 30.0)
    light = appearance.ParallelLight((0, 0, -1), appearance.lamp("D65", grid))
    body = {"grey": appearance.Lambert(0.5)}
    camera = appearance.Camera((0, 0, 5), up=(0, 1, 0), field_of_view=1.0)
    scene = appearance.Scene(
        grid, [appearance.Plane("grey")], body, [light], camera, width=2, height=2
    )
    rendered = appearance.render(scene)
    # A lamp of strength 1 makes a white that faces it Y = 1.
    np.testing.assert_allclose(appearance.picture_xyz(rendered, grid)[..., 1], 0.5, rtol=1e-5)
