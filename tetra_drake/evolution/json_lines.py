"""Append-only files of JSON objects, one per line, that survive a kill at any moment.

Each line ends with a checksum, so that a damaged one is told from one that was written. Files that
`xz` has compressed are NAME.xz; what is appended later stands in NAME.
"""

from __future__ import annotations

import json
import lzma
import os
import re
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from tetra_drake.errors import InputError

REMEDY = (
    "cut this line and those after it off the file, and `tetra-drake evolve --resume` makes good "
    "what is missing"
)

_CHECKSUM = re.compile(rb'(.*), "crc": "([0-9a-f]{8})"\}')
"""A line with a checksum: that of what is before it, in hexadecimal digits."""


def append_lines(path: Path, entries: Iterable[Mapping[str, Any]]) -> None:
    """Appends the entries, handed to the system on return; a kill can tear only the last line."""
    text = "".join(json_line(entry) for entry in entries)
    try:
        with path.open("ab") as file:
            file.write(text.encode())
    except OSError as error:
        raise InputError(path, "", f"cannot be written: {error.strerror}") from error


def repair_torn_line(path: Path) -> None:
    """Cuts off a last line that was not written to its end."""
    content = _read(path)
    if not content.endswith(b"\n") and content:
        try:
            os.truncate(path, content.rfind(b"\n") + 1)
        except OSError as error:
            raise InputError(path, "", f"cannot be written: {error.strerror}") from error


def read_lines(path: Path, *, checksums: bool = False) -> list[dict[str, Any]]:
    """The entries of all whole lines; none if there is no file.

    InputError, naming file and line, where a line is not a JSON object or not as it was written;
    with `checksums`, also where it has none.
    """
    entries = []
    for file in (compressed(path), path):
        content = _read(file)
        try:
            content = lzma.decompress(content) if content and file != path else content
        except lzma.LZMAError as error:
            raise InputError(file, "", f"cannot be read: {error}") from error
        for number, line in enumerate(content.split(b"\n")[:-1], start=1):
            try:
                entries.append(_parse(line, checksums=checksums))
            except (ValueError, RecursionError) as error:
                raise InputError(
                    file, f"line {number}", f"is damaged: {error}; {REMEDY}"
                ) from error
    return entries


def compressed(path: Path) -> Path:
    """The compressed file of lines, which stands before `path` or in its place."""
    return path.with_name(path.name + ".xz")


def json_line(entry: Mapping[str, Any]) -> str:
    """An entry as a line with its checksum."""
    text = json.dumps(entry, allow_nan=False).removesuffix("}")
    return f'{text}, "crc": "{zlib.crc32(text.encode()):08x}"}}\n'


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from error


def _parse(line: bytes, *, checksums: bool) -> dict[str, Any]:
    """The entry of a line; ValueError if it is damaged."""
    sealed = _CHECKSUM.fullmatch(line)
    text = sealed[1] + b"}" if sealed else line
    if checksums and not sealed:
        raise ValueError("it has no checksum")
    if sealed and zlib.crc32(sealed[1]) != int(sealed[2], 16):
        raise ValueError("its checksum is not that of its content")
    entry = _DECODER.decode(text.decode("utf-8"))
    if not isinstance(entry, dict):
        raise ValueError("expected a JSON object")
    if "crc" in entry:
        raise ValueError("its checksum is no such")
    return entry


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"found {constant}, expected a number")


_DECODER = json.JSONDecoder(parse_constant=_refuse)  # made once, as there are many lines
