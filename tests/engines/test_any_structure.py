"""What the row of tetrahedra senses, stands and tells, any structure does: shipped ones."""

import json

import numpy as np
import pytest

from tetra_drake.engines.mujoco import installed
from tetra_drake.engines.simulate import check_scenario, simulate, simulate_many
from tetra_drake.experiment import evolve
from tetra_drake.physics.feedback import sense
from tetra_drake.results.result import save_result
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.metrics import METRICS
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario

STRUCTURES = ("prism", "six_bar", "mast", "pair")


def sensing(name: str) -> Robot:
    live = {"cpg.signals": "live", "cpg.feedback": ["length", "load"]}
    return Robot.of(load_scenario(name).with_changes(live))


def felt(robot: Robot, *, gains: list[float], longer: float, pushes: np.ndarray) -> np.ndarray:
    """(oscillators, 2): the feedback to extensor and flexor of a robot in its pose of rest, whose
    cables are longer by a factor, and whose contacts bear some forces in N."""
    structure, state = robot.structure, robot.structure.initial_state
    p_WN = node_positions(structure, state)
    along = p_WN[structure.cables["node_a"]] - p_WN[structure.cables["node_b"]]
    lengths, feedback = longer * np.linalg.norm(along, axis=1), np.empty(2 * structure.signals)
    sense(robot.senses, np.array(gains), state, lengths, pushes, feedback)
    return feedback.reshape(-1, 2)


@pytest.mark.parametrize("name", STRUCTURES)
def test_oscillators_pull_harder_where_cables_are_longer_than_at_rest(name):
    robot = sensing(name)
    pushes = np.zeros(len(robot.structure.contacts))
    length = [0.5, 0.0, 0.0]
    at_rest = felt(robot, gains=length, longer=1.0, pushes=pushes)
    np.testing.assert_allclose(at_rest, 0.0, atol=1e-6)
    # 10 % longer, times the gain: 0.05 on the extensor, however many cables a group has.
    stretched = felt(robot, gains=length, longer=1.1, pushes=pushes)
    expected = np.tile([0.05, -0.05], (robot.structure.signals, 1))
    np.testing.assert_allclose(stretched, expected, atol=1e-6)


def test_oscillators_of_a_prism_feel_that_each_bar_bears_a_third_of_the_weight():
    robot = sensing("prism")
    heights = node_positions(robot.structure, robot.structure.initial_state)[:, 2]
    feet = heights[robot.structure.contacts] < 0.01
    assert feet.sum() == 3
    loads = felt(robot, gains=[0.0, 0.6, 0.0], longer=1.0, pushes=robot.weight / 3.0 * feet)
    np.testing.assert_allclose(loads, 0.6 / 3.0)


def briefly(name: str) -> Scenario:
    times = {"simulation.duration": "1 s", "simulation.steady_from": "0.4 s"}
    return load_scenario(name).with_changes({"cpg.start_up": "0.2 s", **times})


def test_draws_of_several_structures_walk_side_by_side_as_each_alone():
    walks = []
    for name in ("mast", "pair"):  # which need no more kernels than the row
        scenario = briefly(name)
        groups = scenario.robot.cables
        spreads = {f"robot.cables.{group}.stiffness": 0.2 for group in groups}
        disturbances = {"draws": 1, "start": 0.05, "spreads": spreads}
        scenario = scenario.with_changes({"disturbances": disturbances})
        gait = seeded_gait(scenario, 3)
        walks += [(disturbed(scenario, draw), gait) for draw in fresh_draws(scenario, 1, 3)]
    scenarios, gaits = [list(column) for column in zip(*walks, strict=True)]
    together = simulate_many(scenario=scenarios, gaits=gaits, workers=1)
    for scenario, gait, result in zip(scenarios, gaits, together, strict=True):
        alone = simulate(scenario=scenario, gait=gait)
        assert repr(result.metrics) == repr(alone.metrics)  # NaN, too
    assert len({result.metrics.distance for result in together}) == 6


