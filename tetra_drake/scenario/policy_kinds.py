"""Kinds of policies: !Rolling, !Linear, !Network and !Python."""

from __future__ import annotations

import functools
import math
import os
import sys
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from tetra_drake.errors import InputError, checked_numbers
from tetra_drake.on_demand import loaded
from tetra_drake.scenario.blueprint import Blueprint
from tetra_drake.scenario.policies import DrivenRobots, PolicyBounds, PolicyKind, driven_names
from tetra_drake.settings.quantities import PAIR, Time
from tetra_drake.settings.refusals import refuse

MOST_PARAMETERS = 100_000
"""Largest number of parameters of a policy."""

Reading = Literal[
    "clock", "lengths", "rates", "tensions", "normal_forces", "q_WB", "w_WB", "p_WN", "v_WN"
]
"""Readings that some policies can see; see robot.readings.Readings."""


class RollingPolicy(PolicyKind):
    """Policy that rolls a robot: each cable is shortened by the same polynomial of x and z.

    x and z are of the cable's middle from the robot's centre, in the world frame, in units of half
    the first strut. So the robot keeps its shape in the world while it rolls through it; a clock
    keeps it from coming to rest. The parameters are the coefficients of 1, x, z, x², xz, z², sx and
    sz, where s is the sine of the clock.
    """

    tag = "Rolling"

    clock: Time = Field(default=2.0, gt=0)
    """Period of the clock."""
    most: float = Field(default=0.5, gt=0, lt=1)
    """Largest change of a free length, as a share of it."""

    def parameters(self, blueprint: Blueprint) -> Mapping[str, PolicyBounds]:
        return dict.fromkeys(["1", "x", "z", "x²", "xz", "z²", "sx", "sz"], (-1.0, 1.0))

    def signals(self, robots: DrivenRobots, readings: Any, values: np.ndarray) -> np.ndarray:
        p_WN, law = readings.p_WN, robots.cables.law
        middles = 0.5 * (p_WN[:, robots.ends[:, 0]] + p_WN[:, robots.ends[:, 1]])
        half = 0.5 * robots.size[:, np.newaxis, np.newaxis]
        places = (middles - p_WN.mean(axis=-2, keepdims=True)) / half
        x, z = places[..., 0], places[..., 2]
        s = np.sin(math.tau * readings.time / self.clock)[:, np.newaxis]
        terms = np.stack([np.ones_like(x), x, z, x * x, x * z, z * z, s * x, s * z], axis=-1)
        shares = np.clip((terms * values[:, np.newaxis]).sum(axis=-1), -self.most, self.most)
        lengths = law.free_length * (1.0 - shares)
        return robots.as_given(law.stiffness * (law.free_length - lengths))


class SensingPolicy(PolicyKind):
    """Base class for policies that see chosen readings as a list of inputs, numbers of about 1.

    A signal is an output of the policy, between -1 and 1, times the usual amplitude of an
    oscillator network's signals: half of `cpg.gain` times `cpg.external_input`.
    """

    readings: list[Reading] = Field(default=["clock", "lengths", "normal_forces"], min_length=1)
    """Readings that the policy gets (class Readings). `clock` is sine and cosine. Lengths are
    changes since the start, as shares; forces in units of the weight; positions from the robot's
    centre, in units of the first strut."""
    clock: Time = Field(default=1.0, gt=0)
    """Period of the clock."""

    @model_validator(mode="after")
    def _check_readings(self) -> SensingPolicy:
        if len({*self.readings}) < len(self.readings):
            refuse("readings", f"found {self.readings}, expected each once")
        return self

    def input_names(self, blueprint: Blueprint) -> list[str]:
        """Names of the inputs for a robot, such as "lengths 3"."""
        bodies, nodes = len(blueprint.bodies), len(blueprint.node_names)
        sizes = dict.fromkeys(["lengths", "rates", "tensions"], len(blueprint.cable_names))
        sizes |= {"clock": 2, "normal_forces": len(blueprint.contacts)}
        sizes |= {"q_WB": 4 * bodies, "w_WB": 3 * bodies, "p_WN": 3 * nodes, "v_WN": 3 * nodes}
        return [f"{name} {i + 1}" for name in self.readings for i in range(sizes[name])]

    def signals_of(self, outputs: np.ndarray, robots: DrivenRobots) -> np.ndarray:
        """Signals (N, driven) in N from the outputs (N, driven) of the policy, -1 to 1."""
        return robots.as_given(robots.amplitude[:, np.newaxis] * outputs)

    def inputs(self, robots: DrivenRobots, readings: Any) -> np.ndarray:
        """Inputs (N, inputs) of the policy of each robot."""
        phase, weight = math.tau * readings.time / self.clock, robots.weight[:, np.newaxis]
        weight = np.where(weight > 0.0, weight, 1.0)
        size, p_WN = robots.size[:, np.newaxis, np.newaxis], readings.p_WN
        columns = {
            "clock": np.stack([np.sin(phase), np.cos(phase)], axis=-1),
            "lengths": readings.lengths / robots.lengths - 1.0,
            "rates": readings.rates / robots.lengths,
            "tensions": readings.tensions / weight,
            "normal_forces": readings.normal_forces / weight,
            "q_WB": readings.q_WB,
            "w_WB": readings.w_WB,
            "p_WN": (p_WN - p_WN.mean(axis=-2, keepdims=True)) / size,
            "v_WN": readings.v_WN / size,
        }
        count = len(readings.time)
        return np.hstack([columns[name].reshape(count, -1) for name in self.readings])


