"""Files of NTRT: a prism and a spine, read into structures."""

import functools
import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers.files import DATA

from tetra_drake.errors import InputError
from tetra_drake.lab.bridges.conversion import converted
from tetra_drake.lab.bridges.ntrt import ntrt_tree
from tetra_drake.lab.study.equilibrium import robot_of_structure
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import load_scenario, save_scenario
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.settings.section import value_at

TEXTS = {file.stem: file.read_text("utf-8") for file in (DATA / "ntrt").glob("*.yaml")}
ROWS = yaml.safe_load(Path(__file__).with_name("ntrt.yaml").read_text("utf-8"))


def write(folder: Path, text: str, name: str = "my.yaml") -> Path:
    """A file, beside the examples."""
    if not any(folder.iterdir()):
        shutil.copytree(DATA / "ntrt", folder, dirs_exist_ok=True)
    (folder / name).write_text(text)
    return folder / name


def read(file: Path, unit: float = 0.1) -> StructureFile:
    return StructureFile.from_tree(ntrt_tree(file, unit=unit), file)


@functools.cache
def example(name: str) -> dict[str, Any]:
    """The content of an example in decimetres, and names, masses and radii of its parts."""
    given = read(DATA / f"ntrt/{name}.yaml")
    blueprint = given.blueprint()
    radii = dict(zip(blueprint.node_names, blueprint.node_radius.tolist(), strict=True))
    parts = {"bodies": blueprint.bodies, "cable_names": blueprint.cable_names, "radii": radii}
    return given.model_dump() | parts | {"masses": Structure.of(blueprint).mass.tolist()}


@pytest.mark.parametrize(("name", "key", "value"), ROWS["examples"])
def test_an_example_is_read(name: str, key: str, value: Any) -> None:
    assert value_at(example(name), key) == pytest.approx(value)


def test_a_bond_of_nodes_and_edges_moves_the_second_part_and_replaces_cables():
    given = read(DATA / "ntrt/docked.yaml")
    p = {name: np.array(place) for name, place in given.nodes.items()}
    centre = (p["a/high1"] + p["a/high2"] + p["a/high3"]) / 3.0
    for i, j in ((1, 2), (2, 3), (3, 1)):  # the triangles have one size, their middles half of it
        middle = (p[f"b/low{i}"] + p[f"b/low{j}"]) / 2.0
        assert 2.0 * (middle - centre) == pytest.approx(p[f"a/high{i}"] - centre)
    assert min(p["b/high1"] - p["a/high1"]) > -0.2 < p["b/high1"][2] - 0.3, "b stands on a"
    pairs = [{*name.split()[1:]} for name in given.blueprint().cable_names]
    assert len(pairs) == 2 * 9 - 6 + 6
    assert {"b/low1", "a/high1"} in pairs and {"a/high1", "b/low2"} in pairs
    assert {"b/low1", "b/low2"} not in pairs and {"a/high1", "a/high2"} not in pairs


def test_boxes_spheres_on_cables_bodies_held_in_space_and_names_of_places(caplog):
    given = read(DATA / "ntrt/kinds.yaml")
    assert given.anchors == {"u": "xyz", "v": "xyz"}, "of density 0"
    assert given.nodes["u"][2] == pytest.approx(1.2), "where something is held, y = 0 is the ground"
    blueprint = given.blueprint()
    assert (blueprint.bodies, len(blueprint.cable_names)) == (("bar", "w"), 4)
    assert blueprint.node_names[:3] == ("a", "b", "w")
    box, ball = 0.7 * 4.0 * 0.4 * 0.2, 3.0 * 4.0 / 3.0 * math.pi * 1.5**3  # kg
    assert Structure.of(blueprint).mass == pytest.approx([box, ball])
    assert "spare" not in given.nodes
    assert all(name in caplog.text for name in (": spare", ": ceiling", ": bar", ": u v, a b"))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("entry", "front", "lowest"), ROWS["places"])
