"""Files of records, a line each. After an interruption a script goes on from the whole lines."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tetra_drake.files import write_whole


def read(file: Path) -> list[dict[str, Any]]:
    """Records of a file, one per line. A last line that was cut off does not count."""
    if not file.exists():
        return []
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]


def append(file: Path, records: Iterable[dict[str, Any]]) -> None:
    """Adds records to a file, after its last whole line."""
    file.parent.mkdir(parents=True, exist_ok=True)
    old = file.read_text(encoding="utf-8") if file.exists() else ""
    whole = old[: old.rfind("\n") + 1]
    write_whole(file, whole + "".join(f"{json.dumps(one)}\n" for one in records))
