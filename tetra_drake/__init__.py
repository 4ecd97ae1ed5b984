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
                        save_replay(file), save_video(file)
    simulate_many       simulates many gaits on all cores
    ParameterSpace      the vectors of a scenario's gaits, for an optimiser of your own
    sweep               metrics of gaits on a grid of changed scenarios, an xarray.Dataset
    load_result         the result in a folder of the command `tetra-drake simulate`
    evolve, load_run    best_gait(), gaits(), scenario; evaluations, iterations (pandas tables)
    Simulation          robots in control periods: reset(), step(actions), state; save(), restore()
    Planner             controller that plans by sampled motions: simulate(controller=planner)
    States              saved states of a simulation, also in files
    fit                 values of scenario keys that meet measurements: parameters, scenario
    predict             medians and intervals of any quantity, from tolerances of a robot's numbers
    MotionCapture, Rest measurements for fit(): motion over time; shape, tensions, frequencies
    robustness          how far gaits walk on disturbed robots
    spread              ranges of a gait's metrics for starts moved by 1 nm to 1e-7 m
    compare             how well runs search, with intervals
    form_find           free lengths for a wanted shape and prestress (force densities)
    study_equilibrium   shape, tensions, self-stress, frequencies and modes at rest
    linearize           Drake's LinearSystem of small motions: system, modes(), lqr(), controller()
    export              writes a gait as commands for the actuators of a prototype
    prepare             compiles everything once, so that nothing later waits
    load_command        commands for actuators from a file, for simulate(scenario, command=...)

Figures are functions in tetra_drake.figures: gait_diagram(result) from
tetra_drake.figures.gait_diagram makes a figure, gait_diagram(result, figure=own) draws on your
Figure or SubFigure.

print() shows a summary of a scenario, gait, run, result or result.metrics. Numbers are in SI, if
their names have no other unit, such as result.metrics.distance_in. Wrong input raises an
InputError: a ValueError with a message of one line.

Each name is imported at its first use, so `import tetra_drake` loads neither Drake nor numba. The
names and their modules are in `__init__.pyi`, which type checkers read, too.
"""

from __future__ import annotations

from pathlib import Path

from tetra_drake.on_demand import attributes

__version__ = "0.6.0"

_NAMES, __getattr__, __dir__ = attributes(__name__, Path(__file__))

__all__ = ["__version__", *_NAMES]
