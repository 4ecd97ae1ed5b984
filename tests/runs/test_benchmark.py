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


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_every_engine_and_ground_is_measured(small, tmp_path, capsys):
    (tmp_path / "quick.yaml").write_text(QUICK)
    benchmark.main([], load_scenario(tmp_path / "quick.yaml"))
    tables = [table.splitlines() for table in capsys.readouterr().out.strip().split("\n\n")]
    engines, batches, grounds, controlled = (
        [cells(line) for line in table[2:]] for table in tables
    )
    assert [row[0] for row in engines] == ["`!Drake {}`", "`!Compiled {}`"]
    for row in engines:
        speed, median, worst, evaluations = row[1:]
        assert float(speed) > 0.0 and int(evaluations.replace(",", "")) > 0
        assert 0.0 <= float(median) <= float(worst) < 0.05
    ((cores, *speeds),) = batches
    assert cores == "1" and len(speeds) == 2
    assert [float(row[1].replace(",", "")) > 0.0 for row in controlled] == [True] * 6
    assert len(grounds) == 4 and all(float(row[-1]) > 0.0 for row in grounds)


def test_an_unknown_table_is_refused(scenario, refused):
    with refused("TABLE", "", "sizes"):
        benchmark.main(["sizes"], scenario)
