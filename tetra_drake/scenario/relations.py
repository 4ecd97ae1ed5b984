"""Rules between the sections of a scenario: the balanced spacing, and what cannot go together."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tetra_drake.errors import InputError
from tetra_drake.scenario.cable_names import SIDES, mirrored
from tetra_drake.scenario.disturbances import separate
from tetra_drake.scenario.optimizer_kinds import SteadyState
from tetra_drake.scenario.sections import hint

if TYPE_CHECKING:
    from tetra_drake.scenario.schema import CableSection, RobotSection, Scenario

MOST_SIGNALS_OF_DRAKE, MOST_SIGNALS = 20_000_000, 100_000_000
"""Upper limits of the values of all signals in one simulation: some 3 GB."""

MOST_SAMPLES = 2_000_000
"""Upper limit of the recorded poses of all tetrahedra in one simulation: some 2 GB."""


def balanced_spacing(robot: RobotSection, cables: CableSection, source: object) -> float:
    """The spacing (m) at which the cables of a junction balance along x.

    Three outer cables of length s pull two tetrahedra together. Three inner ones, from a tip at
    height h to base nodes at s along and R across, push them apart while s < h. Raises InputError
    if there is no such spacing.
    """
    height, radius = robot.strut_length * math.sqrt(2.0 / 3.0), robot.strut_length / math.sqrt(3.0)

    def pull(s: float) -> float:
        length = math.hypot(radius, height - s)
        inner = cables.inner_stiffness * (length - cables.free_length) * (height - s) / length
        return cables.outer_stiffness * (s - cables.free_length) - inner

    near, far = 0.0, height + cables.free_length
    if pull(near) >= 0.0:
        raise InputError(source, "robot.spacing", "the cables balance at no spacing; give one")
    while near < (middle := 0.5 * (near + far)) < far:
        near, far = (near, middle) if pull(middle) > 0.0 else (middle, far)
    return far


def check_relations(scenario: Scenario, source: object) -> None:
    """Raises InputError where settings of different sections cannot go together."""
    if not scenario.objective:
        raise InputError(source, "objective", "found no metric, expected one at least")
    step, duration = scenario.cpg.listing_step, scenario.simulation.duration
    if step > duration:
        problem = f"found {step} s, expected at most the duration, {duration} s"
        raise InputError(source, "cpg.listing_step", problem)
    evaluations, population = scenario.evolution.evaluations, scenario.evolution.population
    if isinstance(scenario.optimizer, SteadyState) and evaluations < population:
        problem = f"found {evaluations}, expected at least the population, {population}"
        raise InputError(source, "evolution.evaluations", problem)
    if "load" in scenario.cpg.feedback and scenario.robot.gravity == 0.0:
        problem = "found 0 m/s^2, expected a weight, for feedback of the load"
        raise InputError(source, "robot.gravity", problem)
    _check_size(scenario, source)
    _check_sides(scenario, source)
    _check_disturbances(scenario, source)


def _check_size(scenario: Scenario, source: object) -> None:
    """Raises InputError for what does not fit in memory."""
    simulation = scenario.simulation
    most_signals = MOST_SIGNALS_OF_DRAKE if simulation.engine == "drake" else MOST_SIGNALS
    per_signal = simulation.duration * scenario.oscillators / most_signals
    per_sample = simulation.duration * scenario.robot.tetrahedra / MOST_SAMPLES
    periods = {
        "cpg.listing_step": (scenario.cpg.listing_step, per_signal),
        "simulation.sample_period": (simulation.sample_period, per_sample),
    }
    if simulation.engine == "mujoco":
        periods["mujoco.step"] = (scenario.mujoco.step, per_signal)
    for key, (period, least) in periods.items():
        if period < least:
            problem = (
                f"found {period} s, expected at least {least:.3g} s for this duration and robot"
            )
            raise InputError(source, key, f"{problem}, to fit in memory")


def _check_sides(scenario: Scenario, source: object) -> None:
    """Raises InputError if gaits turn, or are mirrored, where groups of cables have no sides."""
    groups, bounds = scenario.robot.actuation, scenario.gait_bounds
    sided = any(all(cable.endswith(side) for cable in g) for g in groups for side in SIDES)
    if bounds.turn != 0.0 and not sided:
        problem = f"found {bounds.turn}, expected 0, as no group is on one side"
        raise InputError(source, "gait_bounds.turn", problem)
    sets = [set(group) for group in groups]
    for group in groups:
        if bounds.mirrored and set(mirrored(group)) not in sets:
            problem = f"found true, expected false, as {group} has no mirror image"
            raise InputError(source, "gait_bounds.mirrored", problem)


def _check_disturbances(scenario: Scenario, source: object) -> None:
    """Raises InputError if a number that draws change cannot be changed that far."""
    settings = scenario.disturbances
    if settings is None:
        return
    undisturbed = scenario.with_sections(disturbances=None)
    known = scenario.numbers()
    for joined, spread in settings.spreads.items():
        place, keys = f"disturbances.spreads.{joined}", separate(joined)
        for key in keys:
            if key not in known:
                problem = f"'{key}' is no number of the scenario; {hint(key, known)}"
                raise InputError(source, place, problem)
        for factor in (1.0 - spread, 1.0 + spread):
            changed = undisturbed.with_numbers({key: factor * known[key] for key in keys})
            try:
                type(scenario).from_tree(changed.tree, source)
            except InputError as error:
                problem = f"{spread:g} leads to a wrong {error.key}: {error.problem}"
                raise InputError(source, place, problem) from error
