"""simulate(): against the independent simulation, with itself, and where it fails."""

from __future__ import annotations

import dataclasses
import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from tetra_drake.engines.drake import MakeSimulator
from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import Diverged, StepBudgetExceeded
from tetra_drake.robot.gait import Gait, load_gait
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


def with_settings(scenario: Scenario, **settings: Any) -> Scenario:
    """The scenario with other simulation settings."""
    return dataclasses.replace(
        scenario, simulation=dataclasses.replace(scenario.simulation, **settings)
    )


def with_signals(scenario: Scenario, signals: str) -> Scenario:
    return dataclasses.replace(scenario, cpg=dataclasses.replace(scenario.cpg, signals=signals))


def shortly(scenario: Scenario, duration: float = 2.0, **settings: Any) -> Scenario:
    """The scenario cut short: the actuation starts at 1.25 s."""
    return with_settings(scenario, duration=duration, steady_from=0.5 * duration, **settings)


@pytest.fixture
def gait(data: Path) -> Gait:
    return load_gait(data / "gait_e.json", oscillators=4)


@pytest.fixture
def expected(data: Path) -> dict[str, Any]:
    return json.loads((data / "expected.json").read_text())


WELL_CONDITIONED = [f"gait_{letter}" for letter in "bcdefgh"]


def distance_error(scenario: Scenario, data: Path, expected: dict[str, Any], name: str) -> float:
    gait = load_gait(data / f"{name}.json", oscillators=4)
    result = simulate(scenario=scenario, gait=gait)
    return result.metrics.distance_in - expected["gaits"][name]["distance_in"]


def test_default_settings_agree_with_the_independent_simulation(
    scenario: Scenario, data: Path, expected: dict[str, Any]
) -> None:
    errors = [abs(distance_error(scenario, data, expected, name)) for name in WELL_CONDITIONED]
    print(dict(zip(WELL_CONDITIONED, np.round(errors, 3), strict=True)))
    assert np.median(errors) < 0.1
    assert max(errors) < 0.25


@pytest.mark.slow
@pytest.mark.parametrize("name", WELL_CONDITIONED)
def test_tight_settings_agree_with_the_independent_simulation(
    scenario: Scenario, data: Path, expected: dict[str, Any], name: str
) -> None:
    tight = with_settings(scenario, scheme="runge_kutta3", accuracy=1e-3)
    assert abs(distance_error(tight, data, expected, name)) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("name", WELL_CONDITIONED)
def test_witness_placement_agrees_with_the_independent_simulation(
    scenario: Scenario, data: Path, expected: dict[str, Any], name: str
) -> None:
    exact = with_settings(scenario, mode_changes="witness", accuracy=1e-3)
    assert abs(distance_error(exact, data, expected, name)) < 0.1


def test_settles_where_the_independent_simulation_does(
    scenario: Scenario, gait: Gait, expected: dict[str, Any]
) -> None:
    still = dataclasses.replace(
        shortly(scenario, duration=8.0), cpg=dataclasses.replace(scenario.cpg, start_up=100.0)
    )
    structure = MakeStructure(still.robot, still.cables)
    diagram = MakeTensegrityDiagram(still, gait)
    simulator = MakeSimulator(diagram, with_settings(still, max_step=1e-3).simulation)
    simulator.AdvanceTo(8.0)
    context = simulator.get_context()
    p_WN = node_positions(structure, diagram.GetOutputPort("state").Eval(context))
    base = 0.5 * (p_WN[BOTTOM_LEFT::4, 0] + p_WN[BOTTOM_RIGHT::4, 0]) / INCH
    settled = expected["settled"]
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
    # One second of actuation at an accuracy of 1e-5: the live network's signals carry the
    # robot's error control, the recording's are exact, so they agree to about that accuracy.
    tight = shortly(scenario, duration=2.25, scheme="runge_kutta3", accuracy=1e-5, max_step=1e-4)
    live = simulate(scenario=with_signals(tight, "live"), gait=gait)
    recorded = simulate(scenario=with_signals(tight, "recorded"), gait=gait)
    assert abs(recorded.metrics.distance_in) > 0.05
    assert live.metrics.distance_in == pytest.approx(recorded.metrics.distance_in, abs=2e-3)


