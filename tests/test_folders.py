"""The folders that commands write: each command that takes one reads it, the others refuse it."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers import quick_figures
from helpers.actuations import MOTOR
from helpers.brief import BRIEF

from tetra_drake.cli import main
from tetra_drake.files import write_whole
from tetra_drake.scenario.load import load_scenario

FIELD = {"robot.contacts": "all", "terrain": "!HeightField {file: heights.txt, cell: 0.5 m}"}
MAP = {"optimizer": {"_tag": "QualityDiversity", "cells": [2, 2]}}
SCENARIOS = {"force": ("coulomb", FIELD), "map": ("coulomb", MAP), "motor": ("coulomb", MOTOR)}

WRITERS, READERS = yaml.safe_load(
    Path(__file__).with_name("folders.yaml").read_text("utf-8")
).values()


@pytest.fixture(scope="module", autouse=True)
def quick_drawing():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tetra_drake.report.run_page.draw_pictures", quick_figures.draw_pictures)
        patch.setattr("tetra_drake.figures.style.save_figure", quick_figures.save_blank)
        yield


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    """A folder with what each writer writes."""
    folder = tmp_path_factory.mktemp("written")
    np.savetxt(folder / "heights.txt", -0.002 * np.random.default_rng(0).random((11, 11)))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, (base, changes) in SCENARIOS.items():
            scenario = load_scenario(base).with_changes(BRIEF | changes)
            write_whole(folder / f"{name}.yaml", scenario.to_yaml())
        for name, command in WRITERS.items():
            assert main([*command.split(), "--out", name]) == 0, command
    (folder / "heights.txt").unlink()  # what is written needs no other file
    return folder.rename(f"{folder}_moved")


@pytest.mark.parametrize("writer", WRITERS)
@pytest.mark.parametrize("reader", READERS)
def test_a_folder_is_read_or_refused(reader, writer, written, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(written)
    out = tmp_path / "out"
    status = main([*reader.format(writer).split(), "--out", str(out)])
    captured = capsys.readouterr()
    if writer in READERS[reader]:
        assert (status, captured.err) == (0, "")
        assert out.exists()
        return
    assert status == 2 and not out.exists()
    (line,) = captured.err.splitlines()
    assert re.match(rf"tetra-drake: {writer}\b", line), line
