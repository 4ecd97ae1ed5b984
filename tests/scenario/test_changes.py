"""Scenarios made from others: changed values, balanced spacing."""

import numpy as np
import pytest

from tetra_drake.laws.friction import Coulomb
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import QualityDiversity
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.yaml_text import parse_yaml
from tetra_drake.settings.section import value_at


def test_changes_are_checked_converted_and_made_in_a_copy(scenario):
    changes = {"robot.cables.outer_stiffness": "45 N/m", "robot.tetrahedra": 7}
    changed = scenario.with_changes(changes)
    assert (changed.robot.cables.outer_stiffness, changed.oscillators) == (45.0, 6)
    assert scenario == load_scenario()
    assert scenario.with_changes({}) == scenario


STIFF = "cables: {outer_stiffness: 0.4 lbf/in}"


def axial_force(scenario: Scenario) -> float:
    """Axial force of the cables between two tetrahedra at the start, as a share of the force of the
    outer ones."""
    structure = Robot.of(scenario).structure
    p_WN = structure.p_WB[structure.carriers] + structure.p_BN
    cables = structure.cables[:6]
    spans = p_WN[cables["node_b"]] - p_WN[cables["node_a"]]
    lengths = np.linalg.norm(spans, axis=1)
    forces = cables["stiffness"] * (1 - cables["free_length"] / lengths) * spans[:, 0]
    return float(forces.sum() / forces[:3].sum())


BALANCED = {"tetrahedra: 7, density: 5 g/cm^3": False, f"{STIFF}, spacing: 2.5 in": False}
BALANCED |= {STIFF: True, "strut_length: 8 in": True}


@pytest.mark.parametrize(("text", "balanced"), BALANCED.items())
def test_what_a_file_changes_decides_on_the_spacing(load_text, text, balanced):
    # A robot that balances otherwise is balanced anew; the thesis rounds its own 2.9436 in to
    # 2.94 in.
    assert (abs(axial_force(load_text(f"robot: {{{text}}}"))) < 1e-9) == balanced


def test_a_key_with_an_index_changes_an_item_of_a_list(refused):
    prism = load_scenario("prism")
    loaded = prism.with_changes({"robot.loads.n3": ["1 N", "0 N", "-6 N"]})
    changed = loaded.with_changes({"robot.loads.n3[2]": "-8 N"})
    assert changed.robot.loads["n3"] == [1.0, 0.0, -8.0]
    assert loaded.robot.loads == {"n3": [1.0, 0.0, -6.0]}
    with refused("changes", "robot.loads.n3[3]", "list of 3"):
        loaded.with_changes({"robot.loads.n3[3]": "1 N"})
    with refused("scenario prism", "robot.loads.n3"):
        prism.with_changes({"robot.loads.n3[2]": "1 N"})
    with refused("scenario prism", "robot.loads.n3[1]", "twice"):
        loaded.with_changes({"robot.loads.n3": ["1 N"] * 3, "robot.loads.n3[1]": "1 N"})


def test_a_mapping_changes_what_it_names_as_in_a_file(load_text, scenario):
    changed = scenario.with_changes({"simulation": {"duration": "9 s"}, "name": "mine"})
    assert changed == load_text("name: mine\nsimulation: {duration: 9 s}")
    stiff = {"robot.cables.outer_stiffness": "0.4 lbf/in"}
    balanced = load_text(f"robot: {{{STIFF}}}").robot
    assert scenario.with_changes(stiff).robot == balanced != scenario.robot


def test_a_kind_replaces_the_base_with_its_tag_and_changes_keys_without(scenario, load_text):
    coulomb = load_scenario("coulomb")
    whole = coulomb.with_changes({"friction": "!Coulomb {static: 0.6}", "engine": "!Compiled"})
    assert (whole.friction, whole.engine) == (Coulomb(static=0.6), Compiled())
    assert load_text("friction: !Coulomb\nterrain:").friction == Coulomb()
    changed = coulomb.with_changes({"friction": {"static": 0.6}})
    assert changed.friction == Coulomb(static=0.6, stiffness=300.0)
    assert coulomb.on_engine("compiled") == coulomb.on_engine(None) == coulomb
    assert coulomb.on_engine("drake").engine == scenario.engine


def test_a_key_with_nothing_is_an_empty_mapping_which_changes_nothing(load_text, refused):
    robust = load_scenario("robust")
    sections = [key for key, value in robust.model_dump().items() if isinstance(value, dict)]
    for key in {*sections} - {"objective", "disturbances"}:
        assert robust.with_changes({key: None}) == robust
    assert load_text("friction:\nrobot: {cables: }") == load_scenario()
    assert robust.with_changes({"disturbances": None}).disturbances is None
    with refused("scenario robust", "objective", "at least 1 item"):
        robust.with_changes({"objective": None})


GUYED = """
base: prism
name: guyed
robot: !Structure
  file: prism
  nodes: {mast: [0 m, 0 m, 0.5 m]}
  cables:
    guy: {pairs: [[mast, n3], [mast, n4]], stiffness: 50 N/m, damping: 1 N*s/m, free_length: 0.2 m}
  anchors: {mast: xyz, n0: xyz}
  masses: {n3: 20 g, n4: 30 g}
  loads: {n4: [0 N, 0 N, -0.3 N]}
disturbances: {draws: 2, spreads: {robot.cables.guy.stiffness: 0.1, ground.stiffness: 0.1}}
"""

