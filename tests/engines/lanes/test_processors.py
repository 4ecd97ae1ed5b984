"""The engine as it is compiled for other processors than this one."""

import os
import subprocess
import sys
from pathlib import Path

import llvmlite.binding
import pytest
import yaml

from tetra_drake.machine import LEVELS

TESTS = Path(__file__).parents[2]
HERE = {f"+{name}" for name, has in llvmlite.binding.get_host_cpu_features().items() if has}
WITHOUT_AVX512 = {"NPY_DISABLE_CPU_FEATURES": "X86_V4", "OPENBLAS_CORETYPE": "Haswell"}
"""Lets NumPy and its BLAS compute as on a processor of the level v3."""

PROGRAMS = yaml.safe_load(Path(__file__).with_name("programs.yaml").read_text("utf-8"))


def run(command: list[str], cache: Path | None = None, **environment: str) -> str:
    """What a Python command prints; with a folder `cache` it compiles kernels of its own there."""
    folder = {"NUMBA_CACHE_DIR": str(cache)} if cache else {}
    given = {"env": os.environ | environment | folder}
    given |= {"cwd": TESTS.parent, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, *command], **given)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_robot_rests_alike_to_the_last_digit_where_numpy_and_its_blas_have_no_avx512():
    rests = ["-c", PROGRAMS["rests"]]
    assert run(rests) == run(rests, **WITHOUT_AVX512)


@pytest.mark.slow
def test_processors_without_vectors_walk_single_gaits_as_many(tmp_path):
    modules = [TESTS / "kernels/test_lanes.py", TESTS / "engines/lanes/test_many.py"]
    command = ["-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider", *map(str, modules)]
    run(command, tmp_path, NUMBA_CPU_NAME="generic")


@pytest.mark.slow
def test_all_levels_walk_alike_to_the_last_digit(tmp_path):
    if missing := LEVELS["x86-64-v4"] - HERE:
        pytest.skip(f"this processor lacks {missing}")
    walks = ["-c", PROGRAMS["walks"]]
    walked = run(walks, tmp_path, NUMBA_CPU_NAME="x86-64-v4")
    assert len(walked.splitlines()) > 20
    assert walked == run(walks, tmp_path, NUMBA_CPU_NAME="x86-64-v3", **WITHOUT_AVX512)
