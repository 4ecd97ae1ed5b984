"""Robots at rest: statics, balance, frequencies, and what is printed and written of them."""

import json
import math
import re

import numpy as np
import pytest
from helpers.anchored import TREES, scenario_of
from helpers.meshcat_page import read_page

from tetra_drake.lab.study import equilibrium
from tetra_drake.lab.study.equilibrium import (
    save_structure_page,
    structure_text,
    study_equilibrium,
)
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile


def on_ground(nodes, bars, **groups):
    """A robot of thin bars on the ground of the prism."""
    bar = {"pairs": bars, "diameter": 0.004, "density": 1e4, "node_diameter": 0.0}
    tree = {"nodes": nodes, "struts": {"bar": bar}, **groups}
    structure = StructureFile.model_validate(tree)
    return Robot.of(load_scenario("prism").with_sections(robot=structure))


def test_two_bars_side_by_side_bounce_as_masses_on_springs():
    # Each lies on its two ends, which are springs of the ground; cables of almost no stiffness hold
    # them. Up and down: sqrt(2 k / m); about the middle: 2 k (l/2)^2 = w^2 m l^2 / 12, so sqrt(3)
    # times as fast for thin bars. The mass of spheres is left out.
    nodes = {f"{bar}{i}": [0.2 * i, y, 0.0] for bar, y in (("a", 0.0), ("b", 0.1)) for i in (0, 1)}
    cable = {"stiffness": 1e-6, "damping": 0.0, "free_length": 0.05}
    ties = {"tie": cable | {"pairs": [["a0", "b0"], ["a1", "b1"]]}}
    robot = on_ground(nodes, [["a0", "a1"], ["b0", "b1"]], cables=ties)
    mass, ground = math.pi * 0.002**2 * 0.2 * 1e4, robot.scenario.ground.stiffness
    slow = math.sqrt(2.0 * ground / mass) / (2.0 * math.pi)
    expected = [slow, slow, math.sqrt(3.0) * slow, math.sqrt(3.0) * slow]
    study = study_equilibrium(robot)
    # The cables let the bars slide apart; as the bars turn against each other: sqrt(3) times.
    apart = math.sqrt(2.0 * 2.0 * 1e-6 / mass) / (2.0 * math.pi)
    assert study.frequencies[:2] == pytest.approx([apart, math.sqrt(3.0) * apart], rel=2e-3)
    assert study.frequencies[2:] == pytest.approx(expected, rel=2e-3)
    first, second = study.modes[2:, [0, 2], 2], study.modes[2:, [1, 3], 2]  # ends of each bar
    assert [robot.structure.node_names[i] for i in (0, 1)] == ["a0", "a1"]
    assert first[:2] == pytest.approx(second[:2], abs=1e-3)
    assert first[2:] == pytest.approx(-second[2:], abs=1e-3)


@pytest.mark.parametrize("long", [1.0, 150.0])
def test_a_hung_load_swings_as_slowly_as_its_rope_is_long(long):
    rope = {"pairs": [["hook", "load"]], "stiffness": 1e8, "damping": 0.0, "tension": 10.0}
    nodes = {"hook": [0.0, 0.0, 10.0 + long], "load": [0.0, 0.0, 10.0]}
    hung = {"masses": {"load": 10.0}, "cables": {"rope": rope}, "anchors": {"hook": "xyz"}}
    study = study_equilibrium(Robot.of(scenario_of(hung | {"nodes": nodes})))
    swing, bounce = math.sqrt(9.80665 / long), math.sqrt(1e8 / 10.0)
    expected = np.array([swing, swing, bounce]) / (2.0 * math.pi)
    np.testing.assert_allclose(study.frequencies, expected, rtol=1e-5)


def test_one_rigid_body_without_cables_rests_and_is_shown(tmp_path):
    nodes = {"a": [0.0, 0.0, 0.0], "b": [0.3, 0.0, 0.0]}
    study = study_equilibrium(on_ground(nodes, [["a", "b"]]))
    assert study.nodes["load"].tolist() == pytest.approx([study.robot.weight / 2] * 2)
    assert (study.statics.self_stresses.shape, study.statics.mechanisms) == ((0, 0), 0)
    assert len(study.cables) == 0
    save_structure_page(study, tmp_path / "bar.html")
    assert "bar" in structure_text(study) and "bar" in (tmp_path / "bar.html").read_text()


def test_the_page_shows_the_numbers_and_swings_in_the_lowest_modes(tmp_path):
    study = study_equilibrium("prism")
    save_structure_page(study, tmp_path / "prism.html")
    page = read_page(tmp_path / "prism.html")
    text = structure_text(study)
    assert text.splitlines()[0] in page
    film = json.loads(re.findall(r"const recording = (.*);", page)[0])
    assert film["progress"]["values"][::75] == [*study.frequencies[:5], study.frequencies[4]]
    poses = film["resolution"] * np.cumsum(film["poses"], axis=1).reshape(3, 7, -1)
    for mode in range(5):
        away = poses[:, :3, 75 * mode + 9] - poses[:, :3, 0]  # nearly the farthest
        bodies = study.nodes["body"]
        middles = [study.modes[mode, bodies == name].mean(0) for name in film["bodies"]]
        ratio = np.vdot(away, middles) / np.linalg.norm(away) / np.linalg.norm(middles)
        assert ratio == pytest.approx(1.0, abs=0.01)


def test_struts_that_overlap_and_nodes_below_the_ground_are_named():
    through = {"strut_contact": "!Nothing {}", "robot.struts.bar.diameter": "60 mm"}
    thick = Robot.of(load_scenario("prism").with_changes(through))
    assert "n0 n4 | " in structure_text(study_equilibrium(thick))
    # A point that hangs 3 mm below the ground, which only `a` can touch.
    tree = TREES["hanging"] | {"contacts": ["a"]}
    lowered = {name: [x, y, z - 0.997] for name, (x, y, z) in TREES["hanging"]["nodes"].items()}
    hanging = scenario_of(tree | {"nodes": lowered}).with_sections(terrain=Flat())
    study = study_equilibrium(Robot.of(hanging))
    assert study.nodes["z"].idxmin() == "p"
    assert f"p ({hanging.units.shown(-study.nodes['z'].min(), 'm')})" in structure_text(study)


def test_a_rest_that_is_not_stable_has_no_frequencies(monkeypatch, refused):
    study, squares = study_equilibrium("prism"), np.diag([-4.0, 9.0])
    monkeypatch.setattr(equilibrium, "_vibration", lambda *_: (squares, np.eye(2), 2))
    with refused("prism", "robot", "2 1/s"):
        _ = study.frequencies
