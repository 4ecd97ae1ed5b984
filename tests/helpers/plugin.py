"""Installs plug-ins without an installer: a folder with a module and the entry points of it."""

import shutil
import tomllib
from collections.abc import Mapping
from pathlib import Path

EXAMPLE = Path(__file__).parents[1] / "data/plugin"


def install_example(site: Path) -> None:
    """Copies the example's package to the folder `site`, with what its pyproject.toml declares."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text("utf-8"))["project"]
    for folder in EXAMPLE.glob("*/"):
        shutil.copytree(folder, site / folder.name, ignore=shutil.ignore_patterns("__pycache__"))
    declare(site, project["name"], project["version"], project["entry-points"])


def declare(site: Path, name: str, version: str, groups: Mapping[str, Mapping[str, str]]) -> None:
    """Writes the metadata of a distribution and its entry points, as an installer does."""
    folder = site / f"{name.replace('-', '_')}-{version}.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = []
    for group, entries in groups.items():
        lines += [f"[{group}]", *(f"{entry} = {value}" for entry, value in entries.items())]
    (folder / "entry_points.txt").write_text("\n".join(lines) + "\n")
