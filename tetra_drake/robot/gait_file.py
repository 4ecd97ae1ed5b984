"""Gait files, and arguments that give a gait."""

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, Protocol

from pydantic import Field

import tetra_drake
from tetra_drake.errors import InputError
from tetra_drake.files import given_path, read_json, write_whole
from tetra_drake.robot.gait import Gait, check_parameters
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.section import Section


def save_gait(gait: Gait, path: str | Path, scenario: Scenario) -> None:
    """Writes a gait file (JSON) at `path`. load_gait() reads exactly the same numbers. If it is
    unknown for which scenario the gait was made, the file names `scenario`."""
    write_whole(path, json.dumps(gait.to_json(scenario), indent=1) + "\n")


_WEIGHT = "weight "
_OLDER = {"weights": _WEIGHT, "gains": "gain ", "tau_a_s": "tau_A", "tau_b_s": "tau_B"}
"""Names of parameters, or their beginnings, by keys that gait files had up to version 0.5.0."""


class GaitFile(Section):
    """Content of a gait file as it was read, before it is checked against a scenario; see Gait."""

    version: Literal[1, 2, 3] = Field(alias="schema")
    name: str = ""
    scenario: str = ""
    parameters: dict[str, float]
    """Numbers by name, in SI units and in any order; see Scenario.parameters."""
    turn: float = Field(default=0.0, ge=-1, le=1)
    body: dict[str, float | str] = Field(default={})
    """Numbers of the body by scenario key, quantities as texts with units."""


def _renewed(tree: Any, names: Iterable[str]) -> Any:
    """Content of a gait file of version 0.5.0 in the present form; any other content as it is.
    `names` are the parameters of the scenario, in whose order weights may be a list."""
    if not isinstance(tree, dict) or "weights" not in tree:
        return tree
    weights = [name.removeprefix(_WEIGHT) for name in names if name.startswith(_WEIGHT)]
    parameters: dict[str, Any] = {}
    for key in _OLDER.keys() & tree.keys():
        group = tree[key]
        if key == "weights" and isinstance(group, list):  # a place without a name is refused later
            places = map(str, range(len(weights), len(group)))
            group = dict(zip([*weights, *places], group, strict=False))
        elif not isinstance(group, dict):
            group = {"": group}
        parameters |= {f"{_OLDER[key]}{name}": value for name, value in group.items()}
    return {key: x for key, x in tree.items() if key not in _OLDER} | {"parameters": parameters}


def load_gait(path: str | Path, scenario: GivenScenario, *, key: str = "") -> Gait:
    """Reads a gait for the scenario's robot: parameters of its oscillators, or of its policy.

        >>> gait = td.load_gait("gait.json", td.load_scenario("quick"))

    Args:
        path: a gait file.
        scenario: the scenario that the gait must fit, its name or file, or a run.
        key: for another JSON file that contains a gait: the key at its top level whose value is the
            gait. By default the file is the gait.

    Raises:
        InputError: names file and key, if the file is wrong or does not fit the scenario.
    """
    raw = read_json(given_path(path, "load_gait", "path"), "gait file")
    raw = raw.get(key) if key and isinstance(raw, dict) else raw
    scenario = given_scenario(scenario)
    file = GaitFile.from_tree(_renewed(raw, scenario.parameters), path, key=key)
    place = f"{key}.parameters".strip(".")
    gait = Gait(
        name=file.name or Path(path).stem,
        parameters=check_parameters(file.parameters, scenario.parameters, path, place),
        turn=file.turn,
        body=tuple(file.body.items()),
        scenario=file.scenario,
    )
    if gait.turn and (scenario.policy is not None or not scenario.blueprint().sides.any()):
        problem = f"found {gait.turn}, expected 0: no oscillator is left or right"
        raise InputError(path, f"{key}.turn".strip("."), problem)
    try:
        with_body(scenario, gait)
    except InputError as error:
        place = f"{key}.body.{error.key}".strip(".")
        raise InputError(path, place, error.problem) from error
    return gait


class HasBestGait(Protocol):
    """Object with a best gait, such as a run."""

    def best_gait(self) -> Gait: ...


GivenGait = Gait | HasBestGait | str | Path
"""A gait, its file, or a run or its folder; a run means its best gait."""


def given_gait(gait: GivenGait, scenario: Scenario) -> Gait:
    """The gait that an argument means: a gait itself, one read from a file for `scenario`, or the
    best gait of a run or of its folder. Raises InputError for anything else."""
    if isinstance(gait, Gait):
        return gait
    if isinstance(gait, (str, Path)):
        if os.path.isdir(gait):
            return tetra_drake.load_run(gait).best_gait()
        return load_gait(gait, scenario)
    if hasattr(gait, "best_gait"):
        return gait.best_gait()
    raise InputError("gait", "", f"found {gait!r:.60}, expected a gait, its file or a run")
