"""Scenarios that differ a little."""

from __future__ import annotations

import dataclasses
from typing import Any

from tetra_drake.scenario.schema import Scenario


def with_changes(scenario: Scenario, **sections: dict[str, Any]) -> Scenario:
    """The scenario with other values in some of its sections."""
    changed = {
        name: dataclasses.replace(getattr(scenario, name), **values)
        for name, values in sections.items()
    }
    return dataclasses.replace(scenario, **changed)