class LinearPolicy(SensingPolicy):
    """Linear policy: each output is a bias plus a weighted sum of the readings, limited to -1 to 1,
    times the usual amplitude of a network's signals: half of `cpg.gain` times
    `cpg.external_input`."""

    tag = "Linear"

    def parameters(self, blueprint: Blueprint) -> Mapping[str, PolicyBounds]:
        return _layer(["bias", *self.input_names(blueprint)], driven_names(blueprint))

    def signals(self, robots: DrivenRobots, readings: Any, values: np.ndarray) -> np.ndarray:
        outputs = _weighted(values, self.inputs(robots, readings), len(robots.ends))
        return self.signals_of(np.clip(outputs, -1.0, 1.0), robots)


class NetworkPolicy(SensingPolicy):
    """Neural network with one hidden layer, whose neurons and outputs have the activation tanh,
    times the same amplitude as for !Linear."""

    tag = "Network"

    hidden: int = Field(default=8, ge=1, le=1000)
    """Number of hidden neurons."""

    def parameters(self, blueprint: Blueprint) -> Mapping[str, PolicyBounds]:
        neurons = [f"hidden {i + 1}" for i in range(self.hidden)]
        first = _layer(["bias", *self.input_names(blueprint)], neurons)
        return first | _layer(["bias", *neurons], driven_names(blueprint))

    def signals(self, robots: DrivenRobots, readings: Any, values: np.ndarray) -> np.ndarray:
        outputs = len(robots.ends)
        last = outputs * (1 + self.hidden)
        hidden = _weighted(values[:, :-last], self.inputs(robots, readings), self.hidden)
        last_sums = _weighted(values[:, -last:], np.tanh(hidden), outputs)
        return self.signals_of(np.tanh(last_sums), robots)


class PythonPolicy(PolicyKind):
    """Policy of your own. function(readings, parameters, robots) gets the Readings of N robots, the
    parameters (N, parameters) of each, and the robots' constants, a DrivenRobots. It returns
    setpoints (N, driven) of the actuators in SI units: forces, free lengths or tensions by the kind
    of `actuation`.
    """

    tag = "Python"

    function: str = Field(pattern=r"^[\w.]+:\w+$")
    """Module and name of the function: my_module:my_policy, also from the working folder."""
    count: int = Field(ge=1, le=MOST_PARAMETERS)
    """Number of parameters."""
    bounds: Annotated[list[float], *PAIR] = Field(default=[-1.0, 1.0])
    """Least and greatest parameter in random policies."""

    @property
    def code(self) -> str:
        return self.function

    def parameters(self, blueprint: Blueprint) -> Mapping[str, PolicyBounds]:
        low, high = self.bounds
        return {f"parameter {i + 1}": (low, high) for i in range(self.count)}

    def signals(self, robots: DrivenRobots, readings: Any, values: np.ndarray) -> np.ndarray:
        given = imported_function(self.function)(readings, values, robots)
        source, key, shape = "policy.function", self.function, robots.rest.shape
        return robots.signals_of(checked_numbers(given, shape, source=source, key=key, finite=True))


@functools.cache
def imported_function(path: str) -> Callable[..., Any]:
    """The function of a module, given as "module:function". Modules are also searched in the
    working folder. Raises InputError if it cannot be imported or is no function."""
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        function = loaded(path)
    except Exception as error:
        problem = f"cannot be imported: {type(error).__name__}: {error}"
        raise InputError("policy.function", path, problem) from error
    if not callable(function):
        raise InputError("policy.function", path, f"found {function!r:.60}, expected a function")
    return function


def _layer(inputs: list[str], outputs: list[str]) -> dict[str, PolicyBounds]:
    """Parameters of a layer, by name: the weight of each input in each output."""
    return {f"{one} to {other}": (-1.0, 1.0) for other in outputs for one in inputs}


def _weighted(values: np.ndarray, inputs: np.ndarray, outputs: int) -> np.ndarray:
    """Outputs (N, outputs) of a layer: biases plus weighted sums of inputs (N, inputs). `values`
    (N, outputs * (1 + inputs)) are the parameters of _layer()."""
    weights = values.reshape(len(inputs), outputs, -1)
    # Not by matrix products: their last digits depend on the number of robots.
    return np.asarray(weights[:, :, 0] + (weights[:, :, 1:] * inputs[:, np.newaxis]).sum(axis=-1))
