"""Models for other simulators, as these read them: masses, inertia, nodes and forces at rest."""

from __future__ import annotations

from typing import Any

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
from tetra_drake.systems import AddCables
from tetra_drake.systems.diagram import cables_of

ROBOTS = ["thesis", "motors", "rough", "prism", "six_bar", "mast", "pair"]


@pytest.fixture(params=ROBOTS)
def study(request: pytest.FixtureRequest) -> EquilibriumStudy:
    return study_equilibrium(robot_of_file(request.param))


def test_mujoco_has_the_robot_at_rest_in_its_key_frame(study):
    mujoco = pytest.importorskip("mujoco")
    robot, structure = study.robot, study.robot.structure
    text = make_mjcf(robot, rest=robot.equilibrium.state)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("rest").id)
    mujoco.mj_forward(model, data)
    assert model.body_mass[1:] == pytest.approx(structure.mass)
    assert "\n    <body name=" in text  # indented
    greatest = np.linalg.eigvalsh(unit_inertias(structure))[:, -1]
    assert model.body_inertia[1:].max(axis=1) == pytest.approx(structure.mass * greatest)
    sites = [data.site(name).xpos for name in structure.node_names]
    np.testing.assert_allclose(sites, study.nodes[["x", "y", "z"]], atol=1e-9)
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
    cables = cables_of(structure, nodes)
    network = AddCables(builder, plant, cables=cables, slack=structure.slack)
    diagram = builder.Build()
    here = network.GetMyContextFromRoot(diagram.CreateDefaultContext())
    tensions = network.GetOutputPort("tensions").Eval(here)
    np.testing.assert_allclose(tensions, study.cables["tension"], rtol=1e-6, atol=1e-9)


def renamed(tree: Any, old: str, new: str) -> Any:
    if isinstance(tree, dict):
        return {renamed(key, old, new): renamed(one, old, new) for key, one in tree.items()}
    if isinstance(tree, list):
        return [renamed(one, old, new) for one in tree]
    words = tree.split(" ") if isinstance(tree, str) else []
    return " ".join(new if word == old else word for word in words) or tree


@pytest.mark.parametrize("name", ["x--><worldbody/><!--", "a-", "floor", '<&">', "ü", "strut"])
@pytest.mark.parametrize("old", ["side", "n0"])
def test_mujoco_and_drake_read_what_is_written_with_any_name(old, name, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    tree = renamed(load_scenario("prism").robot.model_dump(), old, name)
    study = study_equilibrium(robot_of_structure(StructureFile.from_tree(tree, "a"), "a"))
    file = tmp_path / "a.xml"
    file.write_text(make_mjcf(study.robot), "utf-8")
    assert mujoco.MjModel.from_xml_path(str(file)).ntendon == 9
    assert sum(len(group.pairs) for group in converted(file).cables.values()) == 9
    plant, _ = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.0)
    text = make_sdf(study.robot.structure, study.robot.equilibrium.state, name="a")
    Parser(plant).AddModelsFromString(text, "sdf")
    assert plant.HasFrameNamed(f"node {study.robot.structure.node_names[0]}")
