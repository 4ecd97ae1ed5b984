"""Structures of the literature and of public files, measured: statics, and rest on three engines.

    python runs/corpus.py [NAME ...]

The structures are files of tests/data/corpus. Each is brought to equilibrium, then simulated for
one second from there on the compiled engine, the Drake diagram and MuJoCo. A structure without
weight or with anchors has no ground; others stand on one. Bars of plane models cross, so struts do
not touch each other.

Writes measured.json, tables and README.md in that folder. Without names, the structures that have
no numbers yet are measured; so an interrupted run goes on where it stopped.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from page import rendered
from script import read_settings, script

from tetra_drake.engines.engine import engine_of
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import write_whole
from tetra_drake.lab.study.equilibrium import EquilibriumStudy, robot_of_file, study_equilibrium
from tetra_drake.laws.capsules import NoStrutContact
from tetra_drake.laws.terrain import Nothing
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.engine_kinds import Compiled, Drake, Mujoco
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.structure_files import read_structure

FOLDER = Path(__file__).parents[1] / "tests" / "data" / "corpus"
MEASURED, KNOWN, PAGE = FOLDER / "measured.json", FOLDER / "known.yaml", FOLDER / "README.md"
ENGINES = {"compiled": Compiled(), "drake": Drake(), "mujoco": Mujoco()}
SECONDS = {"simulation.duration": 1.0, "simulation.steady_from": 0.5}
SIZES, OTHERS = read_settings(Path(__file__).with_suffix(".yaml")).values()
"""Numbers of a structure on the page, and those in the table alone, with their headings."""
MOVES = {engine: f"moves on {engine} (m)" for engine in ENGINES}
"""Headings of the greatest ways at rest."""


def names() -> list[str]:
    """Names of the structures, in the order of the alphabet."""
    return sorted(file.stem for file in FOLDER.glob("*.yaml") if file != KNOWN)


def robot_of(name: str) -> Robot:
    """Robot of a structure in equilibrium: on the ground if only the ground bears it."""
    file = FOLDER / f"{name}.yaml"
    structure = read_structure(file)
    if structure.gravity and not structure.anchors:
        return robot_of_file(str(file))
    parts = {"terrain": Nothing(), "strut_contact": NoStrutContact(), "engine": Mujoco()}
    scenario = load_scenario("prism").with_sections(name=name, robot=structure, **parts)
    friction = scenario.friction.without_bristles()
    return Robot.of(scenario.with_sections(friction=friction), at_rest=True)


def rest(robot: Robot, engine: str) -> SimulationResult:
    """One second of a robot that starts in equilibrium and whose actuators rest."""
    scenario = robot.scenario.with_sections(engine=ENGINES[engine]).with_numbers(SECONDS)
    passive = dataclasses.replace(robot, scenario=scenario).without_network()
    still = np.zeros((2, passive.structure.signals))
    driven = DrivenRobot(robot=passive, name="rest", samples=still)
    return engine_of(scenario).simulate(driven, record=True)


def quantity(study: EquilibriumStudy, what: str) -> float:
    """A number of an equilibrium by its name, such as "tension side", "distance a b" or, with a
    slash, the ratio of two: "length side/base"."""
    kind, _, named = what.partition(" ")
    values = [_value(study, kind, part.split()) for part in named.split("/")]
    return values[0] / values[1] if len(values) > 1 else values[0]


def _value(study: EquilibriumStudy, kind: str, named: list[str]) -> float:
    """A number of a kind. `named` are a group of cables, or the one or two nodes that it is of."""
    if kind in ("tension", "length"):
        return float(study.cables.loc[study.cables["group"] == named[0], kind].mean())
    if not named:
        return totals(study)[kind]
    p_WN = study.nodes.loc[named, ["x", "y", "z"]].to_numpy()
    if kind == "height":
        return float(p_WN[0, 2])
    if kind == "distance":
        return float(np.linalg.norm(p_WN[1] - p_WN[0]))
    assert kind == "twist", kind
    centre = study.nodes[["x", "y"]].to_numpy().mean(axis=0)
    first, second = np.arctan2(*(p_WN[:, :2] - centre).T[::-1])
    return float(abs((np.degrees(second - first) + 180.0) % 360.0 - 180.0))


def totals(study: EquilibriumStudy) -> dict[str, float]:
    """Numbers of a whole structure by name."""
    structure, statics = study.robot.structure, study.statics
    states, mechanisms = len(statics.self_stresses), statics.mechanisms
    return {
        "bodies": len(structure.bodies),
        "cables": len(structure.cables),
        "states": states,
        "mechanisms": mechanisms,
        "states-mechanisms": states - mechanisms,
        "mass": float(structure.mass.sum()),
        "load": float(study.nodes["load"].sum()),
        "frequency": float(study.frequencies.min(initial=np.inf)),
    }


def measured(name: str) -> dict[str, Any]:
    """Numbers of a structure: statics, known quantities as found here, rest on each engine."""
    study = study_equilibrium(robot_of(name))
    row: dict[str, Any] = {**totals(study)}
    known = read_settings(KNOWN).get(name, {})
    row["known"] = [[what, to, quantity(study, what), by] for what, (to, by) in known.items()]
    for engine in ENGINES:
        try:
            result = rest(study.robot, engine)
        except (InputError, SimulationFailure) as error:
            row[engine] = str(error)
            continue
        p_WN = result.trajectory.p_WN.values
        row[engine] = float(np.linalg.norm(p_WN - p_WN[0], axis=2).max())
        if engine == "compiled":  # once more: it is compiled by now
            row["speed"] = 1.0 / rest(study.robot, engine).wall_time
    return row


def tables(rows: dict[str, dict[str, Any]]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The structures with their sources and numbers, and what is known of them beside ours."""
    structures, known = [], []
    for name, row in sorted(rows.items()):
        text = (FOLDER / f"{name}.yaml").read_text(encoding="utf-8")
        source = re.search(r"^# source: (.*(?:\n#   .*)*)", text, re.MULTILINE)
        about = text.splitlines()[0].removeprefix("# ")
        by = (source[1] if source else "").replace("\n#   ", " ")
        numbers = {heading: row[key] for key, heading in (SIZES | OTHERS | MOVES).items()}
        structures.append({"structure": name, "what it is": about, "source": by} | numbers)
        known += [[name, *one] for one in row["known"]]
    columns = ["structure", "quantity", "known", "ours", "by"]
    return pd.DataFrame(structures), pd.DataFrame(known, columns=columns)


def page(structures: pd.DataFrame, known: pd.DataFrame) -> str:
    """Content of README.md."""
    moves = {one: pd.to_numeric(structures[of], "coerce").max() for one, of in MOVES.items()}
    return rendered("corpus.md", structures=structures, known=known, sizes=SIZES, moves=moves)


def csv(table: pd.DataFrame) -> str:
    """A table as text, with numbers of six significant digits."""
    return table.to_csv(index=False, float_format="%.6g", lineterminator="\n")


@script
def main(chosen: Sequence[str]) -> None:
    """Measures structures and writes the page after each."""
    rows = json.loads(MEASURED.read_text(encoding="utf-8")) if MEASURED.exists() else {}
    rows = {name: row for name, row in rows.items() if name in names()}
    for name in chosen or [name for name in names() if name not in rows]:
        rows[name] = measured(name)
        print(name, json.dumps(rows[name]))
        write_whole(MEASURED, json.dumps(rows, indent=1, sort_keys=True) + "\n")
        structures, known = tables(rows)
        write_whole(FOLDER / "structures.csv", csv(structures))
        write_whole(FOLDER / "known.csv", csv(known))
        write_whole(PAGE, page(structures, known))
