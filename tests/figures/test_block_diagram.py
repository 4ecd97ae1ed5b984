"""The block diagram as Graphviz source and as a picture."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Gain, Integrator

from tetra_drake.figures.block_diagram import graphviz_source, save_block_diagram
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems.diagram import MakeTensegrityDiagram

needs_dot = pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")


@pytest.fixture
def robot(scenario: Scenario) -> Diagram:
    return MakeTensegrityDiagram(scenario, seeded_gait(scenario))


def label(source: str, block: str) -> str:
    [found] = re.findall(rf'^"{block}" \[label="(.*?)"', source, re.MULTILINE)
    return found


def test_blocks_show_class_name_and_ports_in_use(robot: Diagram) -> None:
    source = graphviz_source(robot)
    for system in robot.GetSystems():
        assert f"{type(system).__name__}\\n{system.get_name()}" in label(source, system.get_name())
    # A MultibodyPlant has some thirty ports.
    assert re.findall(r"<[uy]\d+> \w+", label(source, "plant")) == [
        "<u2> applied_generalized_force",
        "<y2> state",
    ]
    exported = [robot.get_output_port(i).get_name() for i in range(robot.num_output_ports())]
    assert re.findall(r"<u\d+> (\w+)", label(source, "diagram outputs")) == exported


def test_there_is_an_edge_per_connection_and_exported_port(robot: Diagram) -> None:
    source = graphviz_source(robot)
    edges = [line for line in source.splitlines() if "->" in line]
    assert len(edges) == len(robot.connection_map()) + robot.num_output_ports()
    assert '"cables":y0:e -> "forces":u0:w' in edges
    assert '"ground":y3:e -> "diagram outputs":u6:w' in edges


def test_exported_inputs_are_shown() -> None:
    builder = DiagramBuilder()
    gain = builder.AddNamedSystem("gain", Gain(k=2.0, size=1))
    integral = builder.AddNamedSystem("integral", Integrator(1))
    builder.Connect(gain.get_output_port(), integral.get_input_port())
    builder.ExportInput(gain.get_input_port(), "speed")
    source = graphviz_source(builder.Build())
    assert "<y0> speed" in label(source, "diagram inputs")
    assert '"diagram inputs":y0:e -> "gain":u0:w' in source
    assert "diagram outputs" not in source
    assert "y0" not in label(source, "integral")


def test_equal_diagrams_give_equal_sources(robot: Diagram, scenario: Scenario) -> None:
    again = MakeTensegrityDiagram(scenario, seeded_gait(scenario))
    assert graphviz_source(robot) == graphviz_source(again)


@needs_dot
@pytest.mark.parametrize(
    ("suffix", "magic"),
    [(".svg", b"<?xml"), (".SVG", b"<?xml"), (".png", b"\x89PNG"), (".pdf", b"%PDF")],
)
def test_pictures_are_drawn(robot: Diagram, tmp_path: Path, suffix: str, magic: bytes) -> None:
    path = tmp_path / f"robot{suffix}"
    save_block_diagram(robot, path)
    assert path.read_bytes().startswith(magic)
    assert list(tmp_path.iterdir()) == [path]
    if magic == b"<?xml":
        texts = [text.strip() for text in ElementTree.parse(path).getroot().itertext()]
        assert {system.get_name() for system in robot.GetSystems()} <= set(texts)


@pytest.mark.parametrize("name", ["robot.gif", "robot"])
def test_unknown_suffix_is_refused(robot: Diagram, tmp_path: Path, refused, name: str) -> None:
    with refused(tmp_path / name, "", ".dot, .svg, .png, .pdf"):
        save_block_diagram(robot, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_without_graphviz_only_dot_is_written(
    robot: Diagram, tmp_path: Path, refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nowhere"))
    with refused(tmp_path / "robot.svg", "", "Graphviz"):
        save_block_diagram(robot, tmp_path / "robot.svg")
    save_block_diagram(robot, tmp_path / "robot.dot")
    assert [path.name for path in tmp_path.iterdir()] == ["robot.dot"]


def test_a_dot_that_fails_leaves_nothing(
    robot: Diagram, tmp_path: Path, refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    program, out = tmp_path / "dot", tmp_path / "out"
    out.mkdir()
    program.write_text("#!/bin/sh\necho 'Error: no layout' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    with refused(out / "robot.png", "", "Error: no layout"):
        save_block_diagram(robot, out / "robot.png")
    assert list(out.iterdir()) == []
