"""Structure files of format 1: routed cables, joints, pinned nodes and rigid bodies."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.files import CRANE, structure_of

from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.shipped import STRUCTURES
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.scenario.yaml_text import parse_yaml

PINNED = yaml.safe_load(Path(__file__).with_name("pinned.yaml").read_text("utf-8"))


def test_the_example_has_what_its_page_says() -> None:
    blueprint = structure_of("crane").blueprint()
    names = blueprint.node_names
    assert blueprint.bodies == ("top mid", "mid-2 low", "cage")
    assert " ".join(names) == "top mid mid-2 low west east north south eye left right"
    assert blueprint.cable_names == ("guy left mid", "guy right mid", "sling left west east right")
    assert blueprint.cable_rings == {2: (names.index("west"), names.index("east"))}
    length = 20.0 + 2.0 * np.hypot(20.0, 82.0)
    assert blueprint.cable_laws[2].free_length == pytest.approx(0.01 * length - 1.0 / 500.0)
    assert blueprint.groups == ((2,),)
    pairs = [[names[node] for node in joint] for joint in blueprint.joints]
    assert blueprint.joint_keys == ("joints.knee", "joints.mid-2")
    assert pairs == [["low", "eye"], ["mid", "mid-2"]]
    # The sling and two guys of 500 N/m.
    assert blueprint.joint_stiffness.tolist() == pytest.approx([1e5, 1e3 * 3 * 500.0])
    given = structure_of("crane", "joint_stiffness: 3 kN/m").blueprint()
    assert given.joint_stiffness.tolist() == [1e5, 3e3]
    assert blueprint.joint_damping == pytest.approx(1e-3 * blueprint.joint_stiffness)
    assert blueprint.anchor_stiffness[names.index("top")] == pytest.approx([1.5e6] * 3)
    [(body, given)] = blueprint.given_inertia.items()
    assert (body, given.mass) == (2, 0.2)
    assert given.centre == pytest.approx([0.0, 0.0, 0.18])
    assert given.inertia == pytest.approx([4e-4, 4e-4, 8e-4, 0.0, 0.0, 0.0])


def test_a_written_scenario_has_joints_in_place_of_pins_and_loads_as_the_same(tmp_path) -> None:
    (tmp_path / "my.yaml").write_text(CRANE)
    text = "format: 1\nbase: prism\nobjective: {speed: 1 s/m}\nrobot: !Structure {file: my.yaml}\n"
    (tmp_path / "crane.yaml").write_text(text)
    scenario = load_scenario(tmp_path / "crane.yaml")
    assert scenario.robot == read_structure(tmp_path / "my.yaml") == structure_of("crane")
    for text in (dump_scenario(scenario), scenario.to_yaml()):
        assert text.startswith("format: 1\n")
        (tmp_path / "whole.yaml").write_text(text)
        assert load_scenario(tmp_path / "whole.yaml") == scenario
    turned = scenario.with_changes({"robot.actuated": {"lift": ["sling right east west left"]}})
    assert turned.robot.blueprint().groups == ((2,),)


@pytest.mark.parametrize(("changes", "bodies"), PINNED)
def test_pinned_nodes_part_the_bodies_that_share_nothing_else(changes, bodies) -> None:
    blueprint = structure_of("frame", changes).blueprint()
    assert [*blueprint.bodies] == bodies
    assert (blueprint.carriers[blueprint.joints] >= 0).all()
    assert len(blueprint.joints) == len(blueprint.node_names) - 5


def test_the_foot_of_a_copy_is_a_point_where_an_anchor_holds_the_node() -> None:
    blueprint = structure_of("frame", "anchors: {l: xyz}").blueprint()
    places = [blueprint.node_names.index(node) for node in ("l", "l-2", "u-2")]
    assert blueprint.contact_radius[places].tolist() == [0.0, 0.0, 0.01]


def test_a_body_may_need_no_strut_or_no_cable() -> None:
    ball = "{nodes: [b], mass: 1 kg, centre: [0, 0, 1], inertia: [1 kg*m^2, 1 kg*m^2, 2 kg*m^2]}"
    text = f"nodes: {{a: [0, 0, 0], b: [0 m, 0 m, 2 m]}}\nunit: m\nbodies: {{ball: {ball}}}\n"
    rope = "{rope: {pairs: [[a, b]], stiffness: 1 kN/m, damping: 0, free_length: 1 m}}"
    for more, names in ((f"anchors: {{a: xyz}}\ncables: {rope}", ("rope a b",)), ("", ())):
        own = text if more else text.replace("[b]", "[b, a]")
        tree = parse_yaml(own + more, "my.yaml")
        blueprint = StructureFile.from_tree(tree, "my.yaml").blueprint()
        assert (blueprint.bodies, blueprint.cable_names) == (("ball",), names)


def test_cables_within_a_rigid_body_are_left_out(tmp_path, caplog) -> None:
    cage = "{struts: [bar], mass: 0.8 kg, inertia: [8 g*m^2, 8 g*m^2, 4 g*m^2]}"
    file = tmp_path / "cage.yaml"
    shipped = (STRUCTURES / "prism.yaml").read_text().partition("actuated:")[0]
    file.write_text(f"{shipped}bodies: {{cage: {cage}}}\n")
    made = Structure.of(read_structure(file).blueprint())
    assert (made.bodies, len(made.cable_names), made.mass.tolist()) == (("cage",), 0, [0.8])
    assert made.unit_inertia[0].tolist() == pytest.approx([0.01, 0.01, 0.005, 0.0, 0.0, 0.0])
    assert "side n0 n3" in caplog.text
