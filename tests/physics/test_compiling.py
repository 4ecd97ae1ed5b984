"""Where compiled kernels are kept. A copy of the package runs in a fresh process, with a plain
file where its cache folder would be: unwritable even for root."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tetra_drake

PROGRAM = (
    "from tetra_drake.physics.mode_change import first_zero;print(first_zero(1.0, -0.5, 0.0, 9.0))"
)


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A read-only installation."""
    target = tmp_path / "installed" / "tetra_drake"
    without_cache = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(tetra_drake.__file__).parent, target, ignore=without_cache)
    (target / "physics" / "__pycache__").write_text("in the way")
    return target.parent


def run(package: Path, cache_home: Path, program: str = PROGRAM) -> str:
    """What the program prints."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    environment |= {"PYTHONPATH": str(package), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"XDG_CACHE_HOME": str(cache_home), "HOME": str(cache_home)}
    command = [sys.executable, "-c", program]
    return subprocess.check_output(command, env=environment, cwd=package, text=True)


@pytest.mark.parametrize(("folder", "caches"), [("cache", True), ("file/cache", False)])
def test_a_read_only_installation_caches_in_the_users_folder_if_it_can(
    package, tmp_path, folder, caches
):
    (tmp_path / "file").write_text("")
    assert float(run(package, tmp_path / folder)) == pytest.approx(2.0)
    assert any(tmp_path.rglob("mode_change.first_zero*.nbi")) == caches


@pytest.mark.parametrize("folder", ["physics", "elsewhere/deeper"])
def test_a_kernel_is_compiled_anew_when_what_it_uses_has_changed(package, tmp_path, folder):
    # outer() calls inner(), which uses a constant of a third module; they may be in any folder.
    kernels = package / "tetra_drake" / folder
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
    if folder != "physics":  # keeps numba from writing beside the sources, as there
        (kernels / "__pycache__").write_text("in the way")

    def value_and_hits() -> list[str]:
        return run(package, tmp_path / "cache", program).split()

    assert value_and_hits() == ["1.0", "0"]
    assert value_and_hits() == ["1.0", "1"]
    (kernels / "constant.py").write_text("VALUE = 2.0\n")
    assert value_and_hits() == ["2.0", "0"]
