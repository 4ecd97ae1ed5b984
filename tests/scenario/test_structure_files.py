"""Scenarios whose robot is a structure from a file."""

from pathlib import Path

import numpy as np
import pytest
from helpers.files import SMALL, structure_of
from pytest import approx

from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.shipped import shipped_structures
from tetra_drake.scenario.structure_files import read_structure


@pytest.mark.parametrize("name", shipped_structures())
def test_a_shipped_scenario_has_the_shipped_structure(name: str) -> None:
    assert load_scenario(name).robot == read_structure(name)


def test_another_file_replaces_the_structure_of_the_base(tmp_path: Path) -> None:
    text = "base: prism\nname: other\nrobot: {file: mine/own.yaml, gravity: 0}\n"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "own.yaml").write_text(SMALL)
    (tmp_path / "other.yaml").write_text(text)
    given = load_scenario(tmp_path / "other.yaml").robot
    expected = read_structure(tmp_path / "mine" / "own.yaml")
    assert given == expected.model_copy(update={"gravity": 0.0})


def test_numbers_of_groups_have_dotted_keys() -> None:
    scenario = load_scenario("prism").with_sections(robot=structure_of("small"))
    assert scenario.numbers()["robot.struts.arm.density"] == approx(1200.0)
    changed = scenario.with_numbers({"robot.cables.long.tension": 4.0, "robot.masses.g": 1.0})
    assert changed.robot.masses == {"g": 1.0}
    for given, tension in ((changed, 4.0), (scenario, 2.0)):
        free_length = given.robot.blueprint().cable_laws[2].free_length
        assert free_length == approx(np.hypot(0.07, 0.10) - tension / 100.0)


def test_a_unit_is_that_of_bare_coordinates() -> None:
    in_m, in_dm = read_structure("prism"), read_structure("prism", unit="dm")
    for node, place in in_m.nodes.items():
        assert in_dm.nodes[node] == approx([0.1 * x for x in place])
