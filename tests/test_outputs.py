"""Results go where there is room for them, and replace nothing unasked."""

from glazejax.io.outputs import check_output
from glazejax.io.write import write_files
from glazejax.whole_file import whole_file

from .refusals import refusal


def test_free_names_and_files_that_may_be_replaced(tmp_path):
    old = tmp_path / "old.csv"
    old.write_text("mine")
    assert check_output(str(tmp_path / "new.csv")) == tmp_path / "new.csv"
    assert check_output(old, overwrite=True) == old
    assert old.read_text() == "mine"


def test_what_is_wrong_is_said(here):
    (here / "old.csv").write_text("mine")
    (here / "folder").mkdir()
    with refusal(
        r"^--csv old.csv exists; choose another name, or .* --overwrite$", FileExistsError
    ):
        check_output("old.csv", argument="--csv")
    with refusal(r"^old.csv exists; .* with overwrite=True$", FileExistsError):
        check_output("old.csv", switch="overwrite=True")
    with refusal(r"^none/new.csv: the folder none does not exist$", FileNotFoundError):
        check_output("none/new.csv")
    for overwrite in (False, True):
        with refusal(r"^folder is a folder: name a file in it$", IsADirectoryError):
            check_output("folder", overwrite=overwrite)


def test_several_files_are_written_all_or_none(tmp_path):
    """A file that is there stays as it is unless asked, and then no other is written either."""
    new, old = tmp_path / "new.csv", tmp_path / "old.csv"
    old.write_bytes(b"mine")
    with refusal(r"old\.csv", FileExistsError):
        write_files({new: [b"a", b"b"], old: [b"c"]})
    assert old.read_bytes() == b"mine"
    assert not new.exists()
    write_files({new: [b"a", b"b"], old: [b"c"]}, overwrite=True)
    assert (new.read_bytes(), old.read_bytes()) == (b"ab", b"c")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new.csv", "old.csv"]


def test_a_file_that_fails_leaves_all_as_they_were(tmp_path):
    def failing():
        yield b"half"
        raise OSError("no space left")

    old, new = tmp_path / "old.csv", tmp_path / "new.csv"
    old.write_bytes(b"mine")
    with refusal("no space left", OSError):
        write_files({old: [b"a"], new: failing()}, overwrite=True)
    assert old.read_bytes() == b"mine"
    assert [path.name for path in tmp_path.iterdir()] == ["old.csv"]


def test_long_names_that_differ_at_the_end_are_two_files(tmp_path):
    """A name of 250 letters is a legal one, with more behind it it is none."""
    files = {tmp_path / f"{'a' * 246}.{ending}": [ending.encode()] for ending in ("sli", "hdr")}
    write_files(files)
    assert {path: [path.read_bytes()] for path in files} == files


def test_what_fails_names_the_users_file_and_no_part_of_it(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()

    def write() -> None:
        with whole_file(folder / "o.csv") as part:
            folder.rmdir()
            part.write_text("")

    with refusal(r"gone/o\.csv'$", FileNotFoundError):
        write()


def test_a_link_is_written_through(tmp_path):
    """As /dev/stdout is, where it is sent to a file."""
    link, real = tmp_path / "link.csv", tmp_path / "real.csv"
    real.write_text("old")
    link.symlink_to(real)
    write_files({link: [b"new"]}, overwrite=True)
    assert link.is_symlink()
    assert real.read_bytes() == b"new"


def test_a_link_to_no_file_is_written_through(tmp_path):
    link, real = tmp_path / "link.csv", tmp_path / "real.csv"
    link.symlink_to(real)
    write_files({link: [b"new"]})
    assert link.is_symlink()
    assert real.read_bytes() == b"new"
