"""The benchmark: its tables on short simulations of few gaits."""

import benchmark
from helpers.converged import shortly

FEW = {"gaits": 2, "batches": (1, 2), "controlled": (2,), "rounds": 1}


def test_every_engine_and_ground_is_measured(scenario, monkeypatch, capsys):
    only = {"available_cores": lambda: 1, "installed": lambda: False}  # no MuJoCo
    for name, value in only.items():
        monkeypatch.setattr(benchmark, name, value)
    monkeypatch.setattr(benchmark, "GIVEN", benchmark.GIVEN | FEW)
    benchmark.main([], shortly(scenario, 0.1, robot__tetrahedra=3))
    tables = [table.splitlines()[2:] for table in capsys.readouterr().out.strip().split("\n\n")]
    cells = [[line.strip("| ").split("|") for line in table] for table in tables]
    engines, batches, controlled = cells
    assert [[cell.strip() for cell in row[:2]] for row in engines] == [
        ["`!Drake {}`", ""],
        ["`!Compiled {}`", ""],
        ["`!Compiled {}`", "rough"],
        ["`!Drake {}`", "rough"],
        ["`!Drake {}`", "live network"],
    ]
    assert all(0.0 <= float(row[3]) <= float(row[4]) < 0.05 for row in engines)
    assert all(float(row[2]) > 0.0 for row in engines)
    assert (len(batches), len(batches[0]), len(controlled)) == (1, 3, 6)
    assert all(float(row[1].replace(",", "")) > 0.0 for row in batches + controlled)


def test_parameters_are_faster_than_a_diagram_for_each_robot(scenario, monkeypatch, capsys):
    monkeypatch.setitem(benchmark.GIVEN, "candidates", 4)
    benchmark.main(["candidates"], scenario)
    lines = [line for line in capsys.readouterr().out.splitlines()[2:] if line]
    own, shared = (float(line.split("|")[2]) for line in lines)
    assert own > 10.0 * shared
