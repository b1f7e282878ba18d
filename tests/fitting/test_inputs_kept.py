"""No command writes a result over a file that it reads."""

import pytest
import typer
from typer.testing import CliRunner

from glazefit.mapping.command import register as register_map
from glazefit.posterior.command import register as register_posterior
from glazefit.recipe.command import register as register_recipe
from glazefit.recover.command import register as register_recover
from glazefit.recover.predict_command import register as register_predict
from glazejax.commands.render import register as register_render


@pytest.mark.parametrize(
    ("register", "words"),
    [
        (register_recipe, "--spectrum read.csv --csv read.csv"),
        (register_recipe, "--lab 50,0,0 --ground read.csv:white --csv read.csv"),
        (register_predict, "LeadWhite --reading read.csv --csv read.csv"),
        (register_render, "--coats LeadWhite:1um --ground read.csv --csv read.csv"),
        (register_map, "read.hdr --ground read.csv --out new.zarr --csv read.csv"),
        (register_recover, "read.csv --out ."),
        (register_posterior, "read.csv --sample a --paints LeadWhite --out ."),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_file_that_is_read_is_no_result(register, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("read.csv", "read.hdr"):
        (tmp_path / name).write_text("measured\n")
    app = typer.Typer()
    register(app)
    result = CliRunner().invoke(app, [*words.split(), "--overwrite"])
    assert isinstance(result.exception, ValueError)
    assert "a file that is read" in str(result.exception)
    assert (tmp_path / "read.csv").read_text() == "measured\n"
