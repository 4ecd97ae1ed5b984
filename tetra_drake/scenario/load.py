"""Scenario files: read, merged with their bases, checked, written, and compared."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

from tetra_drake.errors import InputError
from tetra_drake.files import read_text
from tetra_drake.scenario import rules
from tetra_drake.scenario.fields import TAG, Check, Tree, dump_yaml, merge, parse_yaml, tree_of
from tetra_drake.scenario.schema import Scenario


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    entries = (resources.files("tetra_drake") / "scenario").iterdir()
    names = (entry.name for entry in entries if entry.name.endswith(".yaml"))
    return sorted(name.removesuffix(".yaml") for name in names)


def load_scenario(name_or_file: str | Path = "thesis") -> Scenario:
    """Loads a shipped scenario by its name, or a scenario file by its path.

    Raises InputError, naming file and key, for whatever is wrong in the file.
    """
    tree, source = _load_tree(str(name_or_file), asked_by=None, seen=())
    return Scenario.from_tree(tree, source)


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as a complete scenario file: SI units, loads back to the same numbers."""
    return dump_yaml(tree_of(scenario, lambda number, unit: f"{number!r} {unit}"))


def differences(scenario: Scenario, base: Scenario) -> list[tuple[str, str]]:
    """(key, value as text) of what a scenario has other than `base`, name and reference aside."""
    ours, theirs = (
        dict(_texts(tree_of(each, lambda number, unit: f"{number:.6g} {unit}"), ""))
        for each in (scenario, base)
    )
    changed = [(key, text) for key, text in ours.items() if theirs.get(key) != text]
    return [(k, text) for k, text in changed if k.split(".")[0] not in ("name", "reference")]


def _texts(tree: Tree, prefix: str) -> Iterator[tuple[str, str]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _texts(value, f"{prefix}{name}.")
        else:
            text = f"{value:.6g}" if isinstance(value, float) else json.dumps(value)
            yield (prefix + name).removesuffix(f".{TAG}"), text.replace('"', "")


def _load_tree(
    name_or_file: str, *, asked_by: str | None, seen: tuple[str, ...]
) -> tuple[Tree, str]:
    """The SI tree of a scenario with its bases merged in, and the name of its source."""
    content, source = _read(name_or_file, asked_by)
    identity = str(Path(source).resolve())
    if identity in seen:
        raise InputError(source, "base", "the scenario is based on itself")
    try:
        raw = parse_yaml(content)
    except ValueError as error:
        raise InputError(source, "", str(error)) from error
    base = raw.pop("base", None) if isinstance(raw, dict) else None
    given = Check(source).section(Scenario, raw)
    if base is None:
        return given, source
    if not isinstance(base, str) or not base:
        raise InputError(source, "base", f"found {base!r}, expected the name of a scenario")
    if base not in shipped_scenarios():
        base = str(Path(source).parent / base)
    base_tree, _ = _load_tree(base, asked_by=source, seen=(*seen, identity))
    tree = rules.rebalanced(merge(base_tree, given), base=base_tree, given=given)
    if not rules.same_experiment(tree, base_tree):
        tree["reference"] = given.get("reference")
    return tree, source


def _read(name_or_file: str, asked_by: str | None) -> tuple[str, str]:
    """The text of a scenario, and the name of its source."""
    if name_or_file in shipped_scenarios():
        resource = resources.files("tetra_drake") / "scenario" / f"{name_or_file}.yaml"
        return resource.read_text(encoding="utf-8"), str(resource)
    try:
        return read_text(name_or_file, "scenario file"), name_or_file
    except InputError as error:
        problem = f"{error.problem} (shipped: {', '.join(shipped_scenarios())})"
        if asked_by is None:
            raise InputError(name_or_file, "", problem) from error
        name = os.path.relpath(name_or_file, Path(asked_by).parent)
        raise InputError(asked_by, "base", f"'{name}': {problem}") from error
