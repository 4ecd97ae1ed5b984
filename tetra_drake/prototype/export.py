"""A gait as a folder for a prototype: commands, expected motion, and the load on each actuator.

command.csv       what each actuator shall do
expected.csv      positions of the nodes
limits.csv        force, speed, travel and power of each actuator, against its limits
scenario.yaml     the scenario in full
README.md         what these are, how to start, and the verdict
"""

from __future__ import annotations

import math
from importlib import resources
from pathlib import Path

import numpy as np

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import whole_folder
from tetra_drake.formatting import fixed
from tetra_drake.physics.actuator import DIRECT, TENSION_MOTOR, WINCH
from tetra_drake.prototype.command_file import command_text, parse_command, table_text
from tetra_drake.prototype.loads import Loads
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

_MEANINGS = {
    DIRECT: ("the force that is superimposed on it, in N, positive where it pulls", "the cable"),
    WINCH: ("its free length, in mm", "the free length"),
    TENSION_MOTOR: ("its tension, in N", "the cable"),
}
"""What a command is by kind of actuators, and what they wind."""


def export(scenario: Scenario, gait: Gait, *, rate: float, out: str | Path) -> str:
    """Simulates a gait and writes the folder `out` with its commands, `rate` (Hz) samples a second.

    Returns the verdict: what the actuators have to do, whether they can, and how far the simulation
    of exactly the written commands goes. With feedback, commands are the signals of this one walk.
    Raises InputError, and SimulationFailure if the gait's own simulation fails.
    """
    samples = _samples(scenario, rate)
    with whole_folder(out) as folder:
        each = math.ceil(LEAST_RATE / rate)
        finely = scenario.simulation.model_copy(update={"sample_period": 1.0 / (rate * each)})
        recorded = scenario.with_sections(simulation=finely)
        result = simulate(scenario=recorded, gait=gait, record=True)
        assert result.trajectory is not None
        robot, trajectory = Robot.of(scenario), result.trajectory
        loads = Loads.of(robot, trajectory)
        command = Command(gait.name, 1.0 / rate, loads.commands[::each])
        text = command_text(robot, command)
        verdict = f"{loads.verdict()}\n{_played(scenario, text, result.metrics.distance)}"
        nodes = trajectory.p_WN.values[::each].reshape(samples, -1)
        axes = [f"{node} {axis}_mm" for node in robot.structure.node_names for axis in "xyz"]
        meaning, wound = _MEANINGS[robot.model.actuator.kind]
        page = resources.files("tetra_drake") / "prototype/README.template.md"
        readme = page.read_text(encoding="utf-8").format(
            name=gait.name,
            scenario=scenario.name,
            rate=rate,
            meaning=meaning,
            wound=wound,
            start_up=scenario.cpg.start_up,
            verdict=verdict,
        )
        (folder / COMMAND).write_text(text)
        (folder / EXPECTED).write_text(table_text(axes, np.arange(samples) / rate, 1e3 * nodes))
        (folder / LIMITS).write_text(loads.text())
        (folder / SCENARIO).write_text(dump_scenario(scenario))
        (folder / README).write_text(readme)
    return verdict


def _samples(scenario: Scenario, rate: float) -> int:
    """Number of samples at a rate (Hz); InputError for a rate at which nothing can be exported."""
    most, duration = 1.0 / scenario.cpg.listing_step, scenario.simulation.duration
    if not 0.0 < rate <= most * (1.0 + 1e-9):
        problem = f"found {rate:g} Hz, expected more than 0 and at most {most:g} Hz"
        raise InputError("--rate", "", problem)
    periods = round(duration * rate)
    if periods < 1 or abs(periods - duration * rate) > 1e-6 * periods:
        problem = f"found {rate:g} Hz, expected a whole number of samples in {duration:g} s"
        raise InputError("--rate", "", problem)
    return periods + 1


def _played(scenario: Scenario, text: str, distance: float) -> str:
    """How far the simulation of a command file goes, beside the gait's own distance (m)."""
    own = f"the gait itself goes {fixed(distance / INCH)} in"
    command = parse_command(text, Robot.of(scenario), source=COMMAND)
    try:
        played = simulate(scenario=scenario, command=command).metrics.distance_in
    except SimulationFailure as failure:
        return f"Played from {COMMAND}, the {failure}; {own}."
    return f"Played from {COMMAND}, the robot goes {fixed(played)} in; {own}."
