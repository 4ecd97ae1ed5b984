"""Scenario files: read, merged with their bases, checked, and written."""

import contextlib
import dataclasses
import difflib
import os
import typing
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from pydrake.common.yaml import yaml_load_typed

from tetra_drake.errors import InputError
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import quantity_to_si


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
    _require_complete(Scenario, tree, source, prefix="")
    scenario: Scenario = yaml_load_typed(
        schema=Scenario,
        data=yaml.safe_dump(tree),
        defaults=Scenario(),
        allow_schema_with_no_yaml=False,
    )
    _check_consistency(scenario, source)
    return scenario


def with_engine(scenario: Scenario, engine: str | None) -> Scenario:
    """The scenario on another engine; on its own if that is None."""
    if engine is None:
        return scenario
    simulation = dataclasses.replace(scenario.simulation, engine=engine)
    return dataclasses.replace(scenario, simulation=simulation)


def dump_scenario(scenario: Scenario) -> str:
    """The scenario as a complete scenario file: SI units, loads back to the same numbers."""
    return yaml.safe_dump(_to_text(scenario), sort_keys=False)


def _load_tree(
    name_or_file: str, *, asked_by: str | None, seen: tuple[str, ...]
) -> tuple[dict[str, Any], str]:
    """The SI tree of a scenario with its bases merged in, and the name of its source."""
    text, source = _read(name_or_file, asked_by)
    identity = str(Path(source).resolve())
    if identity in seen:
        raise InputError(source, "base", "the scenario is based on itself")
    raw = _parse(text, source)
    base = raw.pop("base", None)
    tree = _to_si(Scenario, raw, source, prefix="")
    if base is None:
        return tree, source
    if not isinstance(base, str) or not base:
        raise InputError(
            source, "base", f"found {_describe(base)}, expected the name of a scenario"
        )
    if base not in shipped_scenarios():
        base = str(Path(source).parent / base)
    base_tree, _ = _load_tree(base, asked_by=source, seen=(*seen, identity))
    return _merge(base_tree, tree), source


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


class _UniqueKeyLoader(yaml.SafeLoader):
    """YAML without the licence to give a key twice, of which one value would be lost."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"found the key '{key}' twice", node.start_mark
                )
        return super().construct_mapping(node, deep)


def _parse(text: str, source: str) -> dict[str, Any]:
    try:
        raw = yaml.load(text, _UniqueKeyLoader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(source, "", f"is not YAML: {error}") from error
    if not isinstance(raw, dict):
        raise InputError(source, "", f"found {_describe(raw)}, expected a mapping of keys")
    return raw


def _to_si(schema: type, raw: dict[str, Any], source: str, *, prefix: str) -> dict[str, Any]:
    """Checks every key and value of `raw` against the dataclass and turns them into SI."""
    fields = {f.name: f for f in dataclasses.fields(schema)}
    types = typing.get_type_hints(schema)
    tree: dict[str, Any] = {}
    for name, value in raw.items():
        key = f"{prefix}{name}"
        if name not in fields:
            raise InputError(source, key, f"unknown key{_suggestion(str(name), list(fields))}")
        if dataclasses.is_dataclass(types[name]):
            if not isinstance(value, dict):
                raise InputError(source, key, f"found {_describe(value)}, expected a mapping")
            tree[name] = _to_si(types[name], value, source, prefix=f"{key}.")
            continue
        try:
            tree[name] = _value_to_si(types[name], fields[name].metadata, value)
        except ValueError as error:
            raise InputError(source, key, str(error)) from error
    return tree


def _value_to_si(kind: type, metadata: Any, value: Any) -> Any:
    """One value in SI; raises ValueError that says what was found and what was expected."""
    if "unit" in metadata:
        if not isinstance(value, str):
            raise ValueError(
                f"found {_describe(value)} without a unit, "
                f"expected a quantity that converts to {metadata['unit']}"
            )
        number = quantity_to_si(value, metadata["unit"])
        return _within_limits(number, metadata, shown=f"'{value}'")
    if kind in (int, float):
        number = _plain_number(kind, value)
        return kind(_within_limits(number, metadata, shown=str(number)))
    if not isinstance(value, kind):
        raise ValueError(f"found {_describe(value)}, expected {_TYPE_NAMES[kind]}")
    if "choices" in metadata and value not in metadata["choices"]:
        raise ValueError(f"found '{value}', expected one of {', '.join(metadata['choices'])}")
    return value


def _plain_number(kind: type[int] | type[float], value: Any) -> float:
    if kind is float and isinstance(value, str):  # YAML 1.1 takes 1e-3 for text
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, (kind, int)):
        wanted = "an integer" if kind is int else "a number"
        raise ValueError(f"found {_describe(value)}, expected {wanted}")
    number: float = value
    if not abs(number) < 1e300:  # NaN, infinity, and integers beyond floating point
        raise ValueError(f"found {str(value)[:40]}, expected a finite number")
    return number


_TYPE_NAMES = {bool: "true or false", str: "text"}


def _within_limits(number: float, metadata: Any, *, shown: str) -> float:
    if "above" in metadata and not number > metadata["above"]:
        raise ValueError(f"found {shown}, expected more than {metadata['above']}")
    if "at_least" in metadata and not number >= metadata["at_least"]:
        raise ValueError(f"found {shown}, expected at least {metadata['at_least']}")
    if "at_most" in metadata and not number <= metadata["at_most"]:
        raise ValueError(f"found {shown}, expected at most {metadata['at_most']}")
    return number


def _merge(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for name, value in changes.items():
        both = isinstance(value, dict) and isinstance(base.get(name), dict)
        merged[name] = _merge(base[name], value) if both else value
    return merged


def _require_complete(schema: type, tree: dict[str, Any], source: str, *, prefix: str) -> None:
    types = typing.get_type_hints(schema)
    for f in dataclasses.fields(schema):
        key = f"{prefix}{f.name}"
        if f.name not in tree:
            raise InputError(
                source, key, "is missing; give it, or begin the file with `base: thesis`"
            )
        if dataclasses.is_dataclass(types[f.name]):
            _require_complete(types[f.name], tree[f.name], source, prefix=f"{key}.")


def _check_consistency(scenario: Scenario, source: str) -> None:
    """Relations between values that no single field can check."""
    bounds, simulation = scenario.gait_bounds, scenario.simulation
    for name, low, high in (
        ("weight", bounds.weight_min, bounds.weight_max),
        ("tau_a", bounds.tau_a_min, bounds.tau_a_max),
    ):
        if low > high:
            raise InputError(
                source,
                f"gait_bounds.{name}_min",
                f"found {low}, expected at most {name}_max, {high}",
            )
    if simulation.steady_from >= simulation.duration:
        raise InputError(
            source,
            "simulation.steady_from",
            f"found {simulation.steady_from} s, expected less than the duration, "
            f"{simulation.duration} s",
        )


def _to_text(node: Any) -> dict[str, Any]:
    text: dict[str, Any] = {}
    for f in dataclasses.fields(node):
        value = getattr(node, f.name)
        if dataclasses.is_dataclass(value):
            text[f.name] = _to_text(value)
        elif "unit" in f.metadata:
            text[f.name] = f"{value!r} {f.metadata['unit']}"
        else:
            text[f.name] = value
    return text


def _describe(value: Any) -> str:
    if value is None:
        return "nothing"
    kinds = {dict: "a mapping", list: "a list", bool: str(value).lower()}
    return kinds.get(type(value), f"'{value}'" if isinstance(value, str) else str(value))


def _suggestion(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    if close:
        return f"; did you mean '{close[0]}'?"
    return f"; expected one of {', '.join(known)}"
