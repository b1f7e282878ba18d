"""README's example runs as printed."""

import re
from pathlib import Path

import numpy as np


def test_the_ten_lines_run(capsys):
    text = (Path(__file__).parents[1] / "README.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    names: dict = {}
    exec(code, names)
    lightness = float(re.findall(r"[-\d.]+", capsys.readouterr().out)[0])
    assert 0 < lightness < 100
    assert np.all(np.diff(names["blue"].wavelengths) > 0)
    assert names["spectrum"].shape == names["blue"].wavelengths.shape
