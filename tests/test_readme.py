"""README's example prints what README shows."""

import re
from pathlib import Path

import numpy as np


def test_the_example_prints_what_is_shown(capsys):
    text = (Path(__file__).parents[1] / "README.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    exec(code, {})
    shown = re.findall(r"^# (\[.+\])$", code, re.MULTILINE)
    printed = capsys.readouterr().out.splitlines()
    assert len(shown) == len(printed) == 2
    for one, other in zip(shown, printed, strict=True):
        values = [np.fromstring(line.strip("[]"), sep=" ") for line in (one, other)]
        np.testing.assert_allclose(values[1], values[0], atol=5e-3)
