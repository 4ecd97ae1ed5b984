"""Scenario files: read, merged with their bases, checked, and written."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario import rules
from tetra_drake.scenario.fields import (
    TAG,
    Check,
    Tree,
    describe,
    dump_yaml,
    merge,
    parse_yaml,
    tree_of,
)
from tetra_drake.scenario.schema import Scenario


def shipped_scenarios() -> list[str]:
    """The names of the scenarios that come with the package."""
    folder = resources.files("tetra_drake") / "scenario"
    return sorted(
        entry.name.removesuffix(".yaml")
        for entry in folder.iterdir()
        if entry.name.endswith(".yaml")
    )


def load_scenario(name_or_file: str | Path = "thesis") -> Scenario:
    """Loads a shipped scenario by its name, or a scenario file by its path.

    Raises InputError, naming file and key, for whatever is wrong in the file.
    """
    tree, source = _load_tree(str(name_or_file), asked_by=None, seen=())
    return Scenario.from_tree(tree, source)


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as a complete scenario file: SI units, loads back to the same numbers."""
    return dump_yaml(tree_of(scenario, lambda value, unit: f"{value!r} {unit}"))


def differences(scenario: Scenario, base: Scenario) -> list[tuple[str, str]]:
    """Keys and values, as text with units, in which a scenario differs from another one.

    Name and reference are left out.
    """
    ours, theirs = (
        _flat(tree_of(s, lambda value, unit: f"{value:.6g} {unit}")) for s in (scenario, base)
    )
    changed = {
        key: ours.get(key, "none") for key in (*ours, *theirs) if ours.get(key) != theirs.get(key)
    }
    return [(k, v) for k, v in changed.items() if k != "name" and not k.startswith("reference")]


def _flat(tree: Tree, prefix: str = "") -> dict[str, str]:
    flat: dict[str, str] = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            flat |= {prefix + name: value[TAG]} if TAG in value else {}
            flat |= _flat(value, f"{prefix}{name}.")
        elif name != TAG:
            flat[prefix + name] = _shown(value)
    return flat


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        entries = ", ".join(f"{name}: {_shown(v)}" for name, v in value.items() if name != TAG)
        return f"{value.get(TAG, '')} {{{entries}}}".strip()
    if isinstance(value, list):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else describe(value).strip("'")


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
        raise InputError(source, "base", f"found {describe(base)}, expected the name of a scenario")
    if base not in shipped_scenarios():
        base = str(Path(source).parent / base)
    base_tree, _ = _load_tree(base, asked_by=source, seen=(*seen, identity))
    tree = rules.rebalanced(merge(base_tree, given), base=base_tree, given=given)
    return rules.with_valid_reference(tree, base=base_tree, given=given), source


def _read(name_or_file: str, asked_by: str | None) -> tuple[str, str]:
    shipped = shipped_scenarios()
    if name_or_file in shipped:
        resource = resources.files("tetra_drake") / "scenario" / f"{name_or_file}.yaml"
        return resource.read_text(encoding="utf-8"), str(resource)
    path = Path(name_or_file)
    source, key, what = str(path), "", ""
    if asked_by:
        source, key, what = asked_by, "base", f" '{os.path.relpath(path, Path(asked_by).parent)}'"
    try:
        return path.read_text(encoding="utf-8"), str(path)
    except FileNotFoundError as error:
        problem = f"no such scenario file{what}, and no shipped scenario ({', '.join(shipped)})"
        raise InputError(source, key, problem) from error
    except IsADirectoryError as error:
        problem = f"{what} is a directory, expected a scenario file"
        raise InputError(source, key, problem.strip()) from error
    except (OSError, ValueError) as error:
        raise InputError(source, key, f"{what} cannot be read as text: {error}".strip()) from error
