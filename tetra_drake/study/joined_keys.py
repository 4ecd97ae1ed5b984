"""Changes of scenarios by keys that are joined by commas and get the same value."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

from tetra_drake.errors import InputError
from tetra_drake.scenario.common_sections import by_separate_key
from tetra_drake.scenario.scenario import Scenario


def with_joined_changes(scenario: Scenario, by_joined: Mapping[str, Any]) -> Scenario:
    """The scenario with changes by joined keys; see Scenario.with_changes().

    Raises InputError, naming the key. It says if it helps to join a key and another one, because a
    limit depends on both.
    """
    changes = by_separate_key(by_joined)
    try:
        return scenario.with_changes(changes)
    except InputError as error:
        problem = f"{error.problem}{_advice(scenario, changes, error.key)}"
        raise InputError(error.source, error.key, problem) from error


def _advice(scenario: Scenario, changes: Mapping[str, Any], refused: str) -> str:
    """Advice to join a changed key and a `refused` one of its section; "" if that is no help."""
    for key, value in changes.items():
        if refused not in changes and key.rpartition(".")[0] == refused.rpartition(".")[0]:
            with contextlib.suppress(InputError):
                scenario.with_changes({**changes, refused: value})
                return f"; the joined keys '{key}, {refused}' get the same value"
    return ""
