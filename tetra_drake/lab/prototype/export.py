"""Export of a gait for a prototype: commands, expected motion, loads on the actuators."""

from __future__ import annotations

import math
import numbers
import tempfile
from importlib import resources
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError, SimulationFailure, check_type
from tetra_drake.files import check_folder, given_path, write_whole
from tetra_drake.formatting import fixed, sentence
from tetra_drake.laws import actuator
from tetra_drake.laws.cable import CableLaw, law_of
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.command import Command
from tetra_drake.robot.command_file import command_text, load_command, table_text
from tetra_drake.robot.gait_file import GivenGait, given_gait
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.robot.remarks import stillness_remark
from tetra_drake.robot.structure import Structure
from tetra_drake.scenario.load import GivenScenario, given_scenario, save_scenario

COMMAND, EXPECTED, LIMITS_FILE = "command.csv", "expected.csv", "limits.csv"
README = "README.md"

LEAST_RATE = 1000.0
"""Least sampling rate (Hz) for finding peaks. The rate of the files may be lower."""

_TOLERANCE = 1e-9
"""Distance (m or N) from a limit that still counts as at the limit. Without it, the tension of a
motor would never be at its limit."""


class Loads(NamedTuple):
    """Loads on the actuators of the driven cables in a simulation."""

    commands: np.ndarray
    """Setpoints (times, driven cables); samples of a Command."""
    limited: np.ndarray
    """1 where a limit binds, otherwise 0 (times, driven cables); NaN without limits."""
    table: pandas.DataFrame
    """A row per driven cable, with units in the names of the columns: peaks and means over the
    steady stretch, as in the metrics; lengths over the whole motion. Limits that do not exist are
    NaN. Forces and lengths are as in laws.actuator.Exertion."""


def export(
    scenario: GivenScenario, gait: GivenGait, out: str | Path, *, rate: float = 100.0
) -> str:
    """Simulates a gait and writes it as commands for the actuators of a prototype. Returns the
    verdict, a text.

        >>> print(td.export(td.load_scenario("quick"), "gait.json", "prototype"))

    The verdict has the loads on the actuators, whether the actuators can bear them, and the
    distance that the robot walks if the written commands are simulated. For a policy, or a gait
    with feedback, the commands are recorded in this one simulation; the prototype's sensors do not
    change them.

    Args:
        scenario: a scenario, its name or file, or a run.
        gait: a gait, its file, or a run; a run means its best gait.
        out: the new folder. See the command `tetra-drake export` for its files.
        rate: samples per second (Hz) in the files, at most one per `cpg.listing_step`. The
            duration of the simulation must be a whole number of samples.

    Raises:
        InputError: if an argument cannot be used.
        SimulationFailure: if the simulation of the gait fails.
    """
    scenario = given_scenario(scenario)
    scenario, gait = with_body(scenario, given_gait(gait, scenario))
    check_type("export", "rate", rate, numbers.Real)
    most, duration = 1.0 / scenario.cpg.listing_step, scenario.simulation.duration
    in_range, periods = 0.0 < rate <= most * (1.0 + 1e-9), duration * rate
    if not in_range or abs(periods - round(periods)) > 1e-6 * periods:
        expected = f"at most {most:g} Hz, and a whole number of samples in {duration:g} s"
        raise InputError("export", "rate", f"found {rate:g} Hz, expected {expected}")
    out = given_path(out, "export", "out")
    check_folder(out)
    if out.exists():
        raise InputError(out, "", "exists, expected a new folder")
    refinement = math.ceil(LEAST_RATE / rate)
    finely = scenario.with_numbers({"simulation.sample_period": 1.0 / (rate * refinement)})
    result = simulate(scenario=finely, gait=gait, record=True)
    robot, motion = result.robot, result.trajectory.isel(time=slice(None, None, refinement))
    loads = actuator_loads(result)
    # A policy acts at an instant; what it commands is there a moment later.
    first = 0 if scenario.policy is None else 1
    command = Command(gait.name, 1.0 / rate, loads.commands[first::refinement])
    axes = [f"{node} {axis}_mm" for node in robot.structure.node_names for axis in "xyz"]
    positions = 1e3 * motion.p_WN.values.reshape(-1, len(axes))
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}-") as temporary:
        folder = Path(temporary) / out.name
        write_whole(folder / COMMAND, command_text(robot, command))
        write_whole(folder / EXPECTED, table_text(axes, motion.time.values, positions))
        write_whole(folder / LIMITS_FILE, loads.table.to_csv(float_format="%.6g"))
        save_scenario(folder, scenario)

        try:
            played = simulate(scenario, command=load_command(folder / COMMAND, scenario))
            outcome = f"robot goes {_distance(played)}"
        except SimulationFailure as failure:
            outcome = str(failure)
        verdict = f"{load_verdict(loads, result)}\nPlayed from {COMMAND}, the {outcome}; "
        verdict += f"the gait itself goes {_distance(result)}."
        if still := stillness_remark(robot, vars(result.metrics)):
            verdict += f"\n{sentence(still)}"
        if scenario.policy is not None or scenario.cpg.feedback:
            warning = "the commands were recorded in a closed loop; played from a file, they"
            verdict += f"\nWarning: {warning} do not react to what the prototype does."
        template = resources.files("tetra_drake") / "lab/prototype/README.template.md"
        about = {"gait": gait.name, "scenario": scenario.name, "rate": rate, "verdict": verdict}
        write_whole(folder / README, template.read_text("utf-8").format(**about))
        folder.rename(out)
    return verdict


