"""The benchmark: its tables on short simulations of few gaits."""

import benchmark
from helpers.converged import shortly

FEW = {"GAITS": 2, "BATCHES": (1, 2), "GROUND_BATCH": 1, "CONTROLLED": (2,), "ROUNDS": 1}


def test_every_engine_and_ground_is_measured(scenario, monkeypatch, capsys):
    only = {"available_cores": lambda: 1, "installed": lambda: False}  # no MuJoCo
    for name, value in (FEW | only).items():
        monkeypatch.setattr(benchmark, name, value)
    benchmark.main([], shortly(scenario, 0.1, robot__tetrahedra=3))
    tables = [table.splitlines()[2:] for table in capsys.readouterr().out.strip().split("\n\n")]
    cells = [[line.strip("| ").split("|") for line in table] for table in tables]
    engines, batches, grounds, controlled = cells
    assert [row[0].strip() for row in engines] == ["`!Drake {}`", "`!Compiled {}`"]
    assert all(0.0 <= float(row[2]) <= float(row[3]) < 0.05 for row in engines)
    assert (len(batches), len(batches[0]), len(grounds), len(controlled)) == (1, 3, 4, 6)
    assert all(float(row[1].replace(",", "")) > 0.0 for table in cells for row in table)


def test_cost_is_measured_by_size(scenario, monkeypatch, capsys):
    short = {"simulation.duration": 0.1, "simulation.steady_from": 0.05}
    few = {"SIZES": (2,), "SIDES": (2,), "LARGEST_DIAGRAM": 2, "SHORT": short}
    for name, value in few.items():
        monkeypatch.setattr(benchmark, name, value)
    benchmark.main(["sizes"], shortly(scenario, 0.1))
    lines = [line for line in capsys.readouterr().out.splitlines()[2:] if line]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert [row[:2] for row in rows] == [["row", "2"], ["mast", "2"], ["lattice", "12"]]
    assert all(float(cell) > 0.0 for row in rows for cell in row[2:4])
    assert [bool(row[4]) for row in rows] == [True, True, False]
