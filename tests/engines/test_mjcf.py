"""Models for other simulators, as these read them: masses, inertia, nodes and forces at rest."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from helpers.structures import unit_inertias
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from tetra_drake.engines.mjcf import make_mjcf
from tetra_drake.lab.bridges.conversion import converted
from tetra_drake.lab.bridges.sdf import make_sdf
from tetra_drake.lab.study.equilibrium import (
    EquilibriumStudy,
    robot_of_file,
    robot_of_structure,
    study_equilibrium,
)
from tetra_drake.robot.structure import node_positions
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.systems import AddCables, Cable

ROBOTS = ["thesis", "motors", "rough", "prism", "six_bar", "mast", "pair", "odd names"]
NAMES = {
    "n0": "x--><b/><!--",
    "n1": "a-",
    "n2": "floor",
    "n3": "\"'",
    "n4": "strut",
    "n5": "ü",
}


@pytest.fixture(params=ROBOTS)
def study(request: pytest.FixtureRequest) -> EquilibriumStudy:
    """Robots at rest; the last is the prism with other names of nodes and groups."""
    if request.param != "odd names":
        return study_equilibrium(robot_of_file(request.param))
    text = json.dumps(load_scenario("prism").robot.model_dump())
    for old, new in (NAMES | {"side": "<&>"}).items():
        text = re.sub(rf"\b{old}\b", lambda _, new=new: json.dumps(new)[1:-1], text)
    structure = StructureFile.model_validate(json.loads(text))
    return study_equilibrium(robot_of_structure(structure, "a"))


def test_mujoco_has_the_robot_at_rest_in_its_key_frame(study, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    robot, structure = study.robot, study.robot.structure
    text = make_mjcf(robot, rest=robot.equilibrium.state)
    (tmp_path / "robot.xml").write_text(text, "utf-8")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("rest").id)
    mujoco.mj_forward(model, data)
    assert model.body_mass[1:] == pytest.approx(structure.mass)
    assert "\n    <body name=" in text  # indented
    greatest = np.linalg.eigvalsh(unit_inertias(structure))[:, -1]
    assert model.body_inertia[1:].max(axis=1) == pytest.approx(structure.mass * greatest)
    sites = [data.site(name).xpos for name in structure.node_names]
    np.testing.assert_allclose(sites, study.nodes[["x", "y", "z"]], atol=1e-9)
    groups = converted(tmp_path / "robot.xml").cables.values()
    assert sum(len(group.pairs) for group in groups) == len(structure.cables)
    stretch = data.ten_length - model.tendon_lengthspring[:, 1]
    tensions = np.maximum(model.tendon_stiffness * stretch, 0.0)
    np.testing.assert_allclose(tensions, study.cables["tension"], rtol=1e-6, atol=1e-9)
    # Forces are in balance: what is left is far below gravity.
    assert np.abs(data.qacc.reshape(-1, 6)[:, :3]).max() < 0.01 * robot.scenario.robot.gravity


def test_drake_has_the_bodies_of_the_sdf_and_its_cables_the_tensions_at_rest(study):
    structure, state = study.robot.structure, study.robot.equilibrium.state
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=0.0)
    text = make_sdf(structure, state, name=study.robot.scenario.name)
    Parser(plant).AddModelsFromString(text, "sdf")
    nodes = [plant.GetFrameByName(f"node {name}") for name in structure.node_names]
    plant.Finalize()
    feet = np.count_nonzero(structure.contact_radius[structure.contacts])
    assert plant.num_collision_geometries() == len(structure.struts) + feet
    bodies = [plant.GetBodyByName(name) for name in structure.bodies]
    assert [body.default_mass() for body in bodies] == pytest.approx(structure.mass)
    inertia = [body.default_unit_inertia().CopyToFullMatrix3() for body in bodies]
    np.testing.assert_allclose(inertia, unit_inertias(structure), atol=1e-15)
    context = plant.CreateDefaultContext()
    p_WN = [node.CalcPoseInWorld(context).translation() for node in nodes]
    np.testing.assert_allclose(p_WN, node_positions(structure, state), atol=1e-9)
    ends = zip(structure.cable_names, structure.cable_ends, structure.cable_laws, strict=True)
    cables = [Cable(name, nodes[a], nodes[b], law) for name, (a, b), law in ends]
    network = AddCables(builder, plant, cables=cables, slack=structure.slack)
    diagram = builder.Build()
    here = network.GetMyContextFromRoot(diagram.CreateDefaultContext())
    tensions = network.GetOutputPort("tensions").Eval(here)
    np.testing.assert_allclose(tensions, study.cables["tension"], rtol=1e-6, atol=1e-9)
