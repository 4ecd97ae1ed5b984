"""The block diagram of a Drake diagram as a picture."""

from __future__ import annotations

import re
import shutil
import subprocess
from itertools import zip_longest
from pathlib import Path

from pydrake.systems.framework import Diagram

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file, write_whole

_DRAWN = (".svg", ".png", ".pdf")

_MANY_PORTS = 8
"""A block with more ports than this shows only those that something is connected to."""

_MODULE = re.compile(r"(?<=<B>)(?:\w+\.)+(?=\w+</B>)")
_BLOCK = re.compile(r"^(?P<id>\w+) \[shape=none\b.*?^>\];$", re.MULTILINE | re.DOTALL)
_EDGE_END = re.compile(r"\b(\w+:[uy]\d+):[ew]\b")
_PORT = re.compile(r'<TD PORT="(?P<port>(?P<side>[uy])\d+)" BORDER="1"[^>]*>(?P<text>.+?)</TD>')
_EMPTY = '<TD BORDER="1" COLOR="grey" SIDES="BL"></TD>'


def save_block_diagram(diagram: Diagram, path: Path, *, max_depth: int | None = None) -> None:
    """Writes the block diagram; the suffix of `path` says how.

    `.dot` is Graphviz source; `.svg`, `.png` and `.pdf` are drawn by Graphviz's program
    `dot`. Nested diagrams are opened to `max_depth` levels, all of them if None. The
    source is Drake's own, made readable: see readable_graphviz.

    Raises InputError if the suffix is none of these, if there is no `dot`, or if the file
    cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in (".dot", *_DRAWN):
        expected = ", ".join((".dot", *_DRAWN))
        raise InputError(path, "", f"found suffix '{path.suffix}', expected one of {expected}")
    source = readable_graphviz(diagram.GetGraphvizString(max_depth=max_depth))
    if suffix == ".dot":
        write_whole(path, source)
    else:
        _draw(source, path, kind=suffix.removeprefix("."))


def readable_graphviz(source: str) -> str:
    """Drake's Graphviz source with less in its blocks.

    Class names lose their modules, and blocks with many ports those that nothing is
    connected to: a MultibodyPlant has some thirty, of which a diagram may use two. Source of
    another form than Drake's stays as it is.
    """
    connected = frozenset(_EDGE_END.findall(source))
    source = _BLOCK.sub(lambda block: _without_idle_ports(block, connected), source)
    return _MODULE.sub("", source)


def _without_idle_ports(block: re.Match[str], connected: frozenset[str]) -> str:
    ports = list(_PORT.finditer(block[0]))
    used = [port for port in ports if f"{block['id']}:{port['port']}" in connected]
    if len(ports) <= _MANY_PORTS or not used:
        return block[0]
    title = block[0][: block[0].index("</TR>") + len("</TR>")]
    inputs, outputs = ([port for port in used if port["side"] == side] for side in "uy")
    rows = [
        "<TR>" + "".join(_port_cell(port) for port in pair) + "</TR>"
        for pair in zip_longest(inputs, outputs)
    ]
    return "\n".join([title, *rows, "</TABLE>", ">];"])


def _port_cell(port: re.Match[str] | None) -> str:
    if port is None:
        return _EMPTY
    return f'<TD PORT="{port["port"]}" BORDER="1">{port["text"]}</TD>'


def _draw(source: str, path: Path, *, kind: str) -> None:
    dot = shutil.which("dot")
    if dot is None:
        raise InputError(
            path,
            "",
            f"drawing a .{kind} needs Graphviz, whose program 'dot' was not found; "
            "a .dot file can be written without it",
        )
    with whole_file(path) as temporary:
        drawn = subprocess.run(
            [dot, f"-T{kind}", "-Nfontname=Helvetica", "-Gfontname=Helvetica", "-o", temporary],
            input=source.encode(),
            capture_output=True,
        )
        if drawn.returncode != 0:
            complaint = drawn.stderr.decode(errors="replace").strip() or "no reason given"
            raise InputError(path, "", f"'dot' cannot draw it: {complaint.splitlines()[0]}")
