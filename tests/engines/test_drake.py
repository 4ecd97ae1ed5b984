"""simulate(): against the independent simulation, with itself, and where it fails."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import Diverged, SimulationFailure, StepBudgetExceeded
from tetra_drake.robot.gait import Gait, load_gait, weight_count
from tetra_drake.robot.structure import (
    BOTTOM_LEFT,
    BOTTOM_RIGHT,
    TIP,
    MakeStructure,
    node_positions,
)
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH, POUND_FORCE
from tetra_drake.systems.diagram import MakeTensegrityDiagram


def shortly(scenario: Scenario, duration: float = 2.0, **settings: Any) -> Scenario:
    """The scenario cut short: the actuation starts at 1.25 s."""
    changes = {"duration": duration, "steady_from": 0.5 * duration, **settings}
    return scenario.with_changes({f"simulation.{key}": value for key, value in changes.items()})


@pytest.fixture
def gait(scenario: Scenario, data: Path) -> Gait:
    return load_gait(data / "gait_e.json", scenario)


def test_settles_where_the_independent_simulation_does(
    scenario: Scenario, gait: Gait, data: Path
) -> None:
    still = shortly(scenario, duration=8.0, max_step=1e-3).with_changes({"cpg.start_up": 100.0})
    structure = MakeStructure(still.robot, still.cables)
    diagram = MakeTensegrityDiagram(still, gait)
    simulator = MakeSimulator(diagram, still.simulation)
    simulator.AdvanceTo(8.0)
    context = simulator.get_context()
    p_WN = node_positions(structure, diagram.GetOutputPort("state").Eval(context))
    base = 0.5 * (p_WN[BOTTOM_LEFT::4, 0] + p_WN[BOTTOM_RIGHT::4, 0]) / INCH
    settled = json.loads((data / "expected.json").read_text())["settled"]
    np.testing.assert_allclose(np.diff(base), settled["spacing_in"], atol=0.005)
    assert p_WN[16 + TIP, 2] / INCH == pytest.approx(settled["tip5_height_in"], abs=0.005)
    normal = diagram.GetOutputPort("normal_forces").Eval(context) / POUND_FORCE
    assert normal.sum() == pytest.approx(settled["normal_sum_lbf"], rel=1e-3)
    np.testing.assert_allclose(normal, settled["normals"], atol=0.02 * normal.sum())


def test_recording_does_not_change_the_simulation(scenario: Scenario, gait: Gait) -> None:
    plain = simulate(scenario=shortly(scenario), gait=gait)
    recorded = simulate(scenario=shortly(scenario), gait=gait, record=True)
    assert recorded.metrics == plain.metrics, "bit for bit"
    assert recorded.integrator == plain.integrator
    assert plain.trajectory is None and recorded.trajectory is not None
    x1 = recorded.trajectory.p_WN.sel(tetrahedron="T1", node="bottom_left", axis="x")
    travelled = float(x1[-1] - x1[0]) / INCH
    assert travelled == recorded.metrics.distance_in, "and it records what it reports"


@pytest.mark.parametrize("mode_changes", ["step_end", "witness"])
def test_the_same_arguments_give_the_same_numbers(
    scenario: Scenario, gait: Gait, mode_changes: str
) -> None:
    short = shortly(scenario, mode_changes=mode_changes)
    assert (
        simulate(scenario=short, gait=gait).metrics == simulate(scenario=short, gait=gait).metrics
    )


def test_a_live_network_walks_as_its_recording_does(scenario: Scenario, gait: Gait) -> None:
    # A second of actuation at an accuracy of 1e-5: the live network's signals carry the
    # robot's error control, the recording's are exact, so they agree to about that accuracy.
    tight = shortly(scenario, duration=1.1, scheme="runge_kutta3", accuracy=1e-5, max_step=1e-4)
    tight = tight.with_changes({"cpg.start_up": 0.1})
    live = simulate(scenario=tight.with_changes({"cpg.signals": "live"}), gait=gait)
    recorded = simulate(scenario=tight.with_changes({"cpg.signals": "recorded"}), gait=gait)
    assert abs(recorded.metrics.distance_in) > 0.05
    assert live.metrics.distance_in == pytest.approx(recorded.metrics.distance_in, abs=2e-3)


def test_a_step_ends_at_the_start_up_jump(scenario: Scenario, gait: Gait) -> None:
    diagram = MakeTensegrityDiagram(scenario, gait)
    simulator = MakeSimulator(diagram, scenario.simulation)
    ends: list[float] = []
    simulator.set_monitor(lambda context: ends.append(context.get_time()))
    simulator.AdvanceTo(1.5)
    assert scenario.cpg.start_up in ends


def test_momentum_changes_only_by_the_grounds_forces(scenario: Scenario, gait: Gait) -> None:
    diagram = MakeTensegrityDiagram(scenario, gait)
    simulator = MakeSimulator(diagram, scenario.simulation)
    simulator.AdvanceTo(2.0)
    context = simulator.get_context()
    plant = diagram.GetSubsystemByName("plant")
    plant_context = plant.GetMyContextFromRoot(context)
    mass = plant.CalcTotalMass(plant_context)
    acceleration = diagram.EvalTimeDerivatives(context).get_generalized_velocity().CopyToVector()
    total = mass / 5 * acceleration.reshape(5, 6)[:, 3:].sum(axis=0)
    ground = np.append(
        diagram.GetOutputPort("friction_forces").Eval(context).reshape(-1, 2).sum(axis=0),
        diagram.GetOutputPort("normal_forces").Eval(context).sum() - mass * 9.80665,
    )
    np.testing.assert_allclose(total, ground, atol=1e-11)


def test_energy_is_conserved_without_damping_and_ground(scenario: Scenario, gait: Gait) -> None:
    # Free flight without gravity, cables without damping, no signals: what remains is springs and
    # inertia; the spacing is off balance, so some of the springs' energy turns kinetic.
    free = scenario.with_changes(
        {
            "robot.gravity": 0.0,
            "robot.spacing": 0.07,
            "cables.damping": 0.0,
            "ground.stiffness": 1e-12,
            "ground.damping": 0.0,
            "friction.stiction_damping": 0.0,
            "friction.proportional_stiction": 0.0,
            "simulation.scheme": "runge_kutta3",
            "simulation.accuracy": 1e-9,
            "simulation.max_step": 1e-3,
        }
    )
    structure = MakeStructure(free.robot, free.cables)
    diagram = MakeTensegrityDiagram(free, gait)
    simulator = MakeSimulator(diagram, free.simulation)
    plant = diagram.GetSubsystemByName("plant")

    def energies() -> tuple[float, float]:
        context = simulator.get_context()
        kinetic = plant.CalcKineticEnergy(plant.GetMyContextFromRoot(context))
        stretch = diagram.GetOutputPort("lengths").Eval(context) - structure.cables["free_length"]
        return kinetic, 0.5 * float(structure.cables["stiffness"] @ stretch**2)

    start = sum(energies())
    simulator.AdvanceTo(0.5)
    kinetic, elastic = energies()
    assert kinetic > 5e-4 * start, "it does move"
    assert kinetic + elastic == pytest.approx(start, abs=1e-4 * kinetic)


@pytest.mark.parametrize(
    ("settings", "kind"),
    [
        # Explicit Euler at 2 ms is far beyond its stability limit of about 0.15 ms.
        ({"scheme": "explicit_euler", "max_step": 2e-3}, Diverged),
        ({"max_evaluations": 1000}, StepBudgetExceeded),
    ],
)
def test_a_failed_simulation_says_when_and_why(
    scenario: Scenario, gait: Gait, settings: dict[str, Any], kind: type[SimulationFailure]
) -> None:
    with pytest.raises(kind) as caught:
        simulate(scenario=shortly(scenario, **settings), gait=gait)
    assert 0.0 < caught.value.time < 2.0
    assert caught.value.reason in str(caught.value)


@pytest.mark.parametrize("kind", [Diverged, StepBudgetExceeded])
def test_failures_cross_process_borders(kind: type[SimulationFailure]) -> None:
    failure = pickle.loads(pickle.dumps(kind(time=1.5, reason="why")))
    assert type(failure) is kind
    assert (failure.time, failure.reason) == (1.5, "why")


@pytest.mark.parametrize("tetrahedra", [2, 3, 8])
def test_any_number_of_tetrahedra_walks(scenario: Scenario, tetrahedra: int) -> None:
    other = shortly(scenario, duration=4.0).with_changes({"robot.tetrahedra": tetrahedra})
    weights = (0.0,) * weight_count(other.oscillators)  # so that every oscillator oscillates
    gait = Gait(name="uncoupled", weights=weights, tau_a=0.3, tau_b=0.6)
    result = simulate(scenario=other, gait=gait, record=True)
    assert result.trajectory is not None
    assert result.trajectory.sizes["tetrahedron"] == tetrahedra
    assert result.trajectory.sizes["cable"] == 6 * (tetrahedra - 1)
    # It settles until 1.25 s and walks after it; one that stands still does not move T1.
    x = result.trajectory.p_WB.sel(axis="x", tetrahedron="T1")
    settled, walking = x.sel(time=slice(0.8, 1.2)), x.sel(time=slice(2.0, None))
    assert np.ptp(walking.values) > 0.1 * INCH > 10.0 * np.ptp(settled.values)


def test_plain_drake_simulates_the_diagram_too(scenario: Scenario, gait: Gait) -> None:
    # No hidden set-up: the diagram with its default context is all a Drake user needs.
    diagram = MakeTensegrityDiagram(scenario, gait)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.05)
    height = diagram.GetOutputPort("state").Eval(simulator.get_context())[6]
    assert height == pytest.approx(scenario.robot.strut_length / 12**0.5, abs=1e-3)
