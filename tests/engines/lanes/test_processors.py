"""The engine as it is compiled for processors with narrower registers than this one's."""

import os
import subprocess
import sys
from pathlib import Path

import llvmlite.binding
import pytest

TESTS = Path(__file__).parents[2]
HERE = llvmlite.binding.get_host_cpu_features()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "features"),
    [
        ("generic", ()),  # registers of two doubles, on x86
        ("haswell", ("sse4.2", "avx", "avx2", "fma")),  # of four
        ("skylake-avx512", ("avx", "avx2", "fma", "avx512f", "avx512vl", "avx512dq")),  # of eight
    ],
)
def test_lanes_walk_as_single_gaits_do_on_other_processors(tmp_path, name, features):
    missing = [feature for feature in features if not HERE.get(feature)]
    if missing:
        pytest.skip(f"this processor lacks {missing}")
    own = {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ",".join(f"+{f}" for f in features)}
    environment = os.environ | own | {"NUMBA_CACHE_DIR": str(tmp_path)}
    modules = [TESTS / "kernels/test_lanes.py", TESTS / "engines/lanes/test_many.py"]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *map(str, modules)]
    done = subprocess.run(
        command, env=environment, cwd=TESTS.parent, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout
