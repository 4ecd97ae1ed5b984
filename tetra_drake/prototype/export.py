"""A gait as a folder for a prototype: commands, expected motion, and the load on each actuator."""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path

import numpy as np

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import whole_folder
from tetra_drake.formatting import fixed
from tetra_drake.prototype.command_file import command_text, parse_command, table_text
from tetra_drake.prototype.loads import Loads, actuator_loads
from tetra_drake.robot.command import Command
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import dump_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

COMMAND, EXPECTED, LIMITS = "command.csv", "expected.csv", "limits.csv"
SCENARIO, README = "scenario.yaml", "README.md"

LEAST_RATE = 1000.0
"""Hz: peaks are looked for at this rate at least, whatever the rate of the files."""


def export(scenario: Scenario, gait: Gait, *, rate: float, out: str | Path) -> str:
    """Simulates a gait and writes the folder `out` with its commands, `rate` (Hz) samples a second.

    Returns the verdict: what the actuators have to do, whether they can, and how far the simulation
    of exactly the written commands goes. With feedback, commands are the signals of this one walk.
    Raises InputError, and SimulationFailure if the gait's own simulation fails.
    """
    check_rate(rate, scenario)
    with whole_folder(out) as folder:
        each = math.ceil(LEAST_RATE / rate)
        finely = scenario.simulation.model_copy(update={"sample_period": 1.0 / (rate * each)})
        recorded = scenario.with_sections(simulation=finely)
        result = simulate(scenario=recorded, gait=gait, record=True)
        assert result.trajectory is not None
        robot = Robot.of(scenario)
        loads, motion = (
            actuator_loads(robot, result.trajectory),
            result.trajectory[{"time": slice(None, None, each)}],
        )
        commands = command_text(robot, Command(gait.name, 1.0 / rate, loads.commands[::each]))
        nodes = 1e3 * motion.p_WN.values.reshape(motion.time.size, -1)
        axes = [f"{node} {axis}_mm" for node in robot.structure.node_names for axis in "xyz"]
        verdict = (
            f"{load_verdict(loads, result.trajectory.time.values)}\n{_played(robot, commands)}"
        )
        verdict += f"; the gait itself goes {fixed(result.metrics.distance / INCH)} in."
        readme = resources.files("tetra_drake") / "prototype/README.template.md"
        about = {"gait": gait.name, "scenario": scenario.name, "rate": rate, "verdict": verdict}
        (folder / COMMAND).write_text(commands)
        (folder / EXPECTED).write_text(table_text(axes, motion.time.values, nodes))
        (folder / LIMITS).write_text(loads.table.to_csv(float_format="%.6g"))
        (folder / SCENARIO).write_text(dump_scenario(scenario))
        (folder / README).write_text(readme.read_text("utf-8").format(**about))
    return verdict


def check_rate(rate: float, scenario: Scenario) -> None:
    """Raises InputError for a rate (Hz) at which the scenario's gaits cannot be exported."""
    most, periods = 1.0 / scenario.cpg.listing_step, scenario.simulation.duration * rate
    if not 0.0 < rate <= most * (1.0 + 1e-9):
        problem = f"found {rate:g} Hz, expected more than 0 and at most {most:g} Hz"
        raise InputError("--rate", "", problem)
    if abs(periods - max(round(periods), 1)) > 1e-6 * periods:
        problem = f"found {rate:g} Hz, which gives {periods:g} samples, expected a whole number"
        raise InputError("--rate", "", problem)


def load_verdict(loads: Loads, times: np.ndarray) -> str:
    """The greatest loads, the limits, and whether actuators can bear the loads at times (s)."""
    worst = loads.table.max()
    worst["least_length_mm"] = loads.table["least_length_mm"].min()
    table = worst.dropna().to_string(float_format=fixed)
    if np.isnan(loads.limited).any():
        return f"{table}\nNo motor is given: one that plays this must bear these loads."
    if not loads.limited.any():
        return f"{table}\nThe actuators can play it: no limit binds."
    first, cable = np.argwhere(loads.limited)[0]
    share, name = fixed(100.0 * loads.limited.mean()), loads.table.index[cable]
    binds = f"a limit binds {share} % of the time, first at {times[first]:.3f} s ({name})"
    return f"{table}\nThe actuators cannot play it: {binds}."


def _played(robot: Robot, text: str) -> str:
    """How far the simulation of a command file goes."""
    command = parse_command(text, robot, source=COMMAND)
    try:
        result = simulate(scenario=robot.scenario, command=command)
    except SimulationFailure as failure:
        return f"Played from {COMMAND}, the {failure}"
    return f"Played from {COMMAND}, the robot goes {fixed(result.metrics.distance_in)} in"
