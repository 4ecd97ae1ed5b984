"""The words of docstrings and comments: phrases that readers stumble over stay out."""

from __future__ import annotations

import re
import tokenize
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PHRASES = re.compile(
    r"\b(that of|those of|of which|in which|of those|shall)\b"
    r"""|, as ["'`(\d]|\(as ["'`\d]""",  # "such as" is meant
    re.IGNORECASE,
)


def test_docstrings_and_comments_use_none_of_these_phrases() -> None:
    found = []
    for folder in ("tetra_drake", "diagrams", "runs"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            with tokenize.open(file) as stream:
                for token in tokenize.generate_tokens(stream.readline):
                    if token.string.startswith("#") or token.line.lstrip().startswith('"""'):
                        text = " ".join(token.string.split())
                        found += [(file.name, token.start[0], *PHRASES.findall(text))]
    assert len(found) > 1000
    assert [place for place in found if place[2:]] == []


def test_the_page_for_who_carries_it_on_names_the_phrases():
    words = re.search(r"\((that of[^)]*)\)", PHRASES.pattern)[1].split("|")
    page = (ROOT / "tetra_drake/README.md").read_text(encoding="utf-8")
    assert len(words) == 6 and all(f'"{word}"' in page for word in words)
