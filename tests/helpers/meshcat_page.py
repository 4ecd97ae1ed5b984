"""Content of a page made by Meshcat."""

import base64
import gzip
import re
import struct
from pathlib import Path
from typing import Any

import msgpack


def read_page(path: Path) -> str:
    """The page that a replay page unpacks into in a browser."""
    (packed,) = re.findall(r'packed = "([A-Za-z0-9+/=]+)"', path.read_text(encoding="utf-8"))
    return gzip.decompress(base64.b64decode(packed)).decode("utf-8")


def commands(page: str, kind: str) -> list[Any]:
    """Commands of one kind among those that build the scene of a page."""
    texts = re.findall(r"octet-binary;base64,([A-Za-z0-9+/=]+)", page)
    packed = map(base64.b64decode, texts)
    return [unpack(command) for command in packed if kind.encode() in command]


def unpack(data: bytes) -> Any:
    """Content of a command of Meshcat, which is MessagePack."""
    return msgpack.unpackb(data, ext_hook=_floats)


def _floats(code: int, data: bytes) -> list[float]:
    """An extension, here always an array of 32-bit floats."""
    return list(struct.unpack(f"<{len(data) // 4}f", data))
