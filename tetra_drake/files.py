"""Files: reading with one-line errors, writing by rename, numbers for JSON."""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import math
import os
import re
import secrets
import stat
import unicodedata
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from tetra_drake.errors import InputError, check_type

MOST_BYTES = 64 * 2**20
"""Default limit for the size of a file that is read into memory."""

_LONGEST_NAME = 60
"""Largest number of characters of a name from file_names(). File systems take 255 bytes."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Error numbers of a full or broken disk."""


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Context manager: yields a temporary file, which is renamed to `path` if the block succeeds.

    Temporary files of killed processes for the same path are removed. Raises InputError if `path`
    cannot be written.
    """
    path = Path(path)
    _check_no_other(path)
    make_folder(path.parent, source=path)
    with writing(path):
        ours = re.compile(rf"\.{re.escape(path.stem)}\.(\d+)\.\w{{8}}{re.escape(path.suffix)}")
        for match in filter(None, map(ours.fullmatch, os.listdir(path.parent))):
            try:
                os.kill(int(match[1]), 0)
            except PermissionError:
                pass  # a process of another user
            except (OSError, OverflowError):
                (path.parent / match[0]).unlink(missing_ok=True)
        unique = f"{os.getpid()}.{secrets.token_hex(4)}"
        temporary = path.with_name(f".{path.stem}.{unique}{path.suffix}")
        temporary.touch(exist_ok=False)
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if error.errno not in _FULL:
            raise
        raise InputError(path, "", f"cannot be written: {_reason(error)}") from error
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Context manager: an OSError or ValueError in the block becomes an InputError, which says that
    `path` cannot be written."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be written: {_reason(error)}") from error


def given_path(path: str | Path, source: str, what: str) -> Path:
    """Converts an argument to a Path. Raises InputError, naming function `source` and argument
    `what`, if it is neither a text nor a Path."""
    check_type(source, what, path, str, Path)
    return Path(path)


def file_names(names: Iterable[str]) -> dict[str, str]:
    """Valid file names for any texts: a dict from each text to its file name. The names are
    different even where upper and lower case are the same."""
    found: dict[str, str] = {}
    for name in names:
        taken = {other.casefold() for other in found.values()}
        plain = re.sub(r"[^\w.-]+", "_", unicodedata.normalize("NFKC", name))[:_LONGEST_NAME]
        plain = plain.strip("._-") or "unnamed"
        numbered = (f"{plain}_{number}" for number in itertools.count(2))
        free = (one for one in itertools.chain([plain], numbered) if one.casefold() not in taken)
        found[name] = next(free)
    return found


def make_folder(folder: Path, *, source: Path | None = None) -> None:
    """Makes a folder and its parents if they do not exist. Raises InputError if that fails; the
    error names `source`, by default the folder."""
    check_folder(folder, source=source)
    with writing(source or folder):
        folder.mkdir(parents=True, exist_ok=True)


def check_file(path: str | Path) -> None:
    """Raises InputError if `path` cannot be written as a file."""
    _check_name(path)
    _check_no_other(path)
    check_folder(Path(path).parent, source=path)


def _check_name(path: str | Path) -> None:
    """Raises InputError if no file can have this name, such as one that is too long."""
    with writing(path), contextlib.suppress(FileNotFoundError, NotADirectoryError):
        os.stat(path)


def _check_no_other(path: str | Path) -> None:
    """Raises InputError if `path` exists and is no regular file. Writing by rename would replace a
    device."""
    if os.path.lexists(path) and not os.path.isfile(path):
        what = "directory" if os.path.isdir(path) else "device, a pipe or a broken link"
        raise InputError(path, "", f"is a {what}, expected a file to write")


def check_folder(folder: str | Path, *, source: str | Path | None = None) -> None:
    """Raises InputError if `folder` is no writable folder and cannot be made. The error names
    `source`, by default the folder."""
    folder, source = Path(folder), source or folder
    _check_name(folder)
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        what = "is a file" if existing == source else f"'{existing}' is a file"
        raise InputError(source, "", f"{what}, expected a folder to write to")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(source, "", f"'{existing}' is not writable")


def _reason(error: Exception) -> str:
    """Text for the reason of an error, without the path: our messages name the path already."""
    return getattr(error, "strerror", None) or str(error)


def json_number(value: Any) -> Any:
    """A value for JSON: None in place of a float that is not finite; any other value as it is."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_json(path: str | Path, what: str) -> Any:
    """Content of a JSON file. `what` names the expected content in errors. Raises InputError like
    read_bytes(), if the file is not JSON, and if a key is given twice."""
    text = read_text(path, what)
    try:
        return json.loads(text, object_pairs_hook=_unique_keys)
    except (ValueError, RecursionError) as error:
        raise InputError(path, "", f"is not JSON: {error}") from error


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key is given twice")
    return content


def read_text(path: str | Path, what: str, *, most: int = MOST_BYTES) -> str:
    """Text of a UTF-8 file with at most `most` bytes. `what` names the expected content in errors.
    Raises InputError like read_bytes(), and if the file is not UTF-8."""
    try:
        return read_bytes(path, what, most=most).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(path, "", f"cannot be read as text: {error}") from error


def read_bytes(path: str | Path, what: str, *, most: int = MOST_BYTES) -> bytes:
    """Content of a file with at most `most` bytes. `what` names the expected content in errors.

    Raises InputError if the file cannot be read or has more than `most` bytes. Devices and
    pipes are refused, because they may never end.
    """
    content = b""
    try:
        about = os.stat(path)
        mode = about.st_mode
        if stat.S_ISREG(mode):  # opening a pipe would wait for a writer
            with open(path, "rb") as file:  # Python reserves memory for what it is to read
                content = file.read(min(most, about.st_size) + 1)
    except FileNotFoundError as error:
        raise InputError(path, "", f"no such {what}") from error
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be read: {_reason(error)}") from error
    if not stat.S_ISREG(mode):
        kind = "directory" if stat.S_ISDIR(mode) else "device or a pipe"
        raise InputError(path, "", f"is a {kind}, expected a {what}")
    if len(content) > most:
        limit = f"{most // 2**20} MB"
        raise InputError(path, "", f"is larger than {limit}, expected a {what} of at most {limit}")
    return content


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Writes a file by rename, so that no reader sees half of it. A text is written as UTF-8."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)
