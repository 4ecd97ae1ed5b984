"""The benchmark: its tables on short simulations of few gaits."""

import benchmark
import pytest

from tetra_drake.scenario.load import load_scenario

QUICK = """
base: thesis
name: quick
robot: {tetrahedra: 3}
cpg: {start_up: 0.05 s}
simulation: {duration: 0.1 s, steady_from: 0.05 s}
"""


@pytest.fixture
def small(monkeypatch):
    """One core and one gait at a time, measured once; no MuJoCo."""
    monkeypatch.setattr(benchmark, "available_cores", lambda: 1)
    monkeypatch.setattr(benchmark, "installed", lambda: False)
    few = {"GAITS": 2, "BATCHES": (1, 2), "GROUND_BATCH": 1, "CONTROLLED": (2,), "ROUNDS": 1}
    for name, value in few.items():
        monkeypatch.setattr(benchmark, name, value)


def test_every_engine_and_ground_is_measured(small, tmp_path, capsys):
    (tmp_path / "quick.yaml").write_text(QUICK)
    benchmark.main([], load_scenario(tmp_path / "quick.yaml"))
    tables = [table.splitlines() for table in capsys.readouterr().out.strip().split("\n\n")]
    engines, batches, grounds, controlled = (
        [[cell.strip() for cell in line.strip("|").split("|")] for line in table[2:]]
        for table in tables
    )
    assert [row[0] for row in engines] == ["`!Drake {}`", "`!Compiled {}`"]
    assert all(0.0 <= float(row[2]) <= float(row[3]) < 0.05 for row in engines)
    assert (len(batches), len(batches[0]), len(grounds), len(controlled)) == (1, 3, 4, 6)
    measured = [cell for row in (*engines, *batches, *grounds, *controlled) for cell in row[1:2]]
    assert all(float(speed.replace(",", "")) > 0.0 for speed in measured)
