"""Where compiled kernels are kept. A copy of the package runs in a fresh process, with a plain
file where its cache folder would be: unwritable even for root."""

import logging
import math
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest
import yaml

import tetra_drake
from tetra_drake.kernels import compiling
from tetra_drake.kernels.compiling import LOGGER, compiled, compiling_time

PROGRAMS = yaml.safe_load(Path(__file__).with_name("programs.yaml").read_text("utf-8"))


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A read-only installation."""
    target = tmp_path / "installed" / "tetra_drake"
    without_cache = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(tetra_drake.__file__).parent, target, ignore=without_cache)
    (target / "laws" / "__pycache__").write_text("in the way")
    return target.parent


def run(package: Path, cache_home: Path, program: str) -> str:
    """What a program of programs.yaml prints."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(package)}
    environment |= {"XDG_CACHE_HOME": str(cache_home), "HOME": str(cache_home)}
    command = [sys.executable, "-c", PROGRAMS[program]]
    return subprocess.check_output(command, env=environment, cwd=package, text=True)


@pytest.mark.parametrize(("folder", "caches"), [("cache", True), ("file/cache", False)])
def test_a_read_only_installation_caches_for_the_user_if_it_can(package, tmp_path, folder, caches):
    (tmp_path / "file").write_text("")
    assert float(run(package, tmp_path / folder, "interpolate")) == 1.0
    assert any(tmp_path.rglob("kinematics.interpolate_state*.nbc")) == caches


def stamps(package: Path, home: Path) -> dict[str, str]:
    """The digest by which the machine code of each kernel of a copy of the package is known."""
    printed = run(package, home, "stamps")
    return dict(line.split() for line in printed.splitlines())


def test_only_kernels_that_use_what_was_edited_are_compiled_anew(package, tmp_path):
    before = stamps(Path(tetra_drake.__file__).parents[1], tmp_path)
    assert {
        "advance",
        "compute_ground_forces",
        "state_signals",
        "factorise_blocks",
    } <= before.keys()
    for file in (package / "tetra_drake").rglob("*.py"):
        text = file.read_text("utf-8")
        text = text.replace('"""', '"""Once more. ', 1) + "# The end.\n"
        is_compiler = file.parent.name == "kernels"  # its code is in all machine code
        file.write_text(text if is_compiler else text + "ADDED = 1\n")
    assert stamps(package, tmp_path) == before

    friction = package / "tetra_drake" / "laws" / "friction.py"
    text, law = friction.read_text("utf-8"), "stick = -(bristle + law.stiction_damping"
    assert law in text
    friction.write_text(text.replace(law, law.replace("+", "-")))
    now = stamps(package, tmp_path)
    changed = {name for name in before if now[name] != before[name]}
    assert {"advance", "compute_ground_forces", "observe_states"} <= changed
    assert not {"compute_cable_forces", "state_signals", "solve_blocks"} & changed


def twice(x):
    return x + x


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where numba keeps machine code."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    return tmp_path


def test_processes_that_save_at_once_do_not_spoil_the_cache(folder, monkeypatch):
    replace, other = os.replace, compiled(twice)

    def after_another(*paths):
        monkeypatch.setattr(os, "replace", replace)
        other(0.25)
        replace(*paths)

    monkeypatch.setattr(os, "replace", after_another)
    assert compiled(twice)(21) == 42
    later = compiled(twice)
    assert (later(21), later(0.25), *later.stats.cache_hits.values()) == (42, 0.5, 1, 1)


def truncate(file: Path, other: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])


def take_another(file: Path, other: Path) -> None:
    file.write_bytes(other.read_bytes())


@pytest.mark.parametrize("damage", [truncate, take_another])
def test_damaged_machine_code_is_made_again(folder, damage):
    def results_and_hits() -> list[float]:
        """Of a kernel that is compiled or loaded anew, for an integer and a real number."""
        kernel = compiled(twice)
        return [kernel(3), kernel(0.25), sum(kernel.stats.cache_hits.values())]

    assert results_and_hits() == [6, 0.5, 0]
    damage(*folder.rglob("*.nbc"))
    assert results_and_hits() == [6, 0.5, 1]
    assert results_and_hits() == [6, 0.5, 2]


@pytest.mark.parametrize(("moment", "minute", "times"), [(0, 60, 1), (0, 0, 2)])
def test_compilation_that_takes_longer_than_a_moment_is_announced_once_in_a_minute(
    folder, monkeypatch, caplog, moment, minute, times
):
    for name, value in {"_MOMENT": moment, "_MINUTE": minute, "_told": -math.inf}.items():
        monkeypatch.setattr(compiling, name, value)
    before = compiling_time()
    for number in (3, 0.25):
        compiled(twice)(number)
    told = [(record.name, record.levelno) for record in caplog.records]
    assert told == [(LOGGER, logging.WARNING)] * times
    assert compiling_time() > before
