"""Cells of the tutorials' scripts."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Cell:
    """Code of a script below a line `# %% about`."""

    about: str
    code: str


def read_cells(script: Path) -> tuple[str, list[Cell]]:
    """Docstring and cells of a tutorial."""
    text = script.read_text(encoding="utf-8")
    parts = [part.partition("\n") for part in text.split("\n# %% ")[1:]]
    title = ast.get_docstring(ast.parse(text)) or script.stem
    return title, [Cell(about, code.strip()) for about, _, code in parts]
