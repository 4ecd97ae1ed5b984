"""Append-only files of JSON objects, one per line, that survive a kill at any moment.

Each line ends with a checksum, so that damaged lines are found. NAME.xz holds the earlier lines of
NAME, compressed by `xz`, which has its own checksums. New lines are appended to NAME.
"""

from __future__ import annotations

import json
import lzma
import os
import re
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from tetra_drake.errors import InputError

REMEDY = (
    "cut this line and those after it off the file, and `tetra-drake evolve --resume` makes good "
    "what is missing"
)

_CHECKSUM = re.compile(rb'(.*), "crc": "([0-9a-f]{8})"\}')
"""Pattern of a line: its content, then the CRC-32 of the content in hexadecimal digits."""


def append_lines(path: Path, entries: Iterable[Mapping[str, Any]]) -> None:
    """Appends entries as lines. On return the operating system has them. A kill during the call
    damages at most the last line."""
    text = "".join(json_line(entry) for entry in entries)
    try:
        with path.open("ab") as file:
            file.write(text.encode())
    except OSError as error:
        raise InputError(path, "", f"cannot be written: {error.strerror}") from error


def repair_torn_line(path: Path) -> None:
    """Cuts off an incomplete last line."""
    content = _read(path)
    if content and not content.endswith(b"\n"):
        try:
            os.truncate(path, content.rfind(b"\n") + 1)
        except OSError as error:
            raise InputError(path, "", f"cannot be written: {error.strerror}") from error


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The entries of all complete lines, compressed or not; empty if there is no file.

    Raises InputError, naming file and line, if a line is damaged.
    """
    packed = compressed(path)
    try:
        content = lzma.decompress(_read(packed)) if packed.exists() else b""
    except lzma.LZMAError as error:
        raise InputError(packed, "", f"cannot be read: {error}") from error
    entries = _parse(content, packed, checksums=False)
    return entries + _parse(_read(path), path, checksums=True)


def compressed(path: Path) -> Path:
    """Path of the compressed file with the lines that precede the lines of `path`."""
    return path.with_name(path.name + ".xz")


def json_line(entry: Mapping[str, Any]) -> str:
    """An entry as a line of text with a checksum."""
    text = json.dumps(entry, allow_nan=False).removesuffix("}")
    return f'{text}, "crc": "{zlib.crc32(text.encode()):08x}"}}\n'


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from error


def _parse(content: bytes, file: Path, *, checksums: bool) -> list[dict[str, Any]]:
    """The entries of a file's complete lines. With `checksums`, each line must have a checksum."""
    entries = []
    for number, line in enumerate(content.split(b"\n")[:-1], start=1):
        problem = ""
        match = _CHECKSUM.fullmatch(line)
        if match is None and checksums:
            problem = "it has no checksum"
        if match is not None and zlib.crc32(match[1]) != int(match[2], 16):
            problem = "its checksum does not match its content"
        if problem:
            raise InputError(file, f"line {number}", f"is damaged: {problem}; {REMEDY}")
        try:
            entry = json.loads(line if match is None else match[1] + b"}")
        except (ValueError, RecursionError):
            entry = None
        if not isinstance(entry, dict):
            problem = f"is damaged: it is no object of JSON; {REMEDY}"
            raise InputError(file, f"line {number}", problem)
        entries.append(entry)
    return entries
