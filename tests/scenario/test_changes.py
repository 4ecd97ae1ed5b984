"""Scenarios made from others: changed values, balanced spacing."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.files import DATA

from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import QualityDiversity
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.yaml_text import dump_yaml, parse_yaml
from tetra_drake.settings.section import value_at

ROWS = yaml.safe_load(Path(__file__).with_name("changed.yaml").read_text("utf-8"))
BASES = {"guyed": str(DATA / "scenarios/guyed.yaml")}


@pytest.mark.parametrize(
    ("base", "text", "values"), [(base, *row) for base, rows in ROWS.items() for row in rows]
)
def test_a_file_and_python_change_a_base_alike(base, text, values, tmp_path):
    base = BASES.get(base, base)
    tree = parse_yaml(text, "mine.yaml")
    (tmp_path / "mine.yaml").write_text(dump_yaml({"base": base, **tree}))
    unchanged = load_scenario(base)
    changed = unchanged.with_changes(tree)
    assert load_scenario(tmp_path / "mine.yaml") == changed
    tree = changed.model_dump()
    assert {key: value_at(tree, key) for key in values} == values
    assert unchanged == load_scenario(base)


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
def test_what_is_changed_decides_on_the_spacing(scenario, text, balanced):
    # A robot that balances otherwise is balanced anew; the thesis rounds its own 2.9436 in to
    # 2.94 in.
    changed = scenario.with_changes(parse_yaml(f"robot: {{{text}}}", ""))
    assert (abs(axial_force(changed)) < 1e-9) == balanced


def test_a_key_with_an_index_changes_an_item_of_a_list():
    prism = load_scenario("prism")
    loaded = prism.with_changes({"robot.loads.n3": ["1 N", "0 N", "-6 N"]})
    changed = loaded.with_changes({"robot.loads.n3[2]": "-8 N"})
    assert changed.robot.loads["n3"] == [1.0, 0.0, -8.0]
    assert loaded.robot.loads == {"n3": [1.0, 0.0, -6.0]}


def test_a_section_without_content_and_no_change_change_nothing(scenario):
    robust, coulomb = load_scenario("robust"), load_scenario("coulomb")
    sections = [key for key, value in robust.model_dump().items() if isinstance(value, dict)]
    for key in {*sections} - {"objective", "disturbances"}:
        assert robust.with_changes({key: None}) == robust
    assert coulomb.on_engine("compiled") == coulomb.on_engine(None) == coulomb
    assert coulomb.on_engine("drake").engine == scenario.engine


def test_a_structure_of_a_file_has_names_to_remove(tmp_path):
    text = "base: prism\nrobot: !Structure {file: prism, actuated: {side_1: null}}\n"
    (tmp_path / "prism.yaml").write_text(text)
    assert next(iter(load_scenario(tmp_path / "prism.yaml").robot.actuated)) == "side_2"


def test_a_key_with_a_dot_is_added_to_a_mapping_that_is_otherwise_replaced(scenario):
    added = scenario.with_changes({"objective.speed": "3 s/m"}).objective
    assert added == scenario.objective | {"speed": 3.0}


def test_a_section_from_python_replaces_the_base_as_a_whole(scenario):
    mapped = scenario.with_changes({"optimizer": QualityDiversity(draws=3)})
    twist = QualityDiversity(measures={"twist": [0.0, 0.1], "lifted": [0.0, 1.0]})
    assert mapped.with_changes({"optimizer": twist}).optimizer == twist
    robot = scenario.robot.model_copy(update={"strut_length": 0.2, "spacing": 0.05})
    assert scenario.with_changes({"robot": robot}).robot == robot, "which keeps its spacing"
