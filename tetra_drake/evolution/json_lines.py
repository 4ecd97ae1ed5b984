"""Append-only files of JSON objects, one per line, that survive a kill at any moment. Those that
`xz` has compressed are NAME.xz; what is appended later stands in NAME."""

from __future__ import annotations

import json
import lzma
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tetra_drake.errors import InputError


def append_lines(path: Path, entries: Iterable[Mapping[str, Any]]) -> None:
    """Appends the entries, handed to the system on return; a kill can tear only the last line."""
    text = "".join(json.dumps(entry, allow_nan=False) + "\n" for entry in entries)
    try:
        with path.open("ab") as file:
            file.write(text.encode())
    except OSError as error:
        raise InputError(path, "", f"cannot be written: {error.strerror}") from error


def repair_torn_line(path: Path) -> None:
    """Cuts off a last line that was not written to its end."""
    if path.exists():
        content = path.read_bytes()
        os.truncate(path, content.rfind(b"\n") + 1)


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The entries of all whole lines; none if there is no file. InputError, naming file and line,
    where a line is not a JSON object."""
    entries = []
    for file in (compressed(path), path):
        try:
            content = file.read_bytes() if file.exists() else b""
            content = lzma.decompress(content) if content and file != path else content
        except (OSError, lzma.LZMAError) as error:
            raise InputError(file, "", f"cannot be read: {error}") from error
        lines = content.split(b"\n")[:-1]
        entries += [_parse(line, file, number) for number, line in enumerate(lines, start=1)]
    return entries


def compressed(path: Path) -> Path:
    """The compressed file of lines, which stands before `path` or in its place."""
    return path.with_name(path.name + ".xz")


def _parse(line: bytes, path: Path, number: int) -> dict[str, Any]:
    try:
        entry = json.loads(line.decode("utf-8"))
        if not isinstance(entry, dict):
            raise ValueError("expected a JSON object")
    except (ValueError, RecursionError) as error:
        raise InputError(path, f"line {number}", f"is damaged: {error}") from error
    return entry
