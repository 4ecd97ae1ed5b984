"""Scenario files: read, merged with their bases, checked, written, and compared."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.scenario.fields import TAG, Check, Tree, dump_yaml, parse_yaml, tree_of
from tetra_drake.scenario.schema import Scenario, on_base
from tetra_drake.scenario.terrain_kinds import make_grid

MOST_BYTES = 2**20
"""Of a scenario file."""


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    return sorted(file.stem for file in Path(__file__).parent.glob("*.yaml"))


def load_scenario(name_or_file: str | Path = "thesis") -> Scenario:
    """Loads a shipped scenario by its name, or a scenario file by its path.

    Raises InputError, naming file and key, for whatever is wrong in the file, or in the height
    file that it names.
    """
    file = _file(str(name_or_file), Path())
    scenario = Scenario.from_tree(_load_tree(file), file)
    make_grid(scenario.terrain, ahead=0.0, source=file)
    return scenario


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as a complete scenario file: SI units, loads back to the same numbers."""
    show = "{!r} {}".format
    return dump_yaml(tree_of(scenario, show, sparse=True))


def differences(scenario: Scenario, base: Scenario) -> list[tuple[str, str]]:
    """(key, value as text) of what a scenario has other than `base`, its name aside."""
    ours, theirs = (
        dict(_texts(tree_of(each, lambda number, unit: f"{number:.6g} {unit}")))
        for each in (scenario, base)
    )
    changed = [(key, text) for key, text in ours.items() if theirs.get(key) != text]
    return [(key, text) for key, text in changed if key != "name"]


def _texts(tree: Tree, prefix: str = "") -> Iterator[tuple[str, str]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _texts(value, f"{prefix}{name}.")
        else:
            text = f"{value:.6g}" if isinstance(value, float) else json.dumps(value)
            yield (prefix + name).removesuffix(f".{TAG}"), text.replace('"', "")


def _file(name: str, folder: Path) -> Path:
    """The file of a shipped scenario, or of a path from `folder`."""
    if name in shipped_scenarios():
        return Path(__file__).parent / f"{name}.yaml"
    return folder / name


def _load_tree(file: Path, seen: tuple[Path, ...] = ()) -> Tree:
    """The SI tree of a scenario file with its bases merged in."""
    expected = f"scenario file (shipped: {', '.join(shipped_scenarios())})"
    content = read_text(file, expected, most=MOST_BYTES)
    if file.resolve() in seen:
        raise InputError(file, "base", "the scenario is based on itself")
    raw = parse_yaml(content, file)
    if not isinstance(raw, dict):  # which may be any file: nothing of it is shown
        raise InputError(file, "", "holds no mapping of keys, expected a scenario")
    base = raw.pop("base", None)
    given: Tree = Check(file).value(Scenario, raw)
    terrain = given.get("terrain", {})
    if "file" in terrain:
        terrain["file"] = os.path.abspath(file.parent / terrain["file"])
    if base is None:
        return given
    if not isinstance(base, str) or not base:
        raise InputError(file, "base", f"found {base!r}, expected the name of a scenario")
    base_file = _file(base, file.parent)
    if not os.path.exists(base_file):
        raise InputError(file, "base", f"'{base}': no such {expected}")
    tree = _load_tree(base_file, (*seen, file.resolve()))
    return on_base(tree, given)
