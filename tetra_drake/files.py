"""Text files: read with one-line errors, written whole or not at all; numbers for JSON."""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tetra_drake.errors import InputError


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yields the path of a temporary file that becomes `path` if the block succeeds.

    Raises InputError if `path` cannot be written.
    """
    path = Path(path)
    if os.path.isdir(path):
        raise InputError(path, "", "is a directory, expected a file to write")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix
        )
        os.close(handle)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(path, "", "cannot be written: its folder is a file") from error
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be written: {error}") from error
    temporary = Path(name)
    try:
        yield temporary
        os.umask(mask := os.umask(0))  # can be read by setting it only
        temporary.chmod(0o666 & ~mask)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def check_folder(folder: str | Path) -> None:
    """Raises InputError if `folder` is not, and cannot become, a folder to write to."""
    folder = Path(folder)
    existing = folder
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    if not existing.is_dir():
        what = "is a file" if existing == folder else f"'{existing}' is a file"
        raise InputError(folder, "", f"{what}, expected a folder to write to")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(folder, "", f"'{existing}' is not writable")


def json_number(value: Any) -> Any:
    """A value as JSON holds it: None for a number that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_text(path: str | Path, what: str) -> str:
    """The text of a file; `what` says in errors what was expected. Raises InputError."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(path, "", f"no such {what}") from error
    except IsADirectoryError as error:
        raise InputError(path, "", f"is a directory, expected a {what}") from error
    except (OSError, ValueError) as error:
        raise InputError(path, "", f"cannot be read as text: {error}") from error


def write_whole(path: str | Path, text: str) -> None:
    """Writes a text file by rename, so that no reader ever sees half of it."""
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
