"""Block diagram of a Drake diagram as an SVG file, drawn by Graphviz.

Drake's own picture shows all ports of all systems. This one shows only connected ports.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, System

from tetra_drake.errors import InputError
from tetra_drake.files import write_whole

_LOOK = """rankdir=LR; ranksep=0.6
node [shape=record, fontname=Helvetica, fontsize=12, style=filled, fillcolor=white]
edge [arrowsize=0.7]"""
_PYTHON = ', fillcolor="#fdf3d8"'  # a system written in Python; Drake's systems are white
_INPUTS, _OUTPUTS = "diagram inputs", "diagram outputs"
_EXPORTED = ', style="rounded,filled", color=forestgreen'


class _Port(NamedTuple):
    block: str
    side: str  # u: input, y: output
    number: int
    name: str


OUT = Path("out/diagrams")
"""Folder for pictures. Those in the README are in the folder of this file."""


def save_block_diagram(diagram: Diagram, path: Path) -> None:
    """Writes the block diagram of a diagram as SVG.

    Raises InputError if Graphviz's program `dot` is missing, or if the file cannot be written.
    """
    dot = shutil.which("dot")
    if dot is None:
        raise InputError(path, "", "needs Graphviz, whose program `dot` is missing")
    source = graphviz_source(diagram)
    drawn = subprocess.run([dot, "-Tsvg"], input=source, capture_output=True, text=True, check=True)
    write_whole(path, drawn.stdout)


def graphviz_source(diagram: Diagram) -> str:
    """Graphviz source: for each system its class, name, and connected or exported ports."""
    edges = sorted(_edges(diagram))
    ports = sorted({port for edge in edges for port in edge})
    lines = ["digraph {", _LOOK]
    for system in diagram.GetSystems():
        name, kind = system.get_name(), type(system)
        look = "" if kind.__module__.startswith("pydrake.") else _PYTHON
        lines.append(_block(name, ports, title=f"{kind.__name__}\\n{name}", look=look))
    for block in sorted({port.block for port in ports} & {_INPUTS, _OUTPUTS}):
        lines.append(_block(block, ports, title=block, look=_EXPORTED))
    for a, b in edges:
        lines.append(f'"{a.block}":{a.side}{a.number}:e -> "{b.block}":{b.side}{b.number}:w')
    return "\n".join([*lines, "}", ""])


def _edges(diagram: Diagram) -> list[tuple[_Port, _Port]]:
    edges = [(_port(*source), _port(*to)) for to, source in diagram.connection_map().items()]
    for k in map(InputPortIndex, range(diagram.num_input_ports())):
        port = _Port(_INPUTS, "y", int(k), diagram.get_input_port(k).get_name())
        edges += [(port, _port(*locator)) for locator in diagram.GetInputPortLocators(k)]
    for k in map(OutputPortIndex, range(diagram.num_output_ports())):
        port = _Port(_OUTPUTS, "u", int(k), diagram.get_output_port(k).get_name())
        edges.append((_port(*diagram.get_output_port_locator(k)), port))
    return edges


def _port(system: System, index: InputPortIndex | OutputPortIndex) -> _Port:
    if isinstance(index, InputPortIndex):
        side, port = "u", system.get_input_port(index)
    else:
        side, port = "y", system.get_output_port(index)
    return _Port(system.get_name(), side, int(index), port.get_name())


def _block(block: str, ports: list[_Port], *, title: str, look: str) -> str:
    """Label of a Graphviz node: up to three columns with input ports, title, output ports."""
    columns = {"u": "", "title": title, "y": ""}
    for side in ("u", "y"):
        used = [port for port in ports if (port.block, port.side) == (block, side)]
        if used:
            cells = "|".join(f"<{side}{port.number}> {port.name}" for port in used)
            columns[side] = f"{{{cells}}}"
    label = "|".join(column for column in columns.values() if column)
    return f'"{block}" [label="{{{label}}}"{look}]'
