"""Pins of the oldest versions that pyproject.toml allows, for pip's option -c."""

import re
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text("utf-8"))[
    "project"
]
for needed in (*project["dependencies"], *project["optional-dependencies"]["test"]):
    print(re.sub(r"\[.*\]", "", needed).replace(">=", "=="))
