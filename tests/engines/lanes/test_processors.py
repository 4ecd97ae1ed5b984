"""The engine as it is compiled for other processors than this one."""

import os
import subprocess
import sys
from pathlib import Path

import llvmlite.binding
import pytest

from tetra_drake.machine import LEVELS

TESTS = Path(__file__).parents[2]
HERE = {f"+{name}" for name, has in llvmlite.binding.get_host_cpu_features().items() if has}
WITHOUT_AVX512 = {"NPY_DISABLE_CPU_FEATURES": "X86_V4", "OPENBLAS_CORETYPE": "Haswell"}
"""Lets NumPy and its BLAS compute as on a processor of the level v3."""

WALKS = """
from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.shipped import shipped_scenarios
for name in shipped_scenarios():
    for engine in ("!Compiled", "!Drake") if name in ("thesis", "motors") else ("!Compiled",):
        changes = {"engine": engine, "simulation.duration": "4 s", "simulation.steady_from": "3 s"}
        scenario = load_scenario(name).with_changes(changes)
        metrics = simulate(scenario, seeded_gait(scenario)).metrics
        print(name, engine, metrics.distance_in.hex(), metrics.actuator_work.hex())
"""


def run(command: list[str], cache: Path, **environment: str) -> str:
    """What a Python command prints that compiles kernels of its own, in the folder `cache`."""
    given = {"env": os.environ | environment | {"NUMBA_CACHE_DIR": str(cache)}}
    given |= {"cwd": TESTS.parent, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, *command], **given)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.slow
def test_processors_without_vectors_walk_single_gaits_as_many(tmp_path):
    modules = [TESTS / "kernels/test_lanes.py", TESTS / "engines/lanes/test_many.py"]
    command = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *map(str, modules)]
    run(command, tmp_path, NUMBA_CPU_NAME="generic")


@pytest.mark.slow
def test_all_levels_walk_alike_to_the_last_digit(tmp_path):
    if missing := LEVELS["x86-64-v4"] - HERE:
        pytest.skip(f"this processor lacks {missing}")
    walked = run(["-c", WALKS], tmp_path, NUMBA_CPU_NAME="x86-64-v4")
    assert len(walked.splitlines()) > 20
    assert walked == run(["-c", WALKS], tmp_path, NUMBA_CPU_NAME="x86-64-v3", **WITHOUT_AVX512)