DRIVEN = {"side_2": "n1 n4", "side_3": "n2 n5", "bottom_2": "n1 n2", "bottom_3": "n2 n0"}
REMOVED = {
    "robot: {anchors: {n0: null}}": ("robot.anchors", {"mast": "xyz"}),
    "robot: {masses: {n3: }}": ("robot.masses", {"n4": 0.03}),
    "robot: {loads: {n4: null}}": ("robot.loads", {}),
    "disturbances: {spreads: {robot.cables.guy.stiffness: null}}": (
        "disturbances.spreads",
        {"ground.stiffness": 0.1},
    ),
    "objective: {speed: null, distance: 2 /m}": ("objective", {"distance": 2.0}),
    "robot: {actuated: {side_1: null, bottom_1: null}}": (
        "robot.actuated",
        {name: [f"{name[:-2]} {ends}"] for name, ends in DRIVEN.items()},
    ),
}


@pytest.mark.parametrize("text", REMOVED)
def test_an_empty_key_removes_a_name_of_any_map_of_the_base(text, tmp_path):
    key, left = REMOVED[text]
    (tmp_path / "guyed.yaml").write_text(GUYED)
    (tmp_path / "mine.yaml").write_text(f"base: guyed.yaml\n{text}\n")
    found = load_scenario(tmp_path / "mine.yaml")
    assert value_at(found.model_dump(), key) == left
    changes = parse_yaml(text, "changes")
    assert load_scenario(tmp_path / "guyed.yaml").with_changes(changes) == found


def test_a_group_and_what_names_it_are_removed_together(tmp_path):
    (tmp_path / "guyed.yaml").write_text(GUYED)
    guyed = load_scenario(tmp_path / "guyed.yaml")
    spreads = {"robot.cables.guy.stiffness": None}
    changes = {
        "robot": {"cables": {"guy": None}, "nodes": {"mast": None}, "anchors": {"mast": None}}
    }
    free = guyed.with_changes(changes | {"disturbances": {"spreads": spreads}})
    assert [*free.robot.cables] == ["bottom", "top", "side"]
    assert "mast" not in free.robot.nodes and [*free.robot.anchors] == ["n0"]
    # The same in a file that names the structure's file, where the base is that file.
    text = "base: prism\nrobot: !Structure {file: prism, actuated: {side_1: null}}\n"
    (tmp_path / "prism.yaml").write_text(text)
    assert next(iter(load_scenario(tmp_path / "prism.yaml").robot.actuated)) == "side_2"


NOT_REMOVED = {"robot: {cables: {guys: null}}": "robot.cables.guys"}
NOT_REMOVED |= {"robot: {masses: {n5: null}}": "robot.masses.n5"}
NOT_REMOVED |= {
    "disturbances: {spreads: {ground.stiff: null}}": "disturbances.spreads.ground.stiff"
}
NOT_REMOVED |= {"ground: {stiffness: null}": "ground.stiffness", "name: null": "name"}
NOT_REMOVED |= {"robot: {cables: {guy: {stiffness: null}}}": "robot.cables.guy.stiffness"}
NOT_REMOVED |= {"objective: {lead: null}": "objective.lead"}
NOT_REMOVED |= {"ground: {stiffness: {soft: null}}": "ground.stiffness"}


@pytest.mark.parametrize("text", NOT_REMOVED)
def test_what_is_no_name_of_the_base_s_maps_is_not_removed(text, tmp_path, refused):
    (tmp_path / "guyed.yaml").write_text(GUYED)
    (tmp_path / "mine.yaml").write_text(f"base: guyed.yaml\n{text}\n")
    with refused(str(tmp_path / "mine.yaml"), NOT_REMOVED[text]):
        load_scenario(tmp_path / "mine.yaml")


def test_a_mapping_of_free_keys_is_replaced_as_a_whole(scenario):
    assert scenario.with_changes({"objective": {"speed": "3 s/m"}}).objective == {"speed": 3.0}
    added = scenario.with_changes({"objective.speed": "3 s/m"}).objective
    assert added == scenario.objective | {"speed": 3.0}, "a key with a dot is added"


def test_a_section_from_python_replaces_the_base_as_a_whole_and_is_checked(scenario, refused):
    mapped = scenario.with_changes({"optimizer": QualityDiversity(draws=3)})
    twist = QualityDiversity(measures={"twist": [0.0, 0.1], "lifted": [0.0, 1.0]})
    assert mapped.with_changes({"optimizer": twist}).optimizer == twist
    robot = scenario.robot.model_copy(update={"strut_length": 0.2, "spacing": 0.05})
    assert scenario.with_changes({"robot": robot}).robot == robot, "which keeps its spacing"
    bad = scenario.ground.model_copy(update={"stiffness": -1.0})
    with refused("scenario thesis", "ground.stiffness", "found -1 N/m, expected greater than 0"):
        scenario.with_changes({"ground": bad})
