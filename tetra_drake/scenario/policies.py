"""Policies: closed loops in place of an oscillator network, whose parameters evolution searches.

A policy is a function from the readings of robots and its parameters to the signals of their
actuators, one for each driven cable. It acts once in each `simulation.control_period`, from t = 0
on; its signals are held in between. To add a kind, write a section with parameters() and signals().
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from tetra_drake.errors import InputError, check_type, checked_numbers
from tetra_drake.laws.actuator import ActuatorKind, DrivenCables
from tetra_drake.laws.oscillator import GaitParameter
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.settings.plugins import origin
from tetra_drake.settings.section import Kinds, Section

PolicyBounds = tuple[float, float]
"""Least and greatest value of a parameter in random policies."""


class DrivenRobots(NamedTuple):
    """Constants of N robots that a policy knows, in SI units. Driven cables are in the order of the
    actuators."""

    actuation: ActuatorKind
    """Kind of the actuators."""
    ends: np.ndarray
    """Indices of the two end nodes of each driven cable (driven, 2)."""
    cables: DrivenCables
    """Driven cables at the start, arrays (N, driven)."""
    rest: np.ndarray
    """Setpoints (N, driven) of the actuators at the start, where the robots rest: forces, free
    lengths or tensions by the kind of actuators."""
    amplitude: np.ndarray
    """Usual amplitudes (N,) of the signals of an oscillator network, which `cpg.gain` sets."""
    lengths: np.ndarray
    """Lengths of all cables at the start (N, cables)."""
    weight: np.ndarray
    """Weights (N,)."""
    size: np.ndarray
    """Lengths of the first strut (N,)."""

    def signals_of(self, setpoints: np.ndarray) -> np.ndarray:
        """Signals (N, driven) in N from setpoints of the actuators."""
        return np.asarray(self.actuation.signals(setpoints, self.cables.law), dtype=float)

    def as_given(self, signals: np.ndarray) -> np.ndarray:
        """Signals (N, driven) in N for robots without a network, from signals like a network's. For
        motors that imitate a cable's spring, they are the whole tension at the start's length."""
        if not self.actuation.plays_cable:
            return signals
        return np.asarray(self.actuation.commands(self.cables._replace(signal=signals)))


class PolicyKind(Section):
    """Base class for the settings of a policy."""

    @property
    def code(self) -> str:
        """Function outside the package that the policy runs; "" for none."""
        return ""

    def parameters(self, blueprint: Blueprint) -> Mapping[str, PolicyBounds]:
        """Names of the policy's parameters for a robot, with their bounds in random policies. A
        search may leave the bounds."""
        raise NotImplementedError

    def gait_parameters(self, blueprint: Blueprint) -> Mapping[str, GaitParameter]:
        """The same as parameters of a gait."""
        found, source, given = {}, origin(self), self.parameters(blueprint)
        check_type(source, "parameters", given, Mapping)
        for key, pair in given.items():
            low, high = checked_numbers(pair, (2,), source=source, key=str(key)).tolist()
            if not -math.inf < low <= high < math.inf:
                expected = "expected finite bounds, the least first"
                raise InputError(source, key, f"found {low} to {high}, {expected}")
            found[key] = GaitParameter(low, high)
        return found

    def signals(self, robots: DrivenRobots, readings: Any, values: np.ndarray) -> np.ndarray:
        """Signals (N, driven) in N of robots, from their robot.readings.Readings, and the
        parameters (N, parameters) of the policy of each robot."""
        raise NotImplementedError


Policy = Annotated[
    PolicyKind,
    Kinds(
        PolicyKind,
        more=[
            "tetra_drake.scenario.policy_kinds:RollingPolicy",
            "tetra_drake.scenario.policy_kinds:LinearPolicy",
            "tetra_drake.scenario.policy_kinds:NetworkPolicy",
            "tetra_drake.scenario.policy_kinds:PythonPolicy",
        ],
    ),
]
"""A policy of any kind, with its settings. A mapping without a tag is a !Rolling."""


def driven_names(blueprint: Blueprint) -> list[str]:
    """Names of the driven cables, in the order of the actuators."""
    return [blueprint.cable_names[cable] for group in blueprint.groups for cable in group]
