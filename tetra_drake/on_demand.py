"""Objects that are imported when they are asked for, such as engines, optimisers and the lab."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

_IMPORT = r"from (\S+) import (\w+)"


def loaded(place: str) -> Any:
    """Object of a module, by a text such as "tetra_drake.lab.spread:spread"."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def attributes(
    package: str, file: Path
) -> tuple[list[str], Callable[[str], Any], Callable[[], list[str]]]:
    """Public names of a package, its `__getattr__` and its `__dir__`: each name is imported at its
    first use. The names and their modules are the imports in the stub (.pyi) beside the package's
    `file`."""
    stub = file.with_suffix(".pyi").read_text(encoding="utf-8")
    places = {name: f"{module}:{name}" for module, name in re.findall(_IMPORT, stub)}

    def get(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        return loaded(places[name])

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *places})

    return [*places], get, names
