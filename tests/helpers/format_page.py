"""The complete example of FORMAT.md, which has every section of a structure file."""

import re

from tetra_drake.scenario.shipped import SCENARIOS

PAGE = (SCENARIOS / "FORMAT.md").read_text("utf-8")
EXAMPLE: str = re.findall("```yaml\n(.*?)```", PAGE, re.S)[0]
"""Two pinned bars, a cage with a given inertia on a joint, and a cable over two rings on it."""
