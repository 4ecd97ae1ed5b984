"""The words of docstrings and comments: phrases that readers stumble over stay out."""

from __future__ import annotations

import ast
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("tetra_drake", "diagrams", "runs")
PHRASES = re.compile(
    r"\b(that of|those of|of which|in which|of those|shall)\b"
    r"""|, as ["'`(\d]|\(as ["'`\d]""",  # "such as" is meant
    re.IGNORECASE,
)


def texts(file: Path) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring (also of attributes) and comment of a file."""
    with file.open("rb") as stream:
        for token in tokenize.tokenize(stream.readline):
            if token.type == tokenize.COMMENT:
                yield token.start[0], token.string
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        value = getattr(node.value, "value", None) if isinstance(node, ast.Expr) else None
        if isinstance(value, str):
            yield node.lineno, value


def found(file: Path) -> Iterator[str]:
    """Each phrase of a file, with its line."""
    for line, text in texts(file):
        for match in PHRASES.finditer(" ".join(text.split())):
            yield f"{file.relative_to(ROOT)}:{line}: {match[0]!r}"


def test_docstrings_and_comments_use_none_of_these_phrases() -> None:
    files = [file for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))]
    assert len(files) > 100
    assert [phrase for file in files for phrase in found(file)] == []
