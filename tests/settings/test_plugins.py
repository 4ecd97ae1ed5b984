"""Plug-ins: what they add, and one line for each that is damaged or missing."""

import json
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
import yaml
from helpers.files import DATA
from helpers.plugin import declare, install_example

from tetra_drake.errors import InputError
from tetra_drake.evolution.manifest import read_manifest
from tetra_drake.laws.friction import Coulomb, FrictionKind, ResetIntegrator
from tetra_drake.scenario.load import load_scenario
from tetra_drake.settings import plugins
from tetra_drake.settings.refusals import TAG
from tetra_drake.settings.section import Kinds, Section, parts_in

SCENARIO = DATA / "scenarios/all_added.yaml"
PROGRAMS = yaml.safe_load(Path(__file__).with_name("programs.yaml").read_text("utf-8"))
TAGS = ["Scaled", "Viscous", "Waves", "Servo", "Hopf", "Sine", "HillClimb"]


def run_with(site: Path, folder: Path, program: str, *, jit: bool = False) -> dict:
    """Runs a program in a folder where the file scenario.yaml uses the plug-ins of `site`; returns
    the JSON that it prints."""
    shutil.copy(SCENARIO, folder / "scenario.yaml")
    (folder / "use.py").write_text(program)
    paths = [str(site), str(Path(plugins.__file__).parents[2])]
    settings = {"PYTHONPATH": os.pathsep.join(paths), "NUMBA_DISABLE_JIT": str(int(not jit))}
    command, env = [sys.executable, "use.py", "scenario.yaml"], os.environ | settings
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def used(tmp_path_factory) -> tuple[Path, dict[str, Any]]:
    """The folder in which the first program has run, and what it printed."""
    folder = tmp_path_factory.mktemp("used")
    install_example(folder / "site")
    return folder, run_with(folder / "site", folder, PROGRAMS["use"])


def test_a_plugin_adds_one_of_each_and_records_name_it(used):
    folder, found = used
    assert found["read back"] and found["pickled"] and found["evaluations"] == 2
    assert found["bodies"] == ["bar"]
    parts = [part for part in parts_in(json.loads(found["schema"])) if isinstance(part, dict)]
    titles = [part.get("title") for part in parts]
    for tag in TAGS:
        assert f"!{tag}`" in found["page"] and f"!{tag}" in titles
    assert "Friction divided by velocity." in found["page"]

    for file in (folder / "result.json", folder / "run/manifest.json"):
        assert json.loads(file.read_text())["versions"]["plug-in tetra-example"] == "0.1"
    with pytest.raises(InputError, match=r"plug-in tetra-example 0\.1, which is not") as refused:
        read_manifest(folder / "run")
    assert refused.value.key == "versions"
    with pytest.raises(InputError, match="!Structure; a plug-in may be missing") as refused:
        load_scenario(folder / "scenario.yaml")
    assert refused.value.key == "robot"


@pytest.fixture
def site(tmp_path, monkeypatch):
    """A folder where Python looks for packages; plug-ins are searched anew."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "odd", raising=False)
    plugins.entries.cache_clear()
    yield tmp_path
    plugins.entries.cache_clear()


def build() -> type[Section]:
    """A section with a union that plug-ins can add to. Building it imports all kinds."""

    class Floor(Section):
        friction: Annotated[ResetIntegrator | Coulomb, Kinds(FrictionKind)] = Coulomb()

    return Floor


KIND = "from tetra_drake.laws.friction import Coulomb\nclass {}(Coulomb): pass\n"


DAMAGED = yaml.safe_load(Path(__file__).with_name("damaged.yaml").read_text("utf-8"))


@pytest.mark.parametrize(("text", "value", "problem"), DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_plugin_is_one_line_that_names_it(site, text, value, problem, refused):
    (site / "odd.py").write_text(text + "\n")
    declare(site, "odd-kinds", "0.3", {plugins.KINDS: {"Odd": value}})
    for _ in range(2):  # and again at the next use
        with refused("plug-in odd-kinds 0.3", "tetra_drake.kinds.Odd", problem):
            build()


def test_a_name_belongs_to_one_kind(site):
    (site / "odd.py").write_text(KIND.format("Coulomb"))
    declare(site, "one", "1", {plugins.KINDS: {"Coulomb": "odd:Coulomb"}})
    with pytest.raises(InputError, match="found !Coulomb, expected !Coulomb, which no kind here"):
        build()
    declare(site, "two", "1", {plugins.KINDS: {"Coulomb": "odd:Coulomb"}})
    plugins.entries.cache_clear()
    with pytest.raises(InputError, match=r"plug-in (one|two) 1 as well"):
        build()


@pytest.mark.parametrize("file", ["METADATA", "entry_points.txt"])
def test_damaged_metadata_is_one_line(site, file):
    declare(site, "odd-kinds", "0.3", {plugins.KINDS: {"Odd": "odd:Odd"}})
    (site / "odd_kinds-0.3.dist-info" / file).write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="damaged metadata of a package") as refused:
        build()
    assert refused.value.key == plugins.KINDS


def test_a_structure_of_a_plugin_without_its_file_is_one_line(site):
    (site / "bars.py").write_text("")
    declare(site, "bars", "1", {plugins.STRUCTURES: {"lost_bar": "bars"}})
    tree = {"robot": {TAG: "Structure", "file": "lost_bar"}}
    with pytest.raises(InputError, match=r"plug-in bars 1: .*found no file lost_bar\.yaml"):
        load_scenario("prism").with_file(tree, "mine")


def test_plugins_are_not_searched_by_an_import(used):
    assert used[1]["searches by imports"] == 0


def test_oscillators_of_a_plugin_drive_a_robot_in_the_diagram(tmp_path):
    install_example(tmp_path / "site")
    gait, walk, late = run_with(tmp_path / "site", tmp_path, PROGRAMS["oscillate"])
    turn = math.tau * gait["frequency"]
    np.testing.assert_allclose(walk[0], 1.0, atol=1e-12)  # all begin at x = 1, y = 0
    lags = np.cumsum([0.0, *(gait[name] for name in gait if name.startswith("lag"))])
    for time, signals in zip((1.8, 1.9), late, strict=True):
        np.testing.assert_allclose(signals, np.cos(turn * time - lags), atol=0.05)


@pytest.mark.slow
def test_laws_of_a_plugin_are_compiled_for_every_engine(tmp_path):
    install_example(tmp_path / "site")
    *walks, evaluations = run_with(tmp_path / "site", tmp_path, PROGRAMS["compare"], jit=True)
    assert evaluations == 2, "in a worker process"
    for drake, lanes in (walks[:2], walks[2:]):  # of a policy, of oscillators
        for name in ("distance", "tension", "peak_actuator_force"):
            assert lanes[name] == pytest.approx(drake[name], rel=0.02), name
