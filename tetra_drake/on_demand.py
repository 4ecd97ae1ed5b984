"""Objects that are imported when they are asked for, such as engines, optimisers and the lab."""

from __future__ import annotations

import importlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def loaded(place: str) -> Any:
    """Object of a module, by a text such as "tetra_drake.lab.spread:spread"."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def places(package: Path) -> Mapping[str, str]:
    """Places of the public names of a package, by name: the imports in the stub (.pyi) beside its
    file `package`."""
    stub = package.with_suffix(".pyi").read_text(encoding="utf-8")
    return {name: f"{place}:{name}" for place, name in re.findall(r"from (\S+) import (\w+)", stub)}
