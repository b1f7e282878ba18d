"""Files that mean harm or have come to it: each reader gives a table or one sentence, soon and in
little room.
"""

import contextlib
import errno
import io
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import event, given

from glazejax.appearance.scene.file import read_scene
from glazejax.appearance.scene.file_materials import read_grey
from glazejax.commands import main as cli
from glazejax.io import SpectraTable, open_cube, read_sample, read_spectra, source, write_spectra

from ..fresh import run_python
from ..refusals import refusal
from ..slow import slow
from .hostile import SCENE, damaged_files, limits, outcome, subjects
from .samples import (
    CGATS,
    CXF,
    ENVI,
    GRID,
    envi_header,
    jcamp_block,
    lines,
    refused,
    same,
    spectra,
)

WIDE = "Name,400,410,420\nred,0.1,0.2,0.3\nblue,0.4,0.5,0.6\n"
SUBJECTS = subjects()
READERS = [
    *dict.fromkeys(subject.read for subject in SUBJECTS.values()),
    open_cube,
    lambda path: read_sample(str(path)),
]
has_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
CONTENTS = [subject.content for subject in SUBJECTS.values()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("damaged")


@pytest.mark.parametrize("kind", SUBJECTS)
def test_samples_are_legal(tmp_path, kind):
    subject = SUBJECTS[kind]
    assert outcome(subject, tmp_path, subject.content)


# The name of a file does not decide its format: one kind for each reader.
@pytest.mark.parametrize(
    "kind", {subject.read: kind for kind, subject in reversed(SUBJECTS.items())}.values()
)
def test_content_of_another_format_is_no_fault(folder, kind):
    subject = SUBJECTS[kind]
    for content in CONTENTS:
        outcome(subject, folder, content)
    # What is left of a header of ENVI, and a table of numbers below it.
    outcome(
        subject,
        folder,
        b"samples = 31\nlines = 3\nbands = 1\n" + SUBJECTS["columns without a header"].content,
    )


@given(damaged_files(SUBJECTS))
def test_damaged_files_of_every_kind_never_surprise(folder, file):
    """20,000 files: `--hypothesis-profile=fuzz`."""
    kind, damaged = file
    subject = SUBJECTS[kind]
    with limits(len(damaged)):
        accepted = outcome(subject, folder, damaged)
    # Counts of both: `--hypothesis-show-statistics`.
    event(f"{kind}: {'accepted' if accepted else 'refused'}")


@pytest.mark.parametrize("reader", READERS)
def test_no_reader_takes_a_name_that_cannot_be_or_a_device(tmp_path, reader):
    start = time.perf_counter()
    for path in (
        tmp_path / ("n" * 300),
        tmp_path / "a\0b",
        tmp_path / "none",
        Path("/dev/zero"),
        tmp_path,
    ):
        with pytest.raises((ValueError, OSError)) as caught:
            reader(path)
        assert len(str(caught.value).splitlines()) == 1
        assert path.name[:9] in repr(str(caught.value)) or "\0" in path.name
    assert time.perf_counter() - start < 5


@has_pipes
@pytest.mark.parametrize("reader", READERS)
def test_a_pipe_that_nobody_writes_into_is_given_up(tmp_path, monkeypatch, reader):
    monkeypatch.setattr(source, "NOBODY", 0.1)
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    start = time.perf_counter()
    refused(pipe, "pipe", reader)
    assert time.perf_counter() - start < 10


@has_pipes
def test_a_writer_that_says_nothing_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(source, "SILENCE", 0.1)
    pipe = tmp_path / "pipe.csv"
    os.mkfifo(pipe)
    with (
        pipe.open("r+b", buffering=0),
        refusal("nothing came through this pipe"),
    ):
        read_spectra(pipe)


def fill(pipe, content):
    """Write into a pipe, slowly, until nobody reads any more."""
    with contextlib.suppress(BrokenPipeError), pipe.open("wb") as file:
        for i in range(0, len(content), 30_000):
            file.write(content[i : i + 30_000])
            file.flush()
            time.sleep(0.01)


@has_pipes
@pytest.mark.parametrize(
    "kind", [kind for kind in SUBJECTS if not SUBJECTS[kind].beside and "ickness" not in kind]
)
def test_pipes_read_as_files_do(tmp_path, kind):
    subject = SUBJECTS[kind]
    path, pipe = subject.put(tmp_path), tmp_path / f"pipe_{subject.name}"
    os.mkfifo(pipe)
    writer = threading.Thread(target=fill, args=(pipe, subject.content), daemon=True)
    writer.start()
    found = subject.read(pipe)
    writer.join(10)
    if isinstance(found, SpectraTable):
        right = subject.read(path)
        # An ASD file without a comment is called as its file is.
        same(found, right.wavelengths, right.reflectance, right.names)


@pytest.mark.skipif(not Path("/dev/stdin").exists(), reason="no /dev/stdin here")
@pytest.mark.parametrize("name", ["/dev/stdin", "<(cat -)"])
def test_the_command_reads_what_is_piped(tmp_path, name):
    more = "".join(f"s{i},0.1,0.25,0.3\n" for i in range(5000))  # more than a pipe holds
    command = (
        f'"{sys.executable}" -c "from glazejax.commands.main import main; main()" convert {name} '
        "out.csv"
    )
    text = (WIDE + more).encode()
    done = subprocess.run(
        ["bash", "-c", command], input=text, cwd=tmp_path, capture_output=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert len(read_spectra(tmp_path / "out.csv")) == 5002


class Failing:
    """A disk that fails after so many bytes."""

    def __init__(self, after):
        self.left, self.read = after, os.read

    def __call__(self, descriptor, count):
        if self.left <= 0:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        piece = self.read(descriptor, min(count, self.left))
        self.left -= len(piece)
        return piece


@pytest.mark.parametrize("kind", SUBJECTS)
def test_a_failing_disk_is_one_sentence(tmp_path, monkeypatch, kind):
    subject = SUBJECTS[kind]
    path = subject.put(tmp_path)
    monkeypatch.setattr(os, "read", Failing(10))
    refused(path, r"cannot be read: Input/output error", subject.read, error=OSError)


def test_errors_of_the_system_are_one_line_of_the_command(put, monkeypatch, command_line):
    def refuse(*_):
        raise OSError(errno.EIO, "Input/output error", "disk")

    convert = command_line("convert")
    put(WIDE, "t.csv")
    for files in (["n" * 300, "out.csv"], ["t.csv", "n" * 300 + ".csv"]):
        _, said = convert(*files, fails=2)
        assert said.startswith("error: ")
        assert "too long" in said
    monkeypatch.setattr(cli, "make_app", refuse)
    assert convert(fails=2) == ("", "error: disk: Input/output error\n")


def listing(value, reflectance="[0.1, 0.2]"):
    return (
        f'[{{"type": "wavelengths", "values": [400, {value}]}}, {{"name": "a", "reflectance": '
        f"{reflectance}}}]"
    )


PACKED = jcamp_block(form="DIFDUP")


@pytest.mark.parametrize(
    ("name", "content", "complaint"),
    [
        ("t.json", listing("4" * 1000), "'wavelengths': number 2 has 1000 digits, too large"),
        ("t.json", listing("4" * 5000), "a number of thousands of digits"),
        ("t.json", listing("410", "[0.1, " + "4" * 1000 + "]"), "'a': number 2 has 1000 digits"),
        ("t.json", "[" * 100_000, "nested too deeply"),
        ("t.json", "[[" + "1," * 2_000_000 + "1]]", "more than 1500000 words"),
        ("t.json", "[[" + " " * (17 << 20) + "]]", "larger than the 16 MB"),
        (
            "t.dx",
            jcamp_block(form="XYDATA").replace("=31\n", "=400000000\n"),
            "promises 400000000 points and holds 31",
        ),
        (
            "t.dx",
            jcamp_block().replace("=31\n", "=400000000\n"),
            "promises 400000000 points and holds 31",
        ),
        ("t.dx", PACKED.replace("\n400", "\n400A%s99999999"), "are not an abscissa and ordinates"),
        (
            "t.dx",
            jcamp_block(form="XYDATA").replace("\n520 ", "\n560 "),
            "line 16: 'red' is damaged: the line begins",
        ),
        (
            "t.dx",
            PACKED.replace("\n500", "\n500A1\n500"),
            "'red' is damaged: the line does not begin with",
        ),
        (
            "t.txt",
            CGATS.replace("FIELDS\t6", "FIELDS\t7"),
            "NUMBER_OF_FIELDS promises 7 fields, and there are 6",
        ),
        (
            "t.cxf",
            CXF.replace("<cc:CxF", '<!DOCTYPE a [<!ENTITY b "c">]><cc:CxF'),
            "it has a DOCTYPE",
        ),
        ("t.csv", "Name,400\n" + "a" * (5 << 20), "line 2: longer than 4 MB"),
        (
            "t.csv",
            'Name,400\n"' + "a" * 200_000,
            "line 2: field larger than .*; is a quotation mark left open",
        ),
        ("t.csv", "Name,400\n" + "a\x1b[31m\n", "line 2: 1 cell where"),
    ],
)
def test_hostile_files_end_in_one_sentence(put, name, content, complaint):
    path = put(content, name)
    start = time.perf_counter()
    said = refused(path, complaint)
    assert said.isprintable()
    assert len(said) < 1000
    assert time.perf_counter() - start < 20


@pytest.mark.parametrize(
    ("reader", "content"),
    [
        (read_spectra, "Name,4{run}00,410\nred,0.1,0.2\n"),
        (read_spectra, "Name,R{run}400,410\nred,0.1,0.2\n"),
        (read_spectra, "nm;red\n400;0,1\n4{run}10;0,2\n"),
        (read_spectra, "a line\nred,-400{run}x,R410\nblue,0.1,0.2\n"),
        (SUBJECTS["lamp"].read, "nm,one{commas}\n380,bright\n780,1\n"),
    ],
)
def test_long_runs_of_one_letter_are_refused_soon(put, reader, content):
    for run in (" ", "\t", "_", "-"):
        path = put(content.format(run=run * 50_000, commas="," * 100_000), "t.csv")
        start = time.process_time()
        refused(path, r"t\.csv: |t\.csv, line ", reader)
        assert time.process_time() - start < 3


@pytest.mark.parametrize(
    ("fields", "size", "complaint"),
    [
        (
            {"lines": 10**9, "samples": 31, "spectra names": None},
            372,
            "372 bytes where the header .* promises 124000000000",
        ),
        (
            {"lines": 10**9, "spectra names": None},
            4 * 31 * 10**9,
            "1000000000 spectra of 31 bands are too many",
        ),
        ({"lines": "9" * 1000}, 372, "promises"),
        ({"lines": "9" * 5000}, 372, "'lines' is '9+', not a whole number"),
        (
            {"lines": 2, "spectra names": None},
            372,
            "372 bytes where the header t.hdr promises 248: are its samples",
        ),
        (
            {"samples": 31, "bands": 31, "lines": 3},
            31 * 372,
            "a library of 31 bands|library of 31 bands",
        ),
        ({"file compression": 1}, 372, "'file compression', which is not understood"),
        ({"data type": 7}, 372, "data type 7, byte order 0; known are 1, 2"),
    ],
)
def test_headers_that_promise_what_is_not_there(tmp_path, fields, size, complaint):
    (tmp_path / "t.hdr").write_text(envi_header(ENVI | fields))
    with (tmp_path / "t.sli").open("wb") as file:
        file.truncate(size)  # a sparse file, whatever its size
    refused(tmp_path / "t", complaint, lambda _: read_spectra(tmp_path / "t.hdr"))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (
            SCENE.replace("width = 12", "width = " + "9" * 1000),
            "width: holds a number of too many digits",
        ),
        (
            SCENE.replace("width = 12", "width = 0x" + "f" * 5000),
            "width: holds a number of too many digits",
        ),
        (
            SCENE.replace("[0, 0, 1]", "[0, 0, 1" + "0" * 999 + "]"),
            "centre: holds a number of too many digits",
        ),
        (SCENE.replace("[0, 0, 1]", "[0, 0, 1e308]"), "centre must be numbers up to 1e.30"),
        (SCENE.replace("[0, -4, 2]", "[1e308, -4, 2]"), "position must be numbers up to 1e.30"),
        (SCENE.replace("radius = 1.0", "radius = 1e308"), "radius must be a number up to 1e.30"),
        # Beyond what NumPy holds in 64 bits.
        (SCENE.replace("[0, 1, -1]", f"[0, 1, {'9' * 40}]"), "direction must be numbers up to"),
        ("x = " + "9" * 5000, "not a legal TOML file"),
        ("x = " + "[" * 9000, "nested too deeply|not a legal TOML"),
        ("a." * 9000 + "b = 1", "line 1: more than 10000 characters"),
        ("#" * (2 << 20), "larger than the 1 MB"),
    ],
)
def test_hostile_scenes(tmp_path, content, complaint):
    refused(SUBJECTS["scene"].put(tmp_path, content.encode()), complaint, read_scene)


