"""`python -m benchmarks.fill`: numbers of README and docs are those of the results, by the marks
behind them.
"""

import pytest
from benchmarks import figures, fill

# The row of a million stacks: milliseconds, MiB, milliseconds with slopes, in single precision.
RESULT = "1000000   1900   812   1032   481.8\n"


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "benchmarks" / "results"
    folder.mkdir(parents=True)
    (folder / "scaling.txt").write_text(RESULT)
    return folder


def test_no_number_of_the_texts_is_stale():
    assert fill.fill(write=False) == [], (
        "python -m benchmarks.fill puts them right; read what changed"
    )


def test_every_figure_stands_in_a_text():
    used = set()
    for page in fill.documents():
        fill.with_marks(page.read_text("utf-8"), lambda mark: used.add(mark["name"]) or mark[0])
    assert used == set(figures.names()), "a figure that no text quotes can go"


def test_stale_numbers_are_changed_and_told(tmp_path, results):
    page = tmp_path / "docs" / "start" / "page.md"
    generated = tmp_path / "docs" / "results" / "page.md"
    for path in (page, generated, tmp_path / "README.md"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            "It takes 0.6<!--scaling.million_seconds--> s, and 1.0<!--scaling.million_slopes--> "
            "s.\n"
        )
    told = [
        "README.md: scaling.million_seconds: 0.6 -> 1.9",
        "docs/start/page.md: scaling.million_seconds: 0.6 -> 1.9",
    ]
    assert fill.fill(tmp_path, results, write=False) == told
    assert fill.fill(tmp_path, results) == told
    assert (
        page.read_text()
        == "It takes 1.9<!--scaling.million_seconds--> s, and 1.0<!--scaling.million_slopes--> s.\n"
    )
    assert "0.6" in generated.read_text()
    assert fill.fill(tmp_path, results) == []


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("0.6<!--scaling.million_seconds .0f-->", "2<!--scaling.million_seconds .0f-->"),
        (".62<!--scaling.million_single .3f-->", ".482<!--scaling.million_single .3f-->"),
        ("18<!--scaling.million_seconds-->-41<!--scaling.million_slopes--> s", None),
        ("1,234.5e-6<!--scaling.million_seconds .1e-->", "1.9e0<!--scaling.million_seconds .1e-->"),
        (
            "```text\n\n0.6<!--scaling.million_seconds-->\n```",
            "```text\n\n0.6<!--scaling.million_seconds-->\n```",
        ),
        ("`0.6<!--scaling.million_seconds-->`", "`0.6<!--scaling.million_seconds-->`"),
        ("`` `0.6<!--scaling.million_seconds-->` ``", "`` `0.6<!--scaling.million_seconds-->` ``"),
        ("<!-- a comment, see tests/a.py -->", "<!-- a comment, see tests/a.py -->"),
    ],
)
def test_what_is_filled_and_how(results, before, after):
    wanted = after or "1.9<!--scaling.million_seconds-->-1.0<!--scaling.million_slopes--> s"
    assert fill.filled(before, results)[0] == wanted


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (
            "0.6<!--scaling.milion_seconds-->",
            "line 2: no figure is called 'scaling.milion_seconds'; did you mean",
        ),
        ("0.6<!-- million_seconds -->", "line 2: no figure is called 'million_seconds'"),
        ("0.6<!--scaling.million_seconds 1f-->", "line 2: no style is called '1f'"),
        (
            "half<!--scaling.million_seconds--> a second",
            "line 2: no number stands before the mark <!--scaling.mill",
        ),
        ("1.2.3<!--scaling.million_seconds-->", "line 2: no number stands before the mark"),
        (
            "0.6<!--savings.picture--> s",
            "line 2: figure savings.picture: there is no file savings.txt",
        ),
    ],
)
def test_a_wrong_mark_is_told(results, text, fault):
    with pytest.raises(ValueError, match="line 2: ") as told:
        fill.filled(f"A line.\n{text}\n", results)
    assert str(told.value).startswith(fault)


def test_the_command_names_what_is_stale(monkeypatch, capsys):
    said = ["README.md: scaling.million_seconds: 0.6 -> 1.9"]
    monkeypatch.setattr(fill, "fill", lambda write: said)
    monkeypatch.setattr("sys.argv", ["fill.py", "--check"])
    with pytest.raises(SystemExit) as ended:
        fill.main()
    assert ended.value.code == 1
    monkeypatch.setattr("sys.argv", ["fill.py"])
    fill.main()
    assert capsys.readouterr().out.splitlines() == 2 * said
