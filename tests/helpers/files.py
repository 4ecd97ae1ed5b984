"""Files of tests/data, and the example of FORMAT.md."""

import re
from pathlib import Path

from tetra_drake.scenario.changes import merged
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.shipped import SCENARIOS
from tetra_drake.scenario.yaml_text import parse_yaml

DATA = Path(__file__).parents[1] / "data"
PAGE = (SCENARIOS / "FORMAT.md").read_text("utf-8")
CRANE: str = re.findall("```yaml\n(.*?)```", PAGE, re.S)[0]
"""Two pinned bars, a cage with a given inertia on a joint, and a cable over two rings on it: every
section of a structure file."""
SMALL, FRAME = (
    (DATA / f"structures/{name}.yaml").read_text("utf-8") for name in ("small", "frame")
)
TEXTS = {"small": SMALL, "frame": FRAME, "crane": CRANE}


def structure_of(name: str, changes: str = "") -> StructureFile:
    """A structure with changes."""
    tree = merged(parse_yaml(TEXTS[name], "my.yaml"), parse_yaml(changes, "my.yaml") or {})
    return StructureFile.from_tree(tree, "my.yaml")
