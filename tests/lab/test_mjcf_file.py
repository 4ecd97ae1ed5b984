"""MJCF files, read into structures: those that the package writes, and others."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers.anchored import TREES, scenario_of, supported_prism
from helpers.files import DATA
from pytest import approx

from tetra_drake.cli import main
from tetra_drake.engines.mjcf import make_mjcf
from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.bridges.conversion import converted
from tetra_drake.lab.bridges.formats import save_structure
from tetra_drake.lab.study.equilibrium import robot_of_file, robot_of_structure
from tetra_drake.laws.kinematics import V_WN
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.structure import moved_nodes
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.shipped import shipped_structures
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.settings.section import value_at

mujoco = pytest.importorskip("mujoco")

TEXTS = {file.stem: file.read_text("utf-8") for file in (DATA / "mjcf").glob("*.xml")}
ROWS = yaml.safe_load(Path(__file__).with_name("mjcf.yaml").read_text("utf-8"))
OTHERS = ROWS["others"]
SPRING = 'stiffness="100" springlength="0 0.6" damping="2"'


def ball(tmp_path: Path, **parts: str) -> Path:
    """File with the ball, and parts of it."""
    given = dict(option="", body="", joint="<freejoint/>", rope=SPRING, more="") | parts
    (tmp_path / "ball.xml").write_text(TEXTS["ball"].format(**given))
    return tmp_path / "ball.xml"


def left_at_rest(file: Path) -> np.ndarray:
    """Acceleration in MuJoCo at control 0 of the ball where the structure has it at rest. At rest,
    activations have reached their ends."""
    structure = robot_of_structure(converted(file), str(file)).structure
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    acts = model.actuator_actlimited.any()
    bounds = model.actuator_actrange if acts else model.actuator_ctrlrange
    data.act[:] = np.clip(0.0, *bounds.T)[: model.na]
    eye = structure.node_names.index("eye")
    data.qpos[:3] = structure.p_WB[0] + structure.p_BN[eye]
    mujoco.mj_forward(model, data)
    return data.qacc[:3]


def model_of(robot: Robot) -> Any:
    return mujoco.MjModel.from_xml_string(make_mjcf(robot))


def cables_of(model: Any) -> dict[frozenset[str], list[float]]:
    """Stiffness, damping and free length of each tendon, by its sites."""
    law = [model.tendon_stiffness, *model.tendon_stiffnesspoly.T, model.tendon_damping]
    law.append(model.tendon_lengthspring[:, 1])
    paths = np.split(model.wrap_objid, model.tendon_adr[1:])
    sites = [frozenset(model.site(site).name for site in path) for path in paths]
    return dict(zip(sites, np.transpose(law).tolist(), strict=True))


def driven_by(robot: Robot) -> dict[str, set[frozenset[str]]]:
    structure = robot.structure
    names = [frozenset(name.split()[1:]) for name in structure.cable_names]
    groups = zip(structure.oscillators, structure.groups, strict=True)
    return {oscillator: {names[cable] for cable in group} for oscillator, group in groups}


OWN = {
    "on supports": supported_prism(robot__anchor_stiffness="3e5 N/m"),
    "in motion": scenario_of(TREES["moving"]),
    "on a spring that hardens": scenario_of(TREES["hardening"]),
}
SHIPPED = [*shipped_structures(), str(DATA / "structures/hanging.yaml")]


@pytest.mark.parametrize("name", [*SHIPPED, *OWN])
def test_a_robot_is_the_same_after_a_way_to_mujoco_and_back(name: str, tmp_path: Path) -> None:
    known = {"friction.stiffness": "0 N/m", "engine": "!Mujoco"}
    robot = Robot.of(OWN[name].with_changes(known)) if name in OWN else robot_of_file(name)
    file, model = tmp_path / "robot.xml", model_of(robot)
    file.write_text(make_mjcf(robot))
    structure = converted(file)
    save_structure(structure, tmp_path / "robot.yaml", source="robot.xml")
    assert read_structure(tmp_path / "robot.yaml") == structure
    assert structure.ignored is None
    data, given = mujoco.MjData(model), structure.blueprint()
    mujoco.mj_kinematics(model, data)
    shifts = np.array([data.site(node).xpos for node in given.node_names]) - given.p_WN
    raised = [0.0, 0.0, shifts[:, 2].mean()]  # out of the soft ground
    np.testing.assert_allclose(shifts, [raised] * len(shifts), atol=1e-9)
    again = Robot.of(robot.scenario.with_sections(robot=structure), at_rest=name not in OWN)
    ours, theirs = robot.structure, again.structure
    order = [theirs.node_names.index(node.replace(" ", "_")) for node in ours.node_names]
    moved = (moved_nodes(each, each.initial_state) for each in (ours, theirs))
    v_WN, found = (nodes[:, V_WN : V_WN + 3] for nodes in moved)
    assert found[order] == approx(v_WN, abs=1e-5)
    assert (np.ptp(v_WN) > 0.5) == (name == "in motion")
    back = model_of(again)
    same = dict(rel=1e-9)
    assert back.body_mass == approx(model.body_mass, **same)
    assert back.body_inertia == approx(model.body_inertia, **same)
    assert cables_of(back) == {path: approx(law, **same) for path, law in cables_of(model).items()}
    assert driven_by(again) == driven_by(robot)
    assert len(theirs.joints) == len(ours.joints)
    has_no_ground = name in OWN
    assert has_no_ground or theirs.contact_radius.max() == approx(ours.contact_radius.max())
    assert theirs.contacts.size == ours.contacts.size
    for name in ("held", "node_load", "anchor_stiffness", "anchor_damping"):
        tables = (getattr(each.blueprint(), name) for each in (robot.scenario.robot, structure))
        assert next(tables) == approx(next(tables)[order])


def test_what_a_file_of_others_says(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(TEXTS["others"])
    structure = converted(tmp_path / "a.xml")
    tree = structure.model_dump()
    assert {key: value_at(tree, key) for key in OTHERS["values"]} == {
        key: approx(value) for key, value in OTHERS["values"].items()
    }
    told = "\n".join(structure.ignored or [])
    assert all(word in told for word in OTHERS["told"]) and "t2" not in told


@pytest.mark.parametrize("parts", ROWS["rests"])
def test_a_robot_rests_where_it_rests_in_mujoco_at_control_0(parts, tmp_path: Path) -> None:
    assert left_at_rest(ball(tmp_path, **parts)) == approx([0.0, 0.0, 0.0], abs=1e-4)


@pytest.mark.parametrize("row", ROWS["told"])
def test_what_is_left_out_is_told_and_what_is_disabled_is_nothing(row, tmp_path: Path) -> None:
    structure = converted(ball(tmp_path, **row["parts"]))
    told, tree = "\n".join(structure.ignored or []), structure.model_dump()
    assert {word: word in told for word in row["words"]} == row["words"]
    assert {key: value_at(tree, key) for key in row["values"]} == row["values"]


def lost_of(x: Any) -> np.ndarray:
    """Losses of angle (rad) in the last half swings of the pendulum, from the x of its tip."""
    angle = np.arcsin(np.abs(x) / 0.4)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(angle))) < 0) + 1
    return -np.diff(angle[turns])[-3:]


def swung(model: Any) -> np.ndarray:
    """Losses in MuJoCo, from the start, in 3 s."""
    data, x = mujoco.MjData(model), list[float]()
    while data.time < 3.0:
        mujoco.mj_step(model, data)
        x.append(data.site("tip").xpos[0])
    return lost_of(x)


def test_a_ball_joint_has_its_friction_here_and_in_mujoco(tmp_path: Path) -> None:
    file, expected = tmp_path / "a.xml", approx(2.0 * 1e-3 / (0.1 * 10.0 * 0.4), rel=0.01)
    file.write_text(TEXTS["pendulum"])
    assert swung(mujoco.MjModel.from_xml_path(str(file))) == expected
    tree = converted(file).model_dump() | {"start": {"rest": False}}
    settings = {"simulation.sample_period": "2 ms", "friction.stiffness": "0 N/m"}
    settings["engine"] = "!Compiled {tolerance: 1e-7 m/s}"
    scenario = scenario_of(tree, duration=3.0, **settings)
    found = simulate(scenario, seeded_gait(scenario), record=True).trajectory
    assert lost_of(found.p_WN.sel(node="tip", axis="x").values) == expected
    robot = Robot.of(scenario.with_changes({"engine": "!Mujoco"}))
    assert swung(model_of(robot)) == expected
    file.write_text(make_mjcf(robot))
    (joint,) = converted(file).joints.values()
    assert joint.friction == 1e-3
    file.write_text(TEXTS["pendulum"].replace("<freejoint/>", ""))
    anchored = converted(file)
    assert (anchored.joints, anchored.anchors["pin-1"]) == ({}, "xyz")
    assert any("friction" in told and "pin" in told for told in anchored.ignored)


def test_a_limited_tendon_is_a_stiff_cable(tmp_path: Path) -> None:
    limit = 'range="0.1 0.75" margin="0.02" solreflimit="0.004 1"'
    file = ball(tmp_path, rope=limit)
    robot = robot_of_structure(converted(file), str(file))
    model = mujoco.MjModel.from_xml_path(str(file))
    assert robot.structure.cables["free_length"][0] == approx(0.73)
    model.dof_damping[:3] = 5.0
    data = mujoco.MjData(model)
    while data.time < 4.0:
        mujoco.mj_step(model, data)
    eye = robot.structure.p_WB[0] + robot.structure.p_BN[robot.structure.node_names.index("eye")]
    assert eye == approx(data.site("eye").xpos, abs=1e-4)
    assert [line for line in robot.scenario.robot.ignored if "lower limits" in line]


def test_a_body_is_left_out_by_name(tmp_path: Path, refused, capsys) -> None:
    ghost = ROWS["ghost"]
    file = ball(tmp_path, more=ghost["refers"])
    text = file.read_text().replace("</worldbody>", f"{ghost['body']}</worldbody>")
    file.write_text(text.replace("</tendon>", f"{ghost['leash']}</tendon>"))
    assert "g" in converted(file).nodes
    structure = converted(file, without=["ghost", "aim"])
    assert [*structure.nodes] == ["top", "side", "eye"]
    assert "ghost, aim" in str(structure.ignored)
    for without in (["ghots"], ["ghost", "ghost"]):
        with refused(file, "without", "'ghost'"):
            converted(file, without=without)
    with refused(file, "unit", "'cm'"):
        converted(file, unit="cm")
    made = tmp_path / "a.yaml"
    assert main(["structure", str(file), "--without", "ghost", "aim", "--out", str(made)]) == 0
    assert read_structure(made).nodes == structure.nodes
    assert "a: 1 body, 3 nodes, 2 cables" in capsys.readouterr().out
    assert made.read_text().startswith("# Converted from ball.xml by tetra-drake.\nformat: 1\n")


def test_a_scenario_and_other_commands_tell_how_to_convert_a_file(tmp_path: Path, refused) -> None:
    file, scenario = ball(tmp_path), tmp_path / "my.yaml"
    scenario.write_text("base: prism\nname: my\nrobot: !Structure {file: ball.xml}\n")
    reads = (load_scenario, scenario), (read_structure, file), (robot_of_file, str(file))
    for read, name in reads:
        with refused(file, "", "tetra-drake structure"):
            read(name)


def test_without_mujoco_the_error_says_how_to_install_it(monkeypatch, tmp_path, refused) -> None:
    (tmp_path / "a.xml").write_text(TEXTS["others"])
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with refused(tmp_path / "a.xml", "", "pip install"):
        converted(tmp_path / "a.xml")


@pytest.mark.parametrize(("text", "key", "fact"), ROWS["refused"])
def test_other_files_are_refused_in_one_line(text, key, fact, tmp_path, refused) -> None:
    (tmp_path / "a.xml").write_text(text)
    os.mkfifo(tmp_path / "pipe.stl")
    with refused(tmp_path / "a.xml", key, fact):
        converted(tmp_path / "a.xml")
