"""Rest of anything: what falls over, hangs, swings, is slack, heavy, stiff, or held by nothing."""

import math
from collections.abc import Iterator
from operator import attrgetter
from typing import Any

import numpy as np
import pytest
from helpers import joined
from helpers.anchored import BAR, HUNG, TREES, floating_prism, scenario_of, supported_prism
from helpers.files import DATA

from tetra_drake.kernels.packed import Packed
from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.laws.cable import MEETING
from tetra_drake.laws.capsules import find_touch
from tetra_drake.laws.forces import Forces, compute_state_forces
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot import equilibrium
from tetra_drake.robot.equilibrium import (
    Unactuated,
    displaced,
    force_at_rest,
    stiffness_at_rest,
)
from tetra_drake.robot.robot import Robot, make_model
from tetra_drake.robot.structure import Structure, moved_nodes, node_positions
from tetra_drake.robot.struts import overlaps
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.structure_files import read_structure

G = 9.80665
TOUCHING = {"strut_contact": "!HuntCrossley {stiffness: 1 MN/m, dissipation: 1 s/m}"}
LOOSE = {"stiffness": 100.0, "damping": 0.0, "free_length": 0.5}


def on_ground(tree: dict[str, Any], **changes: Any) -> Robot:
    return Robot.of(scenario_of(tree, **changes).with_sections(terrain=Flat()))


def places(robot: Robot) -> dict[str, np.ndarray]:
    """Positions of the nodes at rest, in m."""
    p_WN = node_positions(robot.structure, robot.equilibrium.state)
    return dict(zip(robot.structure.node_names, p_WN, strict=True))


@pytest.mark.parametrize("lean", [0.0, 1e-9, 0.3])
def test_a_bar_that_stands_on_its_end_falls(lean):
    top = [0.2 * math.sin(lean), 0.0, 0.2 * math.cos(lean)]
    robot = on_ground({"nodes": {"a": [0.0, 0.0, 0.0], "b": top}, "struts": {"bar": BAR}})
    a, b = places(robot).values()
    depth = robot.weight / 2.0 / robot.scenario.ground.stiffness
    assert [a[2], b[2]] == pytest.approx([-depth, -depth], abs=1e-12)
    assert robot.equilibrium.feet == 2


@pytest.mark.parametrize(("gravity", "height"), [(G, 0.0), (0.0, 0.3)])
def test_bodies_stay_where_they_are_if_their_cable_is_slack(gravity, height):
    """On the ground, but for how far they sink, and without weight."""
    nodes = {"a": [0.0, 0.0, height], "b": [0.2, 0.0, height]}
    nodes |= {"c": [0.0, 0.1, 2.0 * height], "d": [0.2, 0.1, 0.0]}
    struts = {"bar": BAR | {"pairs": [["a", "b"], ["c", "d"]]}}
    cables = {"tie": LOOSE | {"pairs": [["a", "c"]]}}
    robot = on_ground({"nodes": nodes, "struts": struts, "cables": cables, "gravity": gravity})
    depth = robot.weight / 4.0 / robot.scenario.ground.stiffness
    for node, place in places(robot).items():
        assert place == pytest.approx(nodes[node] - np.array([0.0, 0.0, depth]), abs=1e-9)
    assert study_equilibrium(robot).cables["tension"].tolist() == [0.0]


@pytest.mark.parametrize("stiffness", [1e3, 1e6, 1e9])
def test_a_pendulum_swings_down_however_stiff_its_cable(stiffness, monkeypatch):
    # From level; uncorrected straight steps would number (stiffness * length / weight)^(1/3).
    monkeypatch.setattr(equilibrium, "MOST_STEPS", 60)
    line = HUNG["cables"]["line"] | {"stiffness": stiffness}
    aside = {"top": [0.0, 0.0, 1.0], "a": [0.4, 0.0, 1.0], "b": [0.6, 0.0, 1.0]}
    robot = Robot.of(scenario_of(HUNG | {"nodes": aside, "cables": {"line": line}}))
    below = [0.0, 0.0, 0.6 - robot.weight / stiffness]
    assert places(robot)["a"] == pytest.approx(below, abs=1e-8)
    tension = study_equilibrium(robot).cables["tension"].to_numpy()
    assert tension == pytest.approx([robot.weight], rel=1e-6)


def scaled(mass: float, stiffness: float, **changes: Any) -> Robot:
    """The shipped prism with other mass and stiffness, as factors."""
    tree = read_structure("prism").model_dump()
    tree["struts"]["bar"]["density"] *= mass
    for cable in tree["cables"].values():
        cable["stiffness"] *= stiffness
    robot = on_ground(tree, **changes)
    ground = {"ground.stiffness": stiffness * robot.scenario.ground.stiffness}
    return Robot.of(robot.scenario.with_numbers(ground))


