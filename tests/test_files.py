"""Files are written whole or not at all."""

import os
import stat

import pytest

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file, write_whole


class Interruption(Exception):
    pass


def test_a_written_file_holds_the_text_and_nothing_else_is_there(tmp_path):
    write_whole(str(tmp_path / "new" / "a.txt"), "λ = 27\n")
    assert (tmp_path / "new" / "a.txt").read_bytes() == "λ = 27\n".encode()
    assert os.listdir(tmp_path / "new") == ["a.txt"]


def test_a_written_file_replaces_the_old_one(tmp_path):
    file = tmp_path / "a.txt"
    file.write_text("old and longer")
    write_whole(file, "new")
    assert file.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_nothing_is_seen_under_the_name_before_the_block_ends(tmp_path):
    file = tmp_path / "a.txt"
    with whole_file(file) as temporary:
        temporary.write_text("half")
        assert not file.exists()
        temporary.write_text("whole")
    assert file.read_text() == "whole"


@pytest.mark.parametrize("interruption", [Interruption, KeyboardInterrupt, InputError])
def test_a_block_that_raises_leaves_the_old_file_and_no_other(tmp_path, interruption):
    file = tmp_path / "a.txt"
    file.write_text("old")
    arguments = ("x", "", "y") if interruption is InputError else ()
    with pytest.raises(interruption), whole_file(file) as temporary:
        temporary.write_text("half")
        raise interruption(*arguments)
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_the_temporary_file_is_on_the_same_disk_and_of_the_same_kind(tmp_path):
    # Renaming needs the first; writers that go by the suffix need the second.
    with whole_file(tmp_path / "a.svg") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == ".svg"


def test_two_writers_of_one_file_do_not_meet(tmp_path):
    file = tmp_path / "a.txt"
    with whole_file(file) as first, whole_file(file) as second:
        first.write_text("first")
        second.write_text("second")
        assert first != second
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


@pytest.mark.parametrize("below", ["b.txt", "b/c.txt"])
def test_a_path_below_a_file_cannot_be_written(tmp_path, below):
    (tmp_path / "a.txt").write_text("old")
    path = tmp_path / "a.txt" / below
    with pytest.raises(InputError) as caught:
        write_whole(path, "new")
    assert caught.value.source == str(path)
    assert len(str(caught.value).splitlines()) == 1
    assert (tmp_path / "a.txt").read_text() == "old"


def test_a_directory_cannot_be_written(tmp_path):
    with pytest.raises(InputError) as caught:
        write_whole(tmp_path, "new")
    assert caught.value.source == str(tmp_path)
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(
    os.name != "posix" or os.geteuid() == 0, reason="a superuser may write everywhere"
)
def test_a_folder_without_permission_cannot_be_written(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    with pytest.raises(InputError):
        write_whole(folder / "a.txt", "new")