def test_a_structure_walks_as_far_as_its_centre_of_mass():
    heavy = briefly("prism").with_changes({"robot.masses": {"n4": "50 g"}})
    result = simulate(scenario=heavy, gait=seeded_gait(heavy, 3), record=True)
    way = result.trajectory.p_WB[-1] - result.trajectory.p_WB[0]
    mass = Robot.of(heavy).structure.mass
    x, y, _ = mass @ way.values / mass.sum()
    assert mass.max() > 2.0 * mass.min()
    assert result.metrics.distance == pytest.approx(x, abs=1e-9)
    assert result.metrics.lateral_drift == pytest.approx(abs(y), abs=1e-9)
    assert abs(float(way.mean("body")[0]) - x) > 1e-4, "the mean of the bodies goes another way"


# A pyramid of six struts, one rigid body.
BODY = {
    "nodes": {"a": [0, 0, 0], "b": ["0.1 m", 0, 0], "c": [0, "0.1 m", 0], "d": [0, 0, "0.1 m"]},
    "struts": {
        "edge": {
            "pairs": [["a", "b"], ["a", "c"], ["a", "d"], ["b", "c"], ["b", "d"], ["c", "d"]],
            "diameter": "8 mm",
            "density": "1.2 g/cm^3",
            "node_diameter": "10 mm",
        }
    },
    "offsets": [["0 m", "0 m", "2 cm"]],
}


def undriven(name: str) -> Scenario:
    """A pair whose cables nothing drives, or a body without cables, 2 cm above the ground."""
    if name == "pair":
        return briefly("pair").with_changes({"robot.actuated": {}})
    prism = briefly("prism")
    return prism.with_sections(name="body", robot=StructureFile.from_tree(BODY, "body"))


@pytest.mark.parametrize("name", ["pair", "body"])
@pytest.mark.parametrize("signals", ["listing", "live"])
def test_a_robot_that_nothing_drives_falls_and_rests(name, signals):
    scenario = undriven(name).with_changes({"cpg.signals": signals})
    gait = seeded_gait(scenario)
    result = simulate(scenario, gait, record=True)
    robot, trajectory = Robot.of(scenario), result.trajectory
    heights = node_positions(robot.structure, robot.equilibrium.state)[:, 2]
    np.testing.assert_allclose(trajectory.p_WN[-1, :, 2], heights, atol=1e-5)
    load = trajectory.normal_force[-1].sum()
    assert float(load) == pytest.approx(robot.weight, rel=1e-3)
    assert result.metrics.actuator_work == result.metrics.signal_rate == 0.0
    for outcome in simulate_many(scenario, [gait, gait]):
        assert repr(outcome.metrics) == repr(result.metrics)
    diagram = simulate(scenario.with_changes({"engine": "!Drake"}), gait, record=True)
    np.testing.assert_allclose(diagram.trajectory.p_WN, trajectory.p_WN, atol=1e-4)
    if installed() and signals == "listing":
        changes = {"engine": "!Mujoco", "friction.stiffness": "0 N/m"}
        fallen = simulate(scenario.with_changes(changes), gait, record=True).trajectory
        np.testing.assert_allclose(fallen.p_WN[-1, :, 2], heights, atol=1e-5)


@pytest.mark.parametrize("name", ["pair", "body"])
def test_a_robot_that_nothing_drives_has_no_gaits_to_search(name, refused, tmp_path):
    scenario = undriven(name)
    with refused(scenario.name, "robot.actuated", "oscillator"):
        check_scenario(scenario)
    with refused(scenario.name, "robot.actuated", "oscillator"):
        evolve(scenario, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_what_a_structure_lacks_is_null_in_its_result(tmp_path):
    scenario = briefly("prism")
    gait = seeded_gait(scenario, 3)
    save_result(tmp_path / "result.json", simulate(scenario, gait))
    saved = json.loads((tmp_path / "result.json").read_text())
    lacking = {name for name, value in saved["metrics"].items() if value is None}
    assert lacking == {name for name, one in METRICS.items() if one.needs in scenario.lacking}
    assert lacking == {"twist", "lead", "heading_change", "actuator_limited"}
    assert saved["twist_in"] is None
    assert set(saved["path"]["heading_rad"]) == {None}
