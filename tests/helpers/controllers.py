"""A controller for tests of its ports."""

from pydrake.systems.framework import BasicVector, Context, LeafSystem

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
