"""Files are written whole or not at all."""

import contextlib
import os
import resource
import signal
import stat
import subprocess
import sys

import numpy as np
import pytest
import xarray

from tetra_drake.errors import InputError
from tetra_drake.files import (
    check_file,
    check_folder,
    file_names,
    read_text,
    whole_file,
    write_whole,
)
from tetra_drake.results.trajectory import save_dataset


def test_a_file_appears_whole_or_not_at_all_from_a_temporary_one_of_the_same_kind(tmp_path):
    # Renaming needs the same disk; writers that go by the suffix need the same suffix.
    file = tmp_path / "new" / "a.svg"
    with whole_file(str(file)) as temporary:
        assert (temporary.parent, temporary.suffix) == (file.parent, ".svg")
        temporary.write_text("whole")
        assert not file.exists()
    with pytest.raises(KeyboardInterrupt), whole_file(file) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert file.read_text() == "whole"
    assert os.listdir(file.parent) == ["a.svg"]


def test_names_from_a_file_are_no_paths_and_differ_without_case():
    names = ["../a", "/a", "A", "..", "", "a_2", 300 * "ü", "\0"]
    files = file_names(names)
    assert list(files) == names and not {"/", "\0"} & set("".join(files.values()))
    assert len({file.casefold() for file in files.values()} - {"", ".", ".."}) == len(names)
    assert max(len(file.encode()) for file in files.values()) < 255


def test_the_mode_follows_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        write_whole(tmp_path / "a.txt", "text")
        assert os.umask(0o027) == 0o027  # is left as it was
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o640


@pytest.mark.parametrize("place", ["a.txt/b.txt", 300 * "b", "b\0"], ids=repr)
def test_what_cannot_be_written_is_refused(tmp_path, place, refused):
    (tmp_path / "a.txt").write_text("old")
    with refused(tmp_path / place, "", ""):
        write_whole(tmp_path / place, "new")
    for check in (check_file, check_folder):  # before anything is simulated for it
        with pytest.raises(InputError):
            check(tmp_path / place)
    assert (tmp_path / "a.txt").read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_device_is_not_replaced_by_a_file(tmp_path, refused):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/null")
    (tmp_path / "broken").symlink_to("nowhere")
    for name in ("pipe", "link", "broken"):
        with refused(tmp_path / name, "", "expected a file"):
            write_whole(tmp_path / name, "text")
    assert stat.S_ISFIFO(os.stat(tmp_path / "pipe").st_mode)
    assert (tmp_path / "link").is_symlink()


def test_what_a_killed_writer_left_is_removed_by_the_next_but_not_that_of_a_living_one(tmp_path):
    program = (
        "import os, signal, sys\nfrom tetra_drake.files import whole_file\n"
        "with whole_file(sys.argv[1]):\n    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    file = tmp_path / "a [1].svg"
    killed = subprocess.run([sys.executable, "-c", program, file])
    assert killed.returncode == -signal.SIGKILL
    (left,) = os.listdir(tmp_path)
    (tmp_path / ".a.svg").touch()  # not ours
    with whole_file(tmp_path / "b.svg"):
        assert (tmp_path / left).exists()  # of another file
    with whole_file(file) as first, whole_file(file) as second:
        assert first.exists() and second.exists()
        assert not (tmp_path / left).exists()
    assert set(os.listdir(tmp_path)) == {"a [1].svg", "b.svg", ".a.svg"}


@contextlib.contextmanager
def little_room():
    """A block in which no file becomes larger than 4096 bytes, as if the disk were full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)


LARGE = xarray.Dataset({"a": ("time", np.random.default_rng(0).normal(size=4096))})
WRITERS = {
    "a.html": lambda path: write_whole(path, 5000 * "x"),
    "a.nc": lambda path: save_dataset(LARGE, path),
}


@pytest.mark.parametrize(("name", "write"), WRITERS.items(), ids=WRITERS)
def test_a_full_disk_is_told_in_a_line_and_the_old_file_kept(tmp_path, refused, name, write):
    file = tmp_path / name
    file.write_text("old")
    with refused(file, "", "cannot be written"), little_room():
        write(file)
    assert file.read_text() == "old"
    assert os.listdir(tmp_path) == [name]


def test_what_never_ends_or_is_too_large_is_not_read(tmp_path, refused):
    pipe, large = tmp_path / "pipe", tmp_path / "large"
    os.mkfifo(pipe)
    with large.open("wb") as file:
        file.truncate(2**20 + 1)
    for path, problem in ((pipe, "pipe"), ("/dev/zero", "device"), (tmp_path, "directory")):
        with refused(path, "", problem):
            read_text(path, "gait file")
    with refused(large, "", "1 MB"):
        read_text(large, "gait file", most=2**20)
    assert len(read_text(large, "gait file")) == 2**20 + 1
