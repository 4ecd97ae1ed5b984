"""Functions of policies, which scenarios name by their import path."""

from typing import Any, ClassVar

import numpy as np

from tetra_drake.scenario.policies import PolicyKind

NO_FUNCTION = "here"


def short(readings, parameters, robots):
    return parameters[:, :1]


def undefined(readings, parameters, robots):
    return np.where(readings.time[:, np.newaxis] > 0.05, np.nan, robots.rest)


def own(readings, parameters, robots):
    return robots.rest + parameters * readings.rates[:, :1]


class Given(PolicyKind):
    """Policy whose answer and bounds are settings of the class."""

    answer: ClassVar[Any] = None
    bounds: ClassVar[tuple[float, float]] = 0.0, 1.0

    def parameters(self, blueprint):
        return {"p": self.bounds}

    def signals(self, robots, readings, values):
        return self.answer