def test_hostile_maps(tmp_path):
    from PIL import Image

    array = io.BytesIO()
    np.save(array, np.zeros((3, 4)))
    path = tmp_path / "t.npy"
    path.write_bytes(array.getvalue().replace(b"(3, 4), ", b"(3000000"))
    with refusal("not an array that can be read"):
        read_grey(path)
    with path.open("wb") as file:
        np.savez(file, np.zeros((3, 4)))
    with refusal(r"t\.npy: an archive .* save one array"):
        read_grey(path)
    np.save(path, np.zeros((0, 4)))
    with refusal("must hold finite numbers"):
        read_grey(path)
    path = tmp_path / "t.png"
    Image.new("L", (6000, 6000)).save(path)  # some kilobytes
    with refusal("6000 x 6000 pixels are too many"):
        read_grey(path)
    Image.new("I;16", (4, 4), 60_000).save(path)
    assert read_grey(path).max() <= 1


def test_progress_is_told(put):
    told = []
    path = put(WIDE + "".join(f"s{i},0.1,0.25,0.3\n" for i in range(30_000)), "t.csv")
    read_spectra(path, progress=lambda done, size, words: told.append((done, size)))
    assert told[-1] == (path.stat().st_size, path.stat().st_size)
    assert len(told) > 2
    assert [done for done, _ in told] == sorted(done for done, _ in told)


