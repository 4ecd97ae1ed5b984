"""The benchmark: its tables on short simulations of few gaits."""

from itertools import product

import benchmark
from helpers.converged import shortly
from pydrake.systems.analysis import GetIntegrationSchemes

from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot

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


def test_cost_is_measured_by_size(scenario, monkeypatch, capsys):
    short = {"simulation.duration": "0.1 s", "simulation.steady_from": "50 ms"}
    few = {"sizes": {"row": [2], "mast": [2], "lattice": [2]}, "most_on_diagram": 2}
    monkeypatch.setattr(benchmark, "GIVEN", benchmark.GIVEN | few | {"on_diagram": short})
    benchmark.main(["sizes"], shortly(scenario, 0.1))
    lines = [line for line in capsys.readouterr().out.splitlines()[2:] if line]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert [row[:2] for row in rows] == [["row", "2"], ["mast", "2"], ["lattice", "12"]]
    assert all(float(cell) > 0.0 for row in rows for cell in row[2:4])
    assert [bool(row[4]) for row in rows] == [True, True, False]


def test_all_schemes_of_drake_are_measured(scenario, monkeypatch, capsys):
    moment = {"simulation.duration": "10 ms", "simulation.steady_from": "5 ms"}
    monkeypatch.setitem(benchmark.GIVEN["schemes"], "moment", moment)
    benchmark.main(["schemes"], scenario)
    rows = [
        line.strip("| ").split("|") for line in capsys.readouterr().out.splitlines()[2:] if line
    ]
    cells = [[cell.strip() for cell in row] for row in rows]
    fixed = benchmark.GIVEN["schemes"]["fixed_steps"]
    robots, schemes = ["`thesis`", "`six_bar`"], [f"`{one}`" for one in GetIntegrationSchemes()]
    assert [row[:2] for row in cells] == [list(pair) for pair in product(robots, schemes)]
    for _, scheme, setting, failure, error_mm, *_ in cells:
        assert setting.startswith("step") == (scheme.strip("`") in fixed)
        assert not failure
        assert float(error_mm) < 1.0


def test_a_scheme_that_fails_says_why(scenario):
    robot, gait = Robot.of(scenario), seeded_gait(scenario, 0)
    p_WB = robot.structure.p_WB
    _, failure, error_mm, *_ = benchmark.tried(robot, gait, "explicit_euler", p_WB, step=2e-3)
    assert "too large" in failure and not error_mm


def test_parameters_are_faster_than_a_diagram_for_each_robot(scenario, monkeypatch, capsys):
    monkeypatch.setitem(benchmark.GIVEN, "candidates", 4)
    benchmark.main(["candidates"], scenario)
    lines = [line for line in capsys.readouterr().out.splitlines()[2:] if line]
    own, shared = (float(line.split("|")[2]) for line in lines)
    assert own > 10.0 * shared
