"""Systems of the user in a diagram: controllers and a ground."""

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from tetra_drake.robot.readings import Readings
from tetra_drake.robot.robot import Robot


class Springs(LeafSystem):
    """A controller of ports of these names and sizes. It has no state, so its signals depend on
    its inputs at the same time: they are the sum of these for the driven cables."""

    def __init__(self, robot: Robot, inputs: dict[str, int], outputs: dict[str, int]) -> None:
        super().__init__()
        self._driven = robot.driven
        self._ports = [self.DeclareVectorInputPort(name, size) for name, size in inputs.items()]
        for name, size in outputs.items():
            self.DeclareVectorOutputPort(name, size, self._calc)

    def _calc(self, context: Context, output: BasicVector) -> None:
        sums = sum(port.Eval(context) for port in self._ports)[self._driven]
        output.SetFromVector(sums[: output.size()])


def follow_waves(robot: Robot, time: float, readings: Readings) -> np.ndarray:
    """Forces that pull the driven cables to lengths that change in a wave."""
    cables, phases = robot.driven, np.arange(robot.driven.size)
    wanted = robot.starting_cables().length * (
        1.0 + 0.2 * np.sin(2.0 * np.pi * 0.7 * time + phases)
    )
    return 40.0 * (readings.lengths[cables] - wanted) + 0.2 * readings.rates[cables]


class OwnGround(LeafSystem):
    """Springs under the origins of bodies, or nothing that a diagram could use."""

    def __init__(self, bodies: int, *, force: str = "generalized_force") -> None:
        super().__init__()
        self.state = self.DeclareVectorInputPort("state", 13 * bodies)
        self.DeclareVectorOutputPort(force, 6 * bodies, self.calc)
        self.DeclareVectorOutputPort("normal_forces", 2, lambda context, output: None)

    def calc(self, context: Context, output: BasicVector) -> None:
        heights = self.state.Eval(context)[6 : 7 * (output.size() // 6) : 7]
        force = np.zeros((len(heights), 6))
        force[:, 5] = 100.0 * np.maximum(0.0, -heights)
        output.SetFromVector(force.ravel())