def test_the_robot_goes_straight_by_its_symmetry(scenario: Scenario, gait: Gait) -> None:
    metrics = simulate(scenario=scenario, gait=gait).metrics
    assert metrics.heading_error_in < 1e-3
    assert metrics.lateral_drift_in < 1e-3


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
    free = dataclasses.replace(
        scenario,
        robot=dataclasses.replace(scenario.robot, gravity=0.0, spacing=0.07),
        cables=dataclasses.replace(scenario.cables, damping=0.0),
        ground=dataclasses.replace(scenario.ground, stiffness=1e-12, damping=0.0),
        friction=dataclasses.replace(
            scenario.friction, stiction_damping=0.0, proportional_stiction=0.0
        ),
    )
    structure = MakeStructure(free.robot, free.cables)
    diagram = MakeTensegrityDiagram(free, gait)
    tight = with_settings(free, scheme="runge_kutta3", accuracy=1e-9, max_step=1e-3)
    simulator = MakeSimulator(diagram, tight.simulation)
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


def test_a_diverging_simulation_says_when_and_why(scenario: Scenario, gait: Gait) -> None:
    # Explicit Euler at 2 ms is far beyond its stability limit of about 0.15 ms.
    unstable = shortly(scenario, scheme="explicit_euler", max_step=2e-3)
    with pytest.raises(Diverged, match=r"failed at t = 0\.\d+ s: .*(velocity|NaN|nan)") as caught:
        simulate(scenario=unstable, gait=gait)
    assert 0.0 < caught.value.time < 2.0


def test_a_step_budget_ends_the_simulation(scenario: Scenario, gait: Gait) -> None:
    with pytest.raises(StepBudgetExceeded, match="1000") as caught:
        simulate(scenario=shortly(scenario, max_evaluations=1000), gait=gait)
    assert 0.0 < caught.value.time < 2.0


@pytest.mark.parametrize("kind", [Diverged, StepBudgetExceeded])
def test_failures_cross_process_borders(kind: type[Diverged]) -> None:
    failure = pickle.loads(pickle.dumps(kind(time=1.5, reason="why")))
    assert type(failure) is kind
    assert (failure.time, failure.reason) == (1.5, "why")


@pytest.mark.parametrize("tetrahedra", [2, 3, 8])
def test_any_number_of_tetrahedra_walks(scenario: Scenario, tetrahedra: int) -> None:
    other = shortly(
        dataclasses.replace(
            scenario, robot=dataclasses.replace(scenario.robot, tetrahedra=tetrahedra)
        )
    )
    oscillators = tetrahedra - 1
    weights = tuple(np.linspace(1.0, 3.4, 2 * oscillators * (oscillators - 1)))
    gait = Gait(name="any", weights=weights, tau_a=0.3, tau_b=0.6)
    result = simulate(scenario=other, gait=gait, record=True)
    assert result.trajectory is not None
    assert result.trajectory.sizes["tetrahedron"] == tetrahedra
    assert result.trajectory.sizes["cable"] == 6 * (tetrahedra - 1)
    assert abs(result.metrics.distance_in) < 5.0


def test_plain_drake_simulates_the_diagram_too(scenario: Scenario, gait: Gait) -> None:
    # No hidden set-up: the diagram with its default context is all a Drake user needs.
    diagram = MakeTensegrityDiagram(scenario, gait)
    simulator = Simulator(diagram)
    simulator.AdvanceTo(0.05)
    height = diagram.GetOutputPort("state").Eval(simulator.get_context())[6]
    assert height == pytest.approx(scenario.robot.strut_length / 12**0.5, abs=1e-3)
