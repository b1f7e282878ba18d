"""The names of `glazejax.appearance`: all there, loaded only when asked for, enough to make a
picture.
"""

import subprocess
import sys

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
