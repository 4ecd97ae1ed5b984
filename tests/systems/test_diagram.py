"""The wiring of the robot's diagram."""

from __future__ import annotations

import gc
import os
from pathlib import Path

import pytest
from pydrake.systems.analysis import Simulator

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import MatsuokaCpg
from tetra_drake.systems.diagram import MakeTensegrityDiagram


@pytest.fixture
def gait(scenario: Scenario, data: Path) -> Gait:
    return load_gait(data / "gait_b.json", scenario)


def names(scenario: Scenario, gait: Gait) -> set[str]:
    return {s.get_name() for s in MakeTensegrityDiagram(scenario, gait).GetSystems()}


def test_has_the_blocks_of_the_thesis_and_nothing_to_show_or_log(
    scenario: Scenario, gait: Gait
) -> None:
    assert names(scenario, gait) == {"cpg", "start_up", "cables", "ground", "forces", "plant"}


def test_exports_what_a_user_wants_to_plot(scenario: Scenario, gait: Gait) -> None:
    diagram = MakeTensegrityDiagram(scenario, gait)
    sizes = {
        "state": 65,
        "signals": 4,
        "tensions": 24,
        "lengths": 24,
        "normal_forces": 11,
        "friction_forces": 22,
        "modes": 33,
    }
    context = diagram.CreateDefaultContext()
    assert diagram.num_output_ports() == len(sizes)
    for name, size in sizes.items():
        assert diagram.GetOutputPort(name).Eval(context).shape == (size,)


def test_the_friction_brings_no_continuous_state(scenario: Scenario, gait: Gait) -> None:
    context = MakeTensegrityDiagram(scenario, gait).CreateDefaultContext()
    assert context.num_continuous_states() == 13 * 5
    scenario.cpg.signals = "live"
    live = MakeTensegrityDiagram(scenario, gait)
    assert isinstance(live.GetSubsystemByName("cpg"), MatsuokaCpg)
    assert live.CreateDefaultContext().num_continuous_states() == 13 * 5 + 4 * 4


def test_gravity_is_the_scenarios(scenario: Scenario, gait: Gait) -> None:
    plant = MakeTensegrityDiagram(scenario, gait).GetSubsystemByName("plant")
    assert plant.gravity_field().gravity_vector().tolist() == [0.0, 0.0, -9.80665]


def test_without_a_start_up_time_cables_are_driven_at_once(scenario: Scenario, gait: Gait) -> None:
    scenario.cpg.start_up = 0.0
    diagram = MakeTensegrityDiagram(scenario, gait)
    simulator = Simulator(diagram)
    simulator.Initialize()
    assert diagram.GetOutputPort("signals").Eval(simulator.get_context()).any()


def resident_megabytes() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads memory from /proc")
def test_three_hundred_diagrams_do_not_fill_the_memory(scenario: Scenario, gait: Gait) -> None:
    """Drake before 1.56 never frees a diagram that holds a Python system with output ports."""
    if not _frees_diagrams():
        pytest.skip("this Drake leaks diagrams with Python systems; recycle processes instead")
    scenario.simulation.duration = 0.5

    def build_and_run(count: int) -> float:
        for _ in range(count):
            simulator = MakeSimulator(MakeTensegrityDiagram(scenario, gait), scenario.simulation)
            simulator.AdvanceTo(0.02)
            del simulator
        gc.collect()
        return resident_megabytes()

    settled = build_and_run(100)
    grown = build_and_run(300) - settled
    assert grown < 30.0, "a leak of one diagram each would be some 600 MB"


def _frees_diagrams() -> bool:
    from importlib.metadata import version

    major, minor = (int(part) for part in version("drake").split(".")[:2])
    return (major, minor) >= (1, 56)
