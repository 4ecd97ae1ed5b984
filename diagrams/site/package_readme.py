"""Metadata hook of hatchling: README.md for a package index, where links have to be absolute.

The repository's address is `Source` in `project.urls`, or else the one of the GitHub workflow that
builds the package. Without an address, pictures and links are their texts, so that none is broken.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

_PICTURE = re.compile(r'<img src="(?P<target>[^":]+)"(?P<rest>[^>]* alt="(?P<text>[^"]*)"[^>]*)>')
_LINK = re.compile(r"(?<!!)\[(?P<text>[^]]*)\]\((?P<target>[^):#]+)(?P<anchor>#[^)]*)?\)")


def for_index(text: str, repository: str | None, version: str) -> str:
    """A page of the repository, with links to the files of a version."""
    if repository is None:
        text = _PICTURE.sub(r"\g<text>", text)
        return _LINK.sub(r"\g<text>", text)
    raw, page = (f"{repository.rstrip('/')}/{kind}/v{version}" for kind in ("raw", "blob"))
    text = _PICTURE.sub(rf'<img src="{raw}/\g<target>"\g<rest>>', text)
    return _LINK.sub(
        lambda link: f"[{link['text']}]({page}/{link['target']}{link['anchor'] or ''})", text
    )


def repository_of(urls: dict[str, str]) -> str | None:
    """Address of the repository; None if there is none."""
    server, name = (os.environ.get(f"GITHUB_{key}") for key in ("SERVER_URL", "REPOSITORY"))
    return urls.get("Source") or (f"{server}/{name}" if server and name else None)


class PackageReadme(MetadataHookInterface):
    """Sets the field `readme` of the package's metadata."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Fills in the text."""
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        repository = repository_of(metadata.get("urls", {}))
        text = for_index(text, repository, metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
