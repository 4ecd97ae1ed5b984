"""Scenario files of a few lines."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

LoadText = Callable[[str], Scenario]


@pytest.fixture
def load_text(tmp_path: Path) -> LoadText:
    """Loads a text as a file that is based on the thesis scenario."""

    def load(text: str) -> Scenario:
        file = tmp_path / "mine.yaml"
        file.write_text(f"base: thesis\n{text}\n", encoding="utf-8")
        return load_scenario(file)

    return load
