"""Files are written whole or not at all."""

import os
import stat

import pytest

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file, write_whole


@pytest.mark.parametrize("old", [None, "old and longer"])
def test_a_written_file_holds_the_text_and_nothing_else_is_there(tmp_path, old):
    file = tmp_path / "new" / "a.txt"
    if old:
        file.parent.mkdir()
        file.write_text(old)
    write_whole(str(file), "λ = 27\n")
    assert file.read_bytes() == "λ = 27\n".encode()
    assert os.listdir(file.parent) == ["a.txt"]


def test_the_temporary_file_is_on_the_same_disk_of_the_same_kind_and_unseen(tmp_path):
    # Renaming needs the first; writers that go by the suffix need the second.
    file = tmp_path / "a.svg"
    with whole_file(file) as temporary:
        assert (temporary.parent, temporary.suffix) == (tmp_path, ".svg")
        temporary.write_text("half")
        assert not file.exists()
        temporary.write_text("whole")
    assert file.read_text() == "whole"


@pytest.mark.parametrize(
    "interruption", [ValueError(), KeyboardInterrupt(), InputError("x", "", "y")], ids=repr
)
def test_a_block_that_raises_leaves_the_old_file_and_no_other(tmp_path, interruption):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(type(interruption)), whole_file(file) as temporary:
        temporary.write_text("half")
        raise interruption
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_two_writers_of_one_file_do_not_meet(tmp_path):
    file = tmp_path / "a.txt"
    with whole_file(file) as first, whole_file(file) as second:
        first.write_text("first")
        second.write_text("second")
    assert file.read_text() == "first"  # the outer block ends last
    assert os.listdir(tmp_path) == ["a.txt"]


@pytest.mark.parametrize(
    ("mask", "mode"), [(0o022, 0o644), (0o027, 0o640), (0o077, 0o600), (0o002, 0o664)]
)
def test_the_mode_follows_the_umask(tmp_path, mask, mode):
    before = os.umask(mask)
    try:
        write_whole(tmp_path / "a.txt", "text")
        assert os.umask(mask) == mask  # and is left as it was
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == mode


@pytest.mark.parametrize("place", ["a.txt/b.txt", "a.txt/b/c.txt", "", 300 * "b", "b\0"], ids=repr)
def test_what_cannot_be_written_is_refused(tmp_path, place, refused):
    (tmp_path / "a.txt").write_text("old")
    with refused(tmp_path / place, "", ""):
        write_whole(tmp_path / place, "new")
    assert (tmp_path / "a.txt").read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]
