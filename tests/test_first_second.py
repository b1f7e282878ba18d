"""What a user waits for before the first answer: packages that are imported, programs that are
compiled, and no word.

Numbers of programs, not seconds: those are in benchmarks/results/cold_start.txt.
"""

import os
import pty
import shlex
import subprocess
import sys

import pytest

from glazejax import samples

from .fresh import PATHS, run_python
from .slow import slow

_RUN = """
import sys
import jax.monitoring
programs, traced = [], []
def count(event, seconds, **_):
    if "backend_compile" in event:
        programs.append(event)
    if "jaxpr_trace" in event:
        traced.append(event)
jax.monitoring.register_event_duration_secs_listener(count)
from glazejax.commands import progress
from glazejax.commands.main import main
# Without the line every ten seconds that shows a slow machine's progress.
progress.lines.__wrapped__.__defaults__ = (1e6,)
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
print("programs", len(programs), len(traced))
print("modules", *sorted(sys.modules))
"""
# Each takes longer than what it is imported for; `import colour` alone a second.
_HEAVY = """
colour pandas scipy.optimize scipy.interpolate matplotlib.pyplot emcee xarray trimesh
"""
HEAVY = set(_HEAVY.split())


def environment(cache):
    return os.environ | {
        "PYTHONPATH": PATHS,
        "GLAZEJAX_CACHE": str(cache),
        "COLUMNS": "200",
        "TERM": "xterm",
    }


def run(tmp_path, *words):
    """Numbers of programs compiled and of functions traced, and modules imported, by a command in a
    process of its own.
    """
    done = run_python(_RUN, *words, cwd=tmp_path, env=environment(tmp_path / "cache"))
    assert done.stderr == ""
    *_, programs, modules = done.stdout.splitlines()
    compiled, traced = map(int, programs.split()[1:])
    return compiled, traced, set(modules.split()[1:])


def test_import_loads_names_only():
    code = "import sys, glazejax, glazefit; print(*sorted(sys.modules))"
    loaded = set(run_python(code, env=environment("/nowhere")).stdout.split())
    assert not loaded & (
        HEAVY | {"jax", "numpy", "scipy", "matplotlib", "equinox", "optimistix", "rich", "typer"}
    )


@pytest.mark.slow
def test_render_is_one_program_and_little_else(tmp_path):
    words = "render", "--coats", "CobaltBlue:5um,0.5*ZincWhite+0.5*Vermillion:20um"
    programs, traced, modules = run(tmp_path, *words)
    # The solver, and one to give the answer its shape.
    assert programs <= 2
    assert not modules & HEAVY
    assert not modules & {"scipy", "glazejax.io.cubes.source"}
    picture = (tmp_path / "glaze.png").read_bytes()
    # The solver is kept as it was traced.
    _, again, _ = run(tmp_path, *words, "--overwrite")
    assert again < traced / 20
    assert (tmp_path / "glaze.png").read_bytes() == picture


@pytest.mark.slow
def test_a_search_that_was_made_before_traces_little(tmp_path):
    words = "identify", str(samples.path()), "--catalogue", "oils"
    programs, traced, modules = run(tmp_path, *words)
    assert programs <= 11
    assert not any(name.startswith("scipy.") for name in modules)
    _, again, modules = run(tmp_path, *words)
    assert again < traced / 4
    assert "optimistix" not in modules


@pytest.mark.slow
def test_a_recipe_is_sixteen_programs(tmp_path):
    programs, _, modules = run(tmp_path, "recipe", "--srgb", "#8a4b2d")
    assert programs <= 16
    assert not modules & (HEAVY - {"scipy.optimize", "scipy.interpolate"})


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ("render", "--coats", "CobaltBlue:5um"),
            ("starting", "compiling, then solving", "drawing"),
        ),
        slow(
            ("recipe", "--srgb", "#8a4b2d", "--out", "brown.png"),
            ("starting", "compiling, then looking"),
        ),
    ],
)
def test_a_terminal_is_told_what_is_being_done(tmp_path, words, told):
    """In this order, on stderr; the answer is on stdout."""
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "glazejax", *words],
        stdout=subprocess.PIPE,
        stderr=theirs,
        cwd=tmp_path,
        env=environment(tmp_path / "cache"),
    ) as process:
        os.close(theirs)
        seen = b""
        try:
            while piece := os.read(ours, 4096):
                seen += piece
        except OSError:  # how Linux says that the other end is closed
            pass
        assert process.stdout is not None
        answer = process.stdout.read().decode()
    assert process.returncode == 0
    places = [seen.decode().find(each) for each in told]
    assert -1 not in places
    assert places == sorted(places)
    assert "wrote" in answer
    assert not any(each in answer for each in told)


