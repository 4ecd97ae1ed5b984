"""Reads what a page made by Meshcat holds."""

import base64
import gzip
import io
import re
import struct
from pathlib import Path
from typing import Any


def read_page(path: Path) -> str:
    """The page that a replay page unpacks into in a browser."""
    (packed,) = re.findall(r'packed = "([A-Za-z0-9+/=]+)"', path.read_text(encoding="utf-8"))
    return gzip.decompress(base64.b64decode(packed)).decode("utf-8")


def commands(page: str, kind: str) -> list[Any]:
    """Those of the commands by which the page builds its scene that are of a kind."""
    found = re.findall(r"octet-binary;base64,([A-Za-z0-9+/=]+)", page)
    packed = map(base64.b64decode, found)
    return [unpack(command) for command in packed if kind.encode() in command]


def unpack(data: bytes) -> Any:
    """Reads the MessagePack that Meshcat's commands are written in."""
    stream = io.BytesIO(data)
    value = _value(stream)
    assert not stream.read()
    return value


def _number(stream: io.BytesIO, form: str) -> Any:
    return struct.unpack(form, stream.read(struct.calcsize(form)))[0]


def _value(stream: io.BytesIO) -> Any:
    code = stream.read(1)[0]
    if code < 0x80:
        return code
    if code in _CONSTANTS:
        return _CONSTANTS[code]
    if code in _NUMBERS:
        return _number(stream, _NUMBERS[code])
    if code in _SIZES:
        kind, form = _SIZES[code]
        size = _number(stream, form)
    else:
        assert code < 0xC0, hex(code)
        kind = {0x80: "dict", 0x90: "list"}.get(code & 0xF0, "text")
        size = code & (0x1F if kind == "text" else 0x0F)
    if kind == "text":
        return stream.read(size).decode()
    if kind == "extension":  # here always an array of 32-bit floats
        return list(struct.unpack(f"<x{size // 4}f", stream.read(1 + size)))
    if kind == "list":
        return [_value(stream) for _ in range(size)]
    return {_value(stream): _value(stream) for _ in range(size)}


_CONSTANTS = {0xC0: None, 0xC2: False, 0xC3: True}
_NUMBERS = {0xCA: ">f", 0xCB: ">d", 0xCC: ">B", 0xCD: ">H", 0xCE: ">I", 0xCF: ">Q"}
_SIZES = {
    **{0xC7: ("extension", ">B"), 0xC8: ("extension", ">H"), 0xC9: ("extension", ">I")},
    **{0xD9: ("text", ">B"), 0xDA: ("text", ">H"), 0xDE: ("dict", ">H")},
    **{0xDC: ("list", ">H"), 0xDD: ("list", ">I")},
}