@pytest.mark.parametrize("layout", ["wide", "long", "longest"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_pieces_do_not_show(read, monkeypatch, layout, end):
    monkeypatch.setattr(source, "HEAD", 1000)
    monkeypatch.setattr(source, "_PIECE", 7)
    values, names = spectra(5), ["réd", "b", "c", "日本", "e"]
    by_name = [[name, *row] for name, row in zip(names, values.tolist(), strict=True)]
    text = (
        "\ufeff"
        + {
            "wide": lines([["Name", *GRID], *by_name]),
            "long": lines([["nm", *names], *zip(GRID, *values.tolist(), strict=True)]),
            "longest": "name,wavelength,value\n"
            + lines(
                [name, *pair] for name, *row in by_name for pair in zip(GRID, row, strict=True)
            ),
        }[layout].rstrip()
    )
    same(read(text.replace("\n", end), "t.csv"), GRID, values, names)


PEAK = """
import resource, sys
from glazejax.io import read_spectra
from glazejax.io.formats import table
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(len(read_spectra(sys.argv[1])), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.mark.parametrize("megabytes", [6, slow(60)])
def test_large_tables_take_their_size_and_little_more(tmp_path, megabytes):
    path, count = tmp_path / "big.csv", megabytes * 4000
    grid = np.arange(380, 781, 10)
    row = lines([["", *(f"{value:.4f}" for value in spectra(1, grid)[0])]])
    with path.open("w") as file:
        file.write(lines([["Name", *grid]]))
        file.writelines(f"sample {i}{row}" for i in range(count))
    rows, kilobytes = map(int, run_python(PEAK, path).stdout.split())
    assert rows == count
    # 8 bytes a value and 80 a name, and some pieces at work.
    assert (
        kilobytes * 1024 < count * (41 * 8 + 120) + (24 << 20) < path.stat().st_size + (200 << 20)
    )


@pytest.mark.slow
def test_tables_are_written_in_pieces(tmp_path):
    table = SpectraTable(
        GRID, tuple(f"s{i}" for i in range(20_000)), np.tile(spectra(), (6667, 1))[:20_000]
    )
    for name in ("t.csv", "t.hdr"):
        write_spectra(table, tmp_path / name)
        same(read_spectra(tmp_path / name), GRID, table.reflectance, table.names)