@pytest.mark.parametrize(("mass", "stiffness"), [(1e3, 1.0), (1e5, 1.0), (1.0, 1e6), (1e-6, 1.0)])
def test_heavy_and_light_structures_rest(mass, stiffness):
    robot = scaled(mass, stiffness)
    p_WN = np.array(list(places(robot).values()))
    # Rounding of the farthest coordinate (2e-16), times the stiffness of all springs of a body.
    hardest = max(robot.scenario.ground.stiffness, 100.0 * stiffness)
    rounding = 2e-14 * hardest * np.abs(p_WN).max()
    left = force_at_rest(Unactuated(robot.model), robot.equilibrium.state)
    assert np.abs(left).max() < rounding
    load = robot.scenario.ground.stiffness * np.maximum(0.0, -p_WN[:, 2]).sum()
    assert load == pytest.approx(robot.weight, rel=1e-9, abs=3.0 * rounding)


def test_a_heavy_structure_rests_on_its_own_struts():
    # Its cables cannot hold it, so it lies on the ground, with bars on each other.
    robot = scaled(10.0, 0.1, **TOUCHING)
    heights = np.array([place[2] for place in places(robot).values()])
    load = robot.scenario.ground.stiffness * np.maximum(0.0, -heights).sum()
    assert load == pytest.approx(robot.weight, rel=1e-5)
    memory, pushes = Forces.of(robot.model), np.empty(18)
    compute_state_forces(Packed((robot.model, memory)), robot.structure.initial_state, pushes)
    assert pushes.any() and np.ptp(heights) < 0.1


def changes(resting: Unactuated, state: np.ndarray, size: float) -> Iterator[list[np.ndarray]]:
    """Small motions, how the forces change in them, and how they would by the stiffness."""
    rng = np.random.default_rng(0)
    for _ in range(5):
        motion = size * rng.normal(size=len(state) // 13 * 6)
        ahead = force_at_rest(resting, displaced(resting, state, motion))
        behind = force_at_rest(resting, displaced(resting, state, -motion))
        force_at_rest(resting, state)
        yield [motion, 0.5 * (behind - ahead), stiffness_at_rest(resting) @ motion]


RESTING = [load_scenario("mast"), supported_prism(), floating_prism(), scenario_of(HUNG)]
RESTING += [joined.with_arm(), scenario_of(joined.RHOMBUS)]


@pytest.mark.parametrize("scenario", RESTING, ids=attrgetter("name"))
def test_stiffness_is_how_forces_change(scenario):
    robot = Robot.of(scenario)
    for _, found, expected in changes(Unactuated(robot.model), robot.equilibrium.state, 1e-6):
        assert found == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("scenario", [floating_prism(), joined.with_arm()], ids=attrgetter("name"))
def test_stiffness_is_how_forces_change_where_the_ends_of_a_piece_meet(scenario):
    robot = Robot.of(scenario)
    structure, state = robot.structure, robot.equilibrium.state.copy()
    a, b = structure.segments.ends[-1]  # of the arm, a piece of a path
    moved, p_WN = structure.carriers[b], node_positions(structure, state)
    place = 7 * moved + 4
    state[place : place + 3] += p_WN[a] - p_WN[b] + 0.3 * MEETING
    for motion, found, expected in changes(Unactuated(robot.model), state, 1e-9):
        assert found @ motion == pytest.approx(expected @ motion, rel=1e-6)


TOUCHES = [([0.01, -0.1, 0.106], [0.02, 0.1, 0.107], True)]  # the second lies across the first
TOUCHES += [([0.01, 0.003, 0.104], [0.05, 0.1, 0.13], True)]  # it ends there
TOUCHES += [([0.103, 0.003, 0.104], [0.2, 0.1, 0.13], True)]  # both do
TOUCHES += [([0.0, -0.1, 0.1], [0.0, 0.1, 0.1], False)]  # their axes meet


@pytest.mark.parametrize(("c", "d", "pushed"), TOUCHES)
def test_stiffness_is_how_forces_change_where_struts_touch(c, d, pushed):
    tree = TREES["two_bars"]
    tree = tree | {"nodes": tree["nodes"] | {"c": c, "d": d}}
    scenario = scenario_of(tree, **TOUCHING)
    structure = Structure.of(scenario.robot.blueprint())
    resting, state = Unactuated(make_model(scenario, structure)), structure.initial_state
    assert (np.abs(force_at_rest(resting, state)).max() > 500.0) == pushed
    greatest = abs(stiffness_at_rest(resting)).max()
    assert np.isfinite(greatest)
    for motion, found, expected in changes(resting, state, 1e-7) if pushed else []:
        # The smoothing for parallel struts, 1e-4 of the squares of both lengths, is approximate.
        error = 1e-4 * greatest * (motion @ motion)
        assert found @ motion == pytest.approx(expected @ motion, abs=error)


CROSSED = DATA / "structures/crossed.yaml"


def test_a_structure_file_may_have_struts_that_overlap():
    robot = study_equilibrium(CROSSED).robot
    nodes = moved_nodes(robot.structure, robot.equilibrium.state)
    pressed = robot.weight / robot.scenario.strut_contact.stiffness
    assert find_touch(robot.model.struts, nodes, 0, 1).depth < pressed


def test_struts_of_a_structure_file_whose_axes_meet_pass_through_each_other(tmp_path):
    file = tmp_path / "crossed.yaml"
    file.write_text(CROSSED.read_text().replace("0.005", "1e-16"))
    robot = study_equilibrium(file).robot
    assert not robot.model.strut_contact.acts
    assert list(overlaps(robot.scenario, robot.structure, robot.equilibrium.state)) == [
        ("a b", "c d")
    ]
