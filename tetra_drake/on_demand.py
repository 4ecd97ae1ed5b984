"""Objects that are imported when they are asked for, such as engines, optimisers and the lab."""

from __future__ import annotations

import importlib
from typing import Any


def loaded(place: str) -> Any:
    """Object of a module, by a text such as "tetra_drake.lab.spread:spread"."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)