def test_places_of_substructures(entry, front, lowest, tmp_path) -> None:
    """Turned, then scaled about their centre, then moved; then the whole is set on the ground."""
    file = write(tmp_path, f"substructures: {{v: {{path: vertebra.yaml, {entry}}}}}")
    x, y, z = front
    assert read(file, unit=1.0).nodes["v/front"] == pytest.approx([z, x, y - lowest])


def test_nested_substructures_builders_and_paths_of_nodes(tmp_path: Path) -> None:
    """A superstructure overrides builders; a name means the least nested node that has it."""
    builder = "builders: {string: {class: tgBasicActuatorInfo, parameters: {stiffness: %s}}}"
    write(tmp_path, TEXTS["spine"] + builder % 7, "spine.yaml")
    given = read(write(tmp_path, TEXTS["nested"]))
    names = ("string b/left a/v2/left", "string b/front a/v3/back", "string a/v3/right b/right")
    assert given.blueprint().cable_names[8:] == names
    string = given.cables["string"]
    assert (string.stiffness, string.tension) == (7.0, 0.0), "no pretension unless it says so"
    given = read(write(tmp_path, f"{TEXTS['nested']}\n{builder % 9}"))
    assert given.cables["string"].stiffness == 9.0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("base", "old", "new", "key", "fact"), ROWS["refused"])
def test_problems_name_file_key_and_facts(base, old, new, key, fact, tmp_path, refused) -> None:
    text = TEXTS.get(base, base)
    assert old in text
    file = write(tmp_path, text.replace(old, new))
    # Without an offset the parts are at one place.
    with refused(tmp_path / "vertebra.yaml" if key == "pair_groups.rod[0]" else file, key, fact):
        read(file)


@pytest.mark.parametrize("part", [TEXTS["vertebra"], "pair_groups: {}"])
def test_a_structure_that_multiplies_is_refused_before_it_is_whole(part, tmp_path) -> None:
    """Ten of ten of ten ... parts: the whole would not fit in memory."""
    write(tmp_path, part, "level0.yaml")
    for level in range(8):
        path = f"{{path: level{level}.yaml, offset: [1, 0, 0]}}"
        text = f"substructures: {{a/b/c/d/e/f/g/h/i/j: {path}}}"
        write(tmp_path, text, f"level{level + 1}.yaml")
    with pytest.raises(InputError) as caught:
        read(tmp_path / "level8.yaml")
    assert caught.value.key == ("nodes" if "nodes" in part else "substructures")


def test_the_structure_names_settings_that_the_scenario_replaces(tmp_path, caplog):
    file = DATA / "ntrt/prism.yaml"
    # The scenario keeps the names.
    structure = converted(file, unit="dm")
    save_scenario(tmp_path, robot_of_structure(structure, str(file)).scenario)
    saved = load_scenario(tmp_path / "scenario.yaml")
    assert saved.robot.ignored == ["friction", "restitution", "history"]
    [told] = caplog.messages
    assert str(file) in told and "friction, restitution, history" in told


def test_a_file_needs_a_unit_and_substructures_their_files(tmp_path: Path, refused) -> None:
    file = DATA / "ntrt/prism.yaml"
    with refused(file, "unit", "missing"):
        converted(file)
    for name, told in (("prims", "prims"), ("nul\0", "parts.yaml")):
        part = f"substructures: {{part: {{path: {json.dumps(name)}}}}}"
        parts = write(tmp_path, part, "parts.yaml")
        with refused(tmp_path / told, "", ""):
            converted(parts, unit="m")


@pytest.mark.parametrize("content", ["root:$6$secret:19000:0\ndaemon:*:19000\n", "- secret\n"])
def test_nothing_is_shown_of_a_part_that_is_something_else(content: str, tmp_path: Path) -> None:
    part = write(tmp_path, content, "any")
    with pytest.raises(InputError) as caught:
        converted(write(tmp_path, "substructures: {part: {path: any}}"), unit="m")
    assert str(part) in str(caught.value)
    assert "secret" not in str(caught.value)
