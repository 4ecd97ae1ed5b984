"""Where compiled kernels are kept. The package is copied and run in a fresh process, with a
plain file standing where its cache folder would be: as unwritable as a read-only
installation, whoever runs the test."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tetra_drake

PROGRAM = (
    "from tetra_drake.physics.cable import cable_tension;"
    "print(cable_tension(0.3, 0.0, 0.0, 10.0, 0.0, 0.1, False))"
)


@pytest.fixture
def read_only_package(tmp_path: Path) -> Path:
    source = Path(tetra_drake.__file__).parent
    target = tmp_path / "installed" / "tetra_drake"
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
    (target / "physics" / "__pycache__").write_text("in the way")
    return target.parent


def run(
    package: Path, cache_home: Path, program: str = PROGRAM
) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    environment |= {
        "PYTHONPATH": str(package),
        "XDG_CACHE_HOME": str(cache_home),
        "HOME": str(cache_home),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    return subprocess.run(
        [sys.executable, "-c", program],
        env=environment,
        cwd=package,
        capture_output=True,
        text=True,
        check=True,
    )


def test_a_read_only_installation_caches_in_the_users_folder(
    read_only_package: Path, tmp_path: Path
) -> None:
    cache_home = tmp_path / "cache"
    cache_home.mkdir()
    assert float(run(read_only_package, cache_home).stdout) == pytest.approx(2.0)
    assert list(cache_home.rglob("cable.cable_tension*.nbi"))


def test_without_any_folder_for_a_cache_kernels_still_work(
    read_only_package: Path, tmp_path: Path
) -> None:
    nowhere = tmp_path / "file"
    nowhere.write_text("")
    assert float(run(read_only_package, nowhere / "cache").stdout) == pytest.approx(2.0)


@pytest.mark.parametrize("folder", ["physics", "elsewhere/deeper"])
def test_a_kernel_is_compiled_anew_when_what_it_uses_has_changed(
    read_only_package: Path, tmp_path: Path, folder: str
) -> None:
    # outer() calls inner(), which uses a constant of a third module; they may be in any folder.
    kernels = read_only_package / "tetra_drake" / folder
    kernels.mkdir(parents=True, exist_ok=True)
    name = f"tetra_drake.{folder.replace('/', '.')}"
    begin = "from tetra_drake.physics.compiling import compiled\n"
    (kernels / "constant.py").write_text("VALUE = 1.0\n")
    (kernels / "inner.py").write_text(
        f"{begin}from {name}.constant import VALUE\n@compiled\ndef inner():\n    return VALUE\n"
    )
    (kernels / "outer.py").write_text(
        f"{begin}from {name}.inner import inner\n@compiled\ndef outer():\n    return inner()\n"
    )
    program = f"from {name}.outer import outer;print(outer(), sum(outer.stats.cache_hits.values()))"
    cache_home = tmp_path / "cache"
    cache_home.mkdir()
    if folder != "physics":  # keeps numba from writing beside the sources, as there
        (kernels / "__pycache__").write_text("in the way")

    def value_and_hits() -> list[str]:
        return run(read_only_package, cache_home, program).stdout.split()

    assert value_and_hits() == ["1.0", "0"]
    assert value_and_hits() == ["1.0", "1"]
    (kernels / "constant.py").write_text("VALUE = 2.0\n")
    assert value_and_hits() == ["2.0", "0"]
