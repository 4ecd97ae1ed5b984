"""The faces of the package, and the sections of a scenario that each of them reads."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.converged import shortly
from pydrake.common import RandomGenerator
from pydrake.systems.analysis import Simulator

import tetra_drake as td
from tetra_drake.engines.drake import MakeDisturbedSimulator
from tetra_drake.errors import InputError
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

PAGE = Path(td.__file__).parent / "scenario" / "README.md"
ROWS = [line.strip("| ").split(" | ") for line in PAGE.read_text("utf-8").splitlines()]
TABLE = {row[0].strip("`"): row[1:] for row in ROWS if row[-1] in ("reads", "leaves")}
PRISM = shortly(td.load_scenario("prism"), 0.04, engine="!Compiled")
SECTIONS: dict[str, Any] = {
    "events": [{"at": "2 ms", "cut": ["side n0 n3", "top n3 n4"]}],
    "policy": "!Rolling {clock: 0.1 s}",
    "tolerances": {"robot.cables.side.stiffness": "20 %"},
    "disturbances": {"draws": 1, "spreads": {"robot.cables.side.stiffness": 0.3}},
}
GAIT = td.seeded_gait(PRISM, 1)


def stepped(scenario: Scenario) -> np.ndarray:
    simulation = td.Simulation(scenario, control_period=0.02)
    return simulation.step(simulation.rest).p_WN


def held(scenario: Scenario) -> np.ndarray:
    diagram = MakeTensegrityDiagram(Robot.of(scenario))
    simulator = Simulator(diagram)
    port = diagram.GetInputPort("signals")
    port.FixValue(simulator.get_mutable_context(), np.zeros(port.size()))
    simulator.AdvanceTo(0.01)
    return diagram.GetOutputPort("state").Eval(simulator.get_context())


def disturbed(scenario: Scenario) -> np.ndarray:
    varied = scenario
    if scenario.disturbances is None:
        zero = {"draws": 1, "spreads": {"robot.gravity": 1e-9}}
        varied = scenario.with_changes({"disturbances": zero})
    simulator = MakeDisturbedSimulator(varied, GAIT, RandomGenerator(1))
    return simulator.get_context().get_continuous_state_vector().CopyToVector()


def predicted(scenario: Scenario) -> np.ndarray:
    if not scenario.tolerances:
        scenario = scenario.with_changes({"tolerances": {"robot.gravity": "1e-9 m/s^2"}})
    gait = td.seeded_gait(scenario, 1)
    return td.predict(scenario, ["distance"], gait=gait, draws=2).draws.to_numpy()


FACES: dict[str, Callable[[Scenario], Any]] = {
    "simulate": lambda s: td.simulate(s, td.seeded_gait(s, 1)).metrics.distance,
    "Simulation": stepped,
    "MakeTensegrityDiagram": held,
    "MakeDisturbedSimulator": disturbed,
    "linearize": lambda s: td.linearize(s).system.A(),
    "study_equilibrium": lambda s: td.study_equilibrium(s).frequencies,
    "predict": predicted,
}


def test_the_page_has_each_face() -> None:
    assert [*TABLE] == [*FACES]


@pytest.mark.parametrize("face", FACES)
def test_a_face_reads_the_sections_of_the_table(face: str) -> None:
    plain, found = FACES[face](PRISM), []
    for key, value in SECTIONS.items():
        try:
            with_section = FACES[face](PRISM.with_changes({key: value}))
            found.append("leaves" if np.array_equal(plain, with_section) else "reads")
        except InputError:
            found.append("refuses")
    assert found == TABLE[face]
