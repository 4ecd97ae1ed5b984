"""The block diagram of a Drake diagram as a picture, drawn by Graphviz."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from pydrake.systems.framework import Diagram, InputPortIndex, OutputPortIndex, System

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file, write_whole

_LOOK = """rankdir=LR; ranksep=0.6
node [shape=record, fontname=Helvetica, fontsize=12, style=filled, fillcolor=white]
edge [arrowsize=0.7]"""
_PYTHON = ', fillcolor="#fdf3d8"'  # a system written in Python; those of Drake are white
_INPUTS, _OUTPUTS = "diagram inputs", "diagram outputs"
_OWN = ', style="rounded,filled", color=forestgreen'


class _Port(NamedTuple):
    block: str
    side: str  # u: input, y: output
    number: int
    name: str


def save_block_diagram(diagram: Diagram, path: Path) -> None:
    """Writes the block diagram as Graphviz source (.dot) or as a picture (.svg, .png, .pdf).

    Raises InputError if the suffix is none of these, if Graphviz's program `dot`, which draws
    the pictures, is missing or fails, or if the file cannot be written.
    """
    suffix, source = path.suffix.lower(), graphviz_source(diagram)
    if suffix not in (".dot", ".svg", ".png", ".pdf"):
        raise InputError(path, "", "the suffix must be one of .dot, .svg, .png, .pdf")
    if suffix == ".dot":
        return write_whole(path, source)
    dot = shutil.which("dot")
    if dot is None:
        raise InputError(path, "", "needs Graphviz, whose program `dot` is missing; .dot does not")
    with whole_file(path) as file:
        command = [dot, f"-T{suffix[1:]}", "-o", str(file)]
        drawn = subprocess.run(command, input=source, capture_output=True, text=True)
        if drawn.returncode != 0:
            reason = drawn.stderr.strip().partition("\n")[0]
            raise InputError(path, "", f"`dot` cannot draw it: {reason}")


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
        lines.append(_block(block, ports, title=block, look=_OWN))
    for a, b in edges:
        lines.append(f'"{a.block}":{a.side}{a.number}:e -> "{b.block}":{b.side}{b.number}:w')
    return "\n".join([*lines, "}", ""])


def _edges(diagram: Diagram) -> list[tuple[_Port, _Port]]:
    edges = [(_port(*source), _port(*to)) for to, source in diagram.connection_map().items()]
    for k in map(InputPortIndex, range(diagram.num_input_ports())):
        own = _Port(_INPUTS, "y", int(k), diagram.get_input_port(k).get_name())
        edges += [(own, _port(*locator)) for locator in diagram.GetInputPortLocators(k)]
    for k in map(OutputPortIndex, range(diagram.num_output_ports())):
        own = _Port(_OUTPUTS, "u", int(k), diagram.get_output_port(k).get_name())
        edges.append((_port(*diagram.get_output_port_locator(k)), own))
    return edges


def _port(system: System, index: InputPortIndex | OutputPortIndex) -> _Port:
    side = "u" if isinstance(index, InputPortIndex) else "y"
    port = system.get_input_port(index) if side == "u" else system.get_output_port(index)
    return _Port(system.get_name(), side, int(index), port.get_name())


def _block(block: str, ports: list[_Port], *, title: str, look: str) -> str:
    """A record of three columns: input ports, title, output ports."""
    used = {side: [p for p in ports if p[:2] == (block, side)] for side in "uy"}
    columns = ["|".join(f"<{p.side}{p.number}> {p.name}" for p in used[side]) for side in "uy"]
    label = "|".join(f"{{{column}}}" for column in (columns[0], title, columns[1]) if column)
    return f'"{block}" [label="{{{label}}}"{look}]'
