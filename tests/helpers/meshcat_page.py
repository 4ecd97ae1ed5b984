"""Reads what a page made by Meshcat holds."""

from __future__ import annotations

import base64
import gzip
import re
import struct
from pathlib import Path
from typing import Any


def read_page(path: Path) -> str:
    """The page that a replay page unpacks into in a browser."""
    (packed,) = re.findall(r'packed = "([A-Za-z0-9+/=]+)"', path.read_text(encoding="utf-8"))
    return gzip.decompress(base64.b64decode(packed)).decode("utf-8")


def commands(page: str, kind: str) -> list[bytes]:
    """Those of the commands by which the page builds its scene that are of a kind, packed."""
    found = re.findall(r"octet-binary;base64,([A-Za-z0-9+/=]+)", page)
    return [command for command in map(base64.b64decode, found) if kind.encode() in command]


def unpack(data: bytes) -> Any:
    """Reads the MessagePack that Meshcat's commands are written in."""
    value, end = _unpack(data, 0)
    assert end == len(data)
    return value


def _unpack(data: bytes, at: int) -> tuple[Any, int]:
    code, at = data[at], at + 1
    if code < 0x80:
        return code, at
    if code in _NUMBERS:
        (number,) = struct.unpack_from(_NUMBERS[code], data, at)
        return number, at + struct.calcsize(_NUMBERS[code])
    if code in (0xC0, 0xC2, 0xC3):
        return {0xC0: None, 0xC2: False, 0xC3: True}[code], at
    if 0xA0 <= code < 0xC0:
        return data[at : at + code - 0xA0].decode(), at + code - 0xA0
    if code in _SIZES:
        kind, form = _SIZES[code]
        (size,) = struct.unpack_from(form, data, at)
        at += struct.calcsize(form)
    else:
        assert code < 0xA0, hex(code)
        kind, size = ("list", code - 0x90) if code >= 0x90 else ("dict", code - 0x80)
    if kind == "text":
        return data[at : at + size].decode(), at + size
    if kind == "extension":  # here always an array of 32-bit floats
        numbers = struct.unpack_from(f"<{size // 4}f", data, at + 1)
        return list(numbers), at + 1 + size
    items = []
    for _ in range(size if kind == "list" else 2 * size):
        item, at = _unpack(data, at)
        items.append(item)
    return (items if kind == "list" else dict(zip(items[::2], items[1::2], strict=True))), at


_NUMBERS = {0xCA: ">f", 0xCB: ">d", 0xCC: ">B", 0xCD: ">H", 0xCE: ">I", 0xCF: ">Q"}
_SIZES = {
    0xC7: ("extension", ">B"),
    0xC8: ("extension", ">H"),
    0xC9: ("extension", ">I"),
    0xD9: ("text", ">B"),
    0xDA: ("text", ">H"),
    0xDC: ("list", ">H"),
    0xDD: ("list", ">I"),
    0xDE: ("dict", ">H"),
}