def actuator_loads(result: SimulationResult) -> Loads:
    """Loads on the actuators in a simulation with a trajectory: forces, speeds, travel and power of
    each driven cable, and at which times a limit of the actuator binds."""
    robot, trajectory = result.robot, result.trajectory
    kind, constants = robot.scenario.actuation, robot.model.actuator
    cables, limits = robot.structure.cables[robot.driven], actuator.limits_of(constants)
    walk = trajectory.isel(cable=robot.driven)
    law, length, tension = CableLaw.of(cables), walk.length.values, walk.tension.values
    signal = trajectory.signal.values[:, cables["signal"]]
    rate = _length_rates(robot.structure, trajectory.p_WN.values, trajectory.v_WN.values)
    rate = rate[:, robot.driven]
    driven = actuator.DrivenCables(law, signal, length, rate, tension, walk.free_length.values)

    load, left, drives = tension, length, kind.drives(driven)
    limited = np.full_like(length, math.nan)
    if actuator.has_drive(constants):
        pull = np.vectorize(
            lambda number, *motion: actuator.actuator_force(
                constants, *motion, law_of(robot.model.cables, number)
            )
        )
        numbers, drawn = robot.driven, drives + _TOLERANCE
        _, _, drive_rate, limited, beside = pull(numbers, drawn, length, rate, signal)
        load, left = tension - beside, actuator.wound(constants, drives, length)
        rate = actuator.wound(constants, drive_rate, rate)

    assert result.tally  # the result is from a simulation
    effort, begins = result.tally.effort, result.tally.begins[0]
    power, steady = -load * rate, trajectory.time.values >= begins
    # Means of tables are NaN without samples: a simulation may end before its steady stretch.
    work, time = (pandas.DataFrame(x[steady]) for x in (np.maximum(power, 0.0), limited))
    columns = {
        "peak_force_N": effort.peak_force[robot.driven],
        "limit_of_force_N": limits.max_force,
        "peak_speed_mm_per_s": 1e3 * effort.peak_speed[robot.driven],
        "limit_of_speed_mm_per_s": 1e3 * limits.max_speed,
        "travel_mm": 1e3 * np.ptp(left, axis=0),
        "least_length_mm": 1e3 * left.min(axis=0),
        "limit_of_length_mm": 1e3 * limits.least_length,
        "peak_power_W": effort.peak_power[robot.driven],
        "limit_of_power_W": 0.25 * limits.max_force * limits.max_speed,  # at half limits
        "mean_power_W": work.mean().to_numpy(),
        "time_at_a_limit_percent": 100.0 * time.mean().to_numpy(),
    }
    table = pandas.DataFrame(columns, index=walk.cable.to_index())
    return Loads(kind.commands(driven), limited, table)


def load_verdict(loads: Loads, result: SimulationResult) -> str:
    """Text about the loads on the actuators in a simulation: greatest loads, limits, and whether
    the actuators can play the gait without reaching a limit. `result` is the recorded simulation
    from which the loads were computed."""
    worst = loads.table.drop(columns="time_at_a_limit_percent").max()
    worst["least_length_mm"] = loads.table["least_length_mm"].min()
    table = worst.dropna().to_string(float_format=fixed)
    if np.isnan(loads.limited).any():
        return f"{table}\nNo motor is given: one that plays this must bear these loads."
    if not loads.limited.any():
        return f"{table}\nThe actuators can play it: no limit binds."
    first, cable = np.argwhere(loads.limited)[0]
    time, name = result.trajectory.time.values[first], loads.table.index[cable]
    share = fixed(100.0 * result.metrics.actuator_limited)
    return (
        f"{table}\nThe actuators cannot play all of it: a limit binds first at {time:.3f} s "
        f"({name}), and {share} % of the steady stretch, mean of all actuators."
    )


def _distance(result: SimulationResult) -> str:
    units = result.scenario.units
    distance = fixed(result.metrics.distance / units.length, units.decimals + 1)
    return f"{distance} {units.length_name}"


def _length_rates(structure: Structure, p_WN: np.ndarray, v_WN: np.ndarray) -> np.ndarray:
    """Rates (times, cables) of the cables' lengths in m/s, from positions and velocities of the
    nodes (times, nodes, 3) in m and m/s."""
    ends = structure.segments.ends
    p_AB, v_AB = (x[:, ends[:, 1]] - x[:, ends[:, 0]] for x in (p_WN, v_WN))
    rates = np.zeros((len(structure.cable_names), len(p_WN)))
    of_pieces = (p_AB * v_AB).sum(axis=2) / np.linalg.norm(p_AB, axis=2)
    np.add.at(rates, structure.segments.cable, of_pieces.T)
    return rates.T
