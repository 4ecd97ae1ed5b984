"""Live view of a diagram in Meshcat: signals as curves over the last seconds."""

from __future__ import annotations

from collections import deque

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import Meshcat, MeshcatParams, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem

from tetra_drake.figures.style import LINE_COLOURS
from tetra_drake.visualization.replay import quiet_meshcat

FRAMES = 200  # points of a curve


def open_meshcat() -> Meshcat:
    """A new Meshcat, once a browser is connected. Prints its address."""
    meshcat = quiet_meshcat(MeshcatParams(host="localhost"))
    input(f"open {meshcat.web_url()} in a browser, then press Enter ")
    return meshcat


class SignalCurves(LeafSystem):
    """Curves of signals in Meshcat, and the pose of a body.

    | input | content |
    |---|---|
    | signals | values (count,) |
    | state | state of a plant with one free body; not needed without `body` |
    """

    def __init__(
        self, meshcat: Meshcat, *, count: int, window: float, scale: float, body: str = ""
    ) -> None:
        """Curves over `window` (s), 1 m wide and `scale` m high per unit of the signals, behind the
        body with this path in the scene."""
        super().__init__()
        self._meshcat, self._scale, self._body = meshcat, scale, body
        self._samples: deque[np.ndarray] = deque(maxlen=FRAMES)
        self._signals = self.DeclareVectorInputPort("signals", count)
        self._state = self.DeclareVectorInputPort("state", 13)
        self.DeclarePeriodicPublishEvent(window / FRAMES, 0.0, self._draw)

    def _draw(self, context: Context) -> None:
        self._samples.append(self._signals.Eval(context))
        if self._body:
            state = self._state.Eval(context)
            turn = Quaternion(state[:4] / np.linalg.norm(state[:4]))
            self._meshcat.SetTransform(self._body, RigidTransform(turn, state[4:7]))
        if len(self._samples) < 2:
            return
        x = np.linspace(-0.5, 0.5, FRAMES)[: len(self._samples)]
        for signal, values in enumerate(np.transpose(self._samples)):
            points = np.stack([x, np.full_like(x, 0.2), 0.3 + self._scale * values])
            name = LINE_COLOURS[signal % len(LINE_COLOURS)]
            colour = np.frombuffer(bytes.fromhex(name[1:]), np.uint8) / 255
            self._meshcat.SetLine(f"/signals/{signal}", points, 3.0, Rgba(*colour))
