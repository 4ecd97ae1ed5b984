"""Reading of scenario files, together with the scenarios that they change, and writing."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Protocol

from tetra_drake.errors import InputError
from tetra_drake.files import write_whole
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.shipped import SCENARIOS, shipped_scenarios
from tetra_drake.scenario.structure_files import structure_file, with_structure
from tetra_drake.scenario.yaml_text import dump_yaml, read_mapping
from tetra_drake.settings.refusals import no_such
from tetra_drake.settings.section import written

SCENARIO = "scenario.yaml"
"""Name of the scenario's file in a folder that a command writes."""


def load_scenario(name_or_file: str | Path = "thesis") -> Scenario:
    """Loads a shipped scenario by its name, or a scenario file.

        >>> scenario = td.load_scenario("thesis").with_changes({"robot.spacing": "3 in"})
        >>> print(scenario)

    Args:
        name_or_file: the name of a shipped scenario, or the path of a scenario file.

    Raises:
        InputError: names file and key, if the file is wrong, or a structure file or height file
            that it names.
    """
    name = str(name_or_file)
    file = _file(name, Path(), name)
    scenario = _load(file)
    scenario.terrain.grid(ahead=0.0, scale=scenario.robot.blueprint().scale, source=file)
    return scenario


class HasScenario(Protocol):
    """Object with a scenario: a run, or the result of a simulation."""

    @property
    def scenario(self) -> Scenario: ...


GivenScenario = Scenario | HasScenario | str | Path
"""Argument that gives a scenario: a scenario; its name, file, or the folder of a command that holds
it; a run or a result."""


def given_scenario(scenario: GivenScenario) -> Scenario:
    """Converts an argument to a scenario. It is a scenario, its name or file, a folder that holds
    its file scenario.yaml, a run or a result. Raises InputError for anything else."""
    if isinstance(scenario, (str, Path)):
        in_folder = Path(scenario) / SCENARIO
        is_folder = str(scenario) not in shipped_scenarios() and os.path.isfile(in_folder)
        return load_scenario(in_folder if is_folder else scenario)
    own = getattr(scenario, "scenario", scenario)
    if isinstance(own, Scenario):
        return own
    problem = f"found {scenario!r:.60}, expected a scenario, its name, file or run"
    raise InputError("scenario", "", problem)


def dump_scenario(scenario: Scenario) -> str:
    """Text of a scenario file with all settings in SI. It loads as the same scenario even if
    defaults change. If the terrain comes from a height file, this must lie in the same folder;
    save_scenario() puts it there."""
    return dump_yaml(written(scenario.model_dump()))


def save_scenario(folder: Path, scenario: Scenario) -> str:
    """Writes a scenario, and its height file if it has one, to a folder. The folder can be moved
    later. Returns the content of the scenario's file."""
    text = dump_scenario(scenario)
    scenario.terrain.save(folder)
    write_whole(folder / SCENARIO, text)
    return text


def _file(name: str, folder: Path, source: object, key: str = "") -> Path:
    """The file of a shipped scenario; for another name, the path relative to `folder`. Raises
    InputError, naming `source` and `key`, if there is none."""
    file = SCENARIOS / f"{name}.yaml" if name in shipped_scenarios() else folder / name
    if not os.path.exists(file):
        given = f"'{name}': " if key else ""
        raise InputError(source, key, given + no_such("scenario file", name, shipped_scenarios()))
    return file


def _load(file: Path, seen: tuple[Path, ...] = ()) -> Scenario:
    """Loads the scenario of a file, with the values that it takes from its base, and so on. `seen`
    are the files that are based on this one. Raises InputError if it is based on one of them."""
    keys = [*Scenario.model_fields, "base"]
    given = read_mapping(file, "scenario file", keys=[*keys, "nodes"])
    if "nodes" in given:
        expected = "`base: prism` and `robot: !Structure {file: ...}`, which names this file"
        raise InputError(file, "", f"is a structure, expected a scenario: a file with {expected}")
    if file.resolve() in seen:
        raise InputError(file, "base", "the scenario is based on itself")

    terrain, robot = given.get("terrain"), given.get("robot")
    if isinstance(terrain, dict) and isinstance(terrain.get("file"), str):
        terrain["file"] = os.path.abspath(file.parent / terrain["file"])
    if isinstance(robot, dict) and isinstance(robot.get("file"), str):
        robot["file"] = os.path.abspath(structure_file(robot["file"], file.parent))

    base = given.pop("base", None)
    if base is None:
        return Scenario.from_tree(with_structure(given, file), file)
    if not isinstance(base, str) or not base:
        raise InputError(file, "base", f"found {base!r}, expected the name of a scenario")
    base_file = _file(base, file.parent, file, "base")
    return _load(base_file, (*seen, file.resolve())).with_file(given, file)