_WRONG = """
import contextlib, io, sys
from glazejax.commands.main import main
for line in {lines}:
    sys.argv[1:] = line
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        try:
            main()
        except SystemExit as end:
            assert end.code == 2, (line, end.code)
    assert said.getvalue().startswith("error: "), (line, said.getvalue())
    heavy = {{"jax", "scipy", "matplotlib", "xarray"}} & set(sys.modules)
    assert not heavy, (line, heavy, said.getvalue())
"""


# The table of the samples is TABLE.
_WRONG_LINES = """
render --coats CobaltBlue:2um --illuminant D99
render --coats CobaltBlue:2um --observer 3
render --coats CobaltBlue:2um --out x.gif
render --coats Foo:1um
render --coats CobaltBlue
render CobaltBlue:1um
render --stack none.json
export Foo:2um
export none.json
recipe --lab 50,20
recipe --srgb pink
recipe --spectrum none.csv
recipe --lab 50,20,30 --max-coats 9
recipe --lab 50,20,30 --illuminants D99
identify none.csv
identify TABLE --elements Xx
map none.hdr
recover none.csv
recover TABLE --out demo --white Foo
recover TABLE --into .
predict '10 Vermillion + 90 Foo'
predict '10 Vermillion + 90 ZincWhite' --reading none.csv
predict '10 Vermillion + 90 ZincWhite' --thickness thick
posterior none.tsv
posterior TABLE --out demo --paints Foo
posterior TABLE --out demo --steps -3
posterior TABLE --steps x
scene none.toml
scene TABLE --size foo
paints --family foo
convert none.csv x.csv
convert TABLE TABLE
studio none.json
studio --port 70000
identify TABLE --noise -1
identify TABLE --noise-share -1
identify TABLE --unit furlong
recover TABLE --noise -1
recover TABLE --noise-share -1
recover TABLE --unit furlong
posterior TABLE --noise -1
posterior TABLE --noise-share -1
posterior TABLE --unit furlong
identify TABLE --varnish glossy
identify TABLE --quantity radiance
identify TABLE --report r.pdf
identify TABLE --out x.bmp
map none.hdr --opaque
map TABLE --opaque --noise -1
map TABLE --opaque --spot x
convert TABLE x.csv --to pdf
convert TABLE x.csv --scale 0
recipe --lab 50
recipe --lab 50,20,30 --seed -1
export Eosin:2um --roughness 2
export Eosin:2um --out x.obj
export Eosin:2um --space rgb
export Eosin:2um --tolerance 0
"""
_SHARED = """
--instrument foo
--ground none.csv
--ground 30
--pigments none.csv
--catalogue none
--refractive-index 9
--only Foo
--thickness thick
"""


def test_a_wrong_line_imports_nothing_that_computes(tmp_path):
    """A wrong value, or a file that is not there, is said in half a second in place of six."""
    shared = _SHARED.split("\n")[1:-1]
    begins = {
        "render --coats CobaltBlue:2um": shared[:-2],
        "recipe --lab 50,20,30": shared[:-1],
        "identify TABLE": shared,
        "map TABLE": shared,
    }
    lines = [f"{start} {option}" for start, options in begins.items() for option in options]
    lines += _WRONG_LINES.split("\n")[1:-1]
    words = [shlex.split(line.replace("TABLE", str(samples.path()))) for line in lines]
    run_python(_WRONG.format(lines=words), cwd=tmp_path, env=environment(tmp_path / "cache"))
