"""A Drake model of walking tensegrity robots driven by a Matsuoka central pattern generator.

    >>> import tetra_drake as td
    >>> scenario = td.load_scenario("quick").with_changes({"robot.tetrahedra": 7})
    >>> run = td.evolve(scenario, "runs/mine", overwrite=True)
    >>> result = td.simulate(scenario, run.best_gait(), record=True)
    >>> print(result)
    >>> print(f"{result.trajectory.tension.sel(cable_bodies='T1-T2').max():.2f} N")
    >>> result.show()  # in a notebook
    >>> metrics = td.sweep(scenario, run.gaits(), {"robot.cables.outer_stiffness": ["30 N/m"]})

Functions, and the main attributes of their results:

    load_scenario       with_changes({key: value}), to_yaml()
    load_gait           a gait from a file
    seeded_gait         a random gait
    simulate            metrics, trajectory (an xarray.Dataset, with record=True), show(),
                        save_replay(file)
    simulate_many       simulates many gaits on all cores
    ParameterSpace      the vectors of a scenario's gaits, for an optimiser of your own
    sweep               metrics of gaits on a grid of changed scenarios, an xarray.Dataset
    load_result         the result in a folder of the command `tetra-drake simulate`
    evolve, load_run    best_gait(), gaits(), scenario; evaluations, iterations (pandas tables)
    Simulation          robots in control periods: reset(), step(actions), state
    fit                 values of scenario keys that meet measurements: parameters, scenario
    MotionCapture, Rest measurements for fit(): motion over time; shape, tensions, frequencies
    robustness          how far gaits walk on disturbed robots
    compare             how well runs search, with intervals
    study_equilibrium   shape, tensions, self-stress, frequencies and modes at rest
    export              writes a gait as commands for the actuators of a prototype
    prepare             compiles everything once, so that nothing later waits
    load_command        commands for actuators from a file, for simulate(scenario, command=...)

Figures are functions in tetra_drake.figures: gait_diagram(result) from
tetra_drake.figures.gait_diagram makes a figure, gait_diagram(result, figure=own) draws on your
Figure or SubFigure.

print() shows a summary of a scenario, gait, run, result or result.metrics. Numbers are in SI, if
their names have no other unit, such as result.metrics.distance_in. Wrong input raises an
InputError: a ValueError with a message of one line.

Each name is imported at its first use, so `import tetra_drake` loads neither Drake nor numba.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tetra_drake.analysis.comparison import compare as compare
    from tetra_drake.analysis.equilibrium import study_equilibrium as study_equilibrium
    from tetra_drake.analysis.measurements import MotionCapture as MotionCapture
    from tetra_drake.analysis.measurements import Rest as Rest
    from tetra_drake.analysis.robustness import robustness as robustness
    from tetra_drake.analysis.sweep import sweep as sweep
    from tetra_drake.engines.preparation import prepare as prepare
    from tetra_drake.engines.simulate import simulate as simulate
    from tetra_drake.engines.simulate import simulate_many as simulate_many
    from tetra_drake.engines.simulation import Simulation as Simulation
    from tetra_drake.evolution.run import load_run as load_run
    from tetra_drake.experiment import evolve as evolve
    from tetra_drake.experiment import fit as fit
    from tetra_drake.prototype.command_file import load_command as load_command
    from tetra_drake.prototype.export import export as export
    from tetra_drake.report.result_folder import load_result as load_result
    from tetra_drake.robot.gait import ParameterSpace as ParameterSpace
    from tetra_drake.robot.gait import load_gait as load_gait
    from tetra_drake.robot.gait import seeded_gait as seeded_gait
    from tetra_drake.scenario.load import load_scenario as load_scenario

__version__ = "0.4.0"

_HOMES = {
    "Simulation": "tetra_drake.engines.simulation",
    "MotionCapture": "tetra_drake.analysis.measurements",
    "ParameterSpace": "tetra_drake.robot.gait",
    "Rest": "tetra_drake.analysis.measurements",
    "compare": "tetra_drake.analysis.comparison",
    "evolve": "tetra_drake.experiment",
    "export": "tetra_drake.prototype.export",
    "fit": "tetra_drake.experiment",
    "load_command": "tetra_drake.prototype.command_file",
    "load_gait": "tetra_drake.robot.gait",
    "load_result": "tetra_drake.report.result_folder",
    "load_run": "tetra_drake.evolution.run",
    "load_scenario": "tetra_drake.scenario.load",
    "prepare": "tetra_drake.engines.preparation",
    "robustness": "tetra_drake.analysis.robustness",
    "seeded_gait": "tetra_drake.robot.gait",
    "simulate": "tetra_drake.engines.simulate",
    "simulate_many": "tetra_drake.engines.simulate",
    "study_equilibrium": "tetra_drake.analysis.equilibrium",
    "sweep": "tetra_drake.analysis.sweep",
}

__all__ = ["__version__", *_HOMES]


if not TYPE_CHECKING:  # a type checker refuses names that are not imported above

    def __getattr__(name: str) -> Any:
        if name not in _HOMES:
            raise AttributeError(f"module 'tetra_drake' has no attribute '{name}'")
        return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
