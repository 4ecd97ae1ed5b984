"""The block diagram as a picture: what it shows, and what is refused."""

import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from pydrake.systems.framework import Diagram

from tetra_drake.figures.block_diagram import readable_graphviz, save_block_diagram
from tetra_drake.robot.gait import random_gait
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

needs_dot = pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")


@pytest.fixture
def robot(scenario: Scenario) -> Diagram:
    gait = random_gait(scenario, np.random.default_rng(0), name="any")
    return MakeTensegrityDiagram(scenario, gait)


def test_dot_names_all_subsystems_and_output_ports(robot: Diagram, tmp_path: Path) -> None:
    path = tmp_path / "robot.dot"
    save_block_diagram(robot, path)
    source = path.read_text()
    assert source.startswith("digraph")
    names = [system.get_name() for system in robot.GetSystems()]
    assert {"cpg", "start_up", "cables", "ground", "forces", "plant"} <= set(names)
    for name in names:
        assert f"name={name}\n" in source
    for i in range(robot.num_output_ports()):
        assert f">{robot.get_output_port(i).get_name()}</TD>" in source


def test_dot_keeps_every_connection(robot: Diagram, tmp_path: Path) -> None:
    path = tmp_path / "robot.dot"
    save_block_diagram(robot, path)
    source, original = path.read_text(), robot.GetGraphvizString()
    edges = [line for line in original.splitlines() if " -> " in line]
    assert len(edges) == len(robot.connection_map()) + robot.num_output_ports()
    assert [line for line in source.splitlines() if " -> " in line] == edges


def test_plant_shows_only_the_ports_in_use(robot: Diagram) -> None:
    source = readable_graphviz(robot.GetGraphvizString())
    plant = source[source.index("<B>MultibodyPlant</B>") :].split("</TABLE>")[0]
    ports = [line for line in plant.splitlines() if "PORT=" in line]
    assert len(ports) == 1
    assert ports[0].count("PORT=") == 2
    assert ">applied_generalized_force<" in ports[0]
    assert ">state<" in ports[0]


def test_max_depth_closes_the_diagram(robot: Diagram, tmp_path: Path) -> None:
    path = tmp_path / "robot.dot"
    save_block_diagram(robot, path, max_depth=0)
    source = path.read_text()
    assert "name=tensegrity_robot" in source
    assert "name=plant" not in source


def test_source_of_another_form_stays_as_it_is() -> None:
    source = "digraph {\na [label=<<TABLE></TABLE>>];\na -> b\n}\n"
    assert readable_graphviz(source) == source


@needs_dot
@pytest.mark.parametrize("suffix", [".svg", ".SVG"])
def test_svg_is_drawn(robot: Diagram, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"robot{suffix}"
    save_block_diagram(robot, path)
    text = "".join(ElementTree.parse(path).getroot().itertext())
    for system in robot.GetSystems():
        assert f"name={system.get_name()}" in text
    assert list(tmp_path.iterdir()) == [path]


@needs_dot
@pytest.mark.parametrize(("suffix", "magic"), [(".png", b"\x89PNG"), (".pdf", b"%PDF")])
def test_pictures_are_drawn(robot: Diagram, tmp_path: Path, suffix: str, magic: bytes) -> None:
    path = tmp_path / f"robot{suffix}"
    save_block_diagram(robot, path)
    assert path.read_bytes().startswith(magic)


@pytest.mark.parametrize("name", ["robot.gif", "robot"])
def test_unknown_suffix_is_refused(robot: Diagram, tmp_path: Path, refused, name: str) -> None:
    path = tmp_path / name
    with refused(path, "", "expected one of .dot, .svg, .png, .pdf"):
        save_block_diagram(robot, path)
    assert list(tmp_path.iterdir()) == []


def test_without_graphviz_only_dot_is_written(
    robot: Diagram, tmp_path: Path, refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nowhere"))
    with refused(tmp_path / "robot.svg", "", "a .dot file can be written without it"):
        save_block_diagram(robot, tmp_path / "robot.svg")
    assert list(tmp_path.iterdir()) == []
    save_block_diagram(robot, tmp_path / "robot.dot")
    assert (tmp_path / "robot.dot").is_file()


def test_a_dot_that_fails_leaves_nothing(
    robot: Diagram, tmp_path: Path, refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    programs, out = tmp_path / "programs", tmp_path / "out"
    programs.mkdir()
    out.mkdir()
    program = programs / "dot"
    program.write_text("#!/bin/sh\necho 'Error: no layout' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(programs))
    with refused(out / "robot.png", "", "'dot' cannot draw it: Error: no layout"):
        save_block_diagram(robot, out / "robot.png")
    assert list(out.iterdir()) == []


def test_a_folder_in_the_way_is_refused(robot: Diagram, tmp_path: Path, refused) -> None:
    path = tmp_path / "robot.dot"
    path.mkdir()
    with refused(path, "", "is a directory"):
        save_block_diagram(robot, path)
