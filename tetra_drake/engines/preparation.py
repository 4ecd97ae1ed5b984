"""Compilation of all kernels in advance, so that nothing later waits for the compiler.

A kernel is compiled for the types of its arguments. These are the same for all robots, scenarios
and numbers of robots, so one short use of each kernel compiles it for all.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numba.core import event

from tetra_drake.engines.engine import engine_of
from tetra_drake.engines.mujoco import pull_cables
from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.forces import Forces
from tetra_drake.laws.terrain import Incline
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario

FUNCTIONS = 380
"""Number of functions that numba compiles in prepare(), roughly."""
_NOWHERE = subprocess.DEVNULL


def prepare(tell: Callable[[], None] = lambda: None) -> None:
    """Compiles the package's kernels for the level of this processor. Later runs reuse the machine
    code.

        >>> td.prepare()

    It takes half a minute on two cores: a second process compiles the kernel of the lanes.

    Args:
        tell: function without arguments that is called after each compiled function, to show the
            progress: about 380 times in all (FUNCTIONS), not at all if nothing is left to compile.
    """
    program = f"from {__name__} import *; compile_lanes(lambda: print(end='.', flush=True))"
    lanes: list[subprocess.Popen[bytes]] = []
    with contextlib.ExitStack() as ends:

        def told() -> None:
            if not lanes:  # something is not compiled yet
                command = [sys.executable, "-c", program]
                process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=_NOWHERE)
                lanes.append(ends.enter_context(process))
                ends.callback(process.kill)
            tell()

        compile_others(told)
        for process in lanes:
            while process.stdout and process.stdout.read(1):
                tell()
    compile_lanes(tell)  # reads the machine code of the other process


def compile_lanes(tell: Callable[[], None]) -> None:
    """Compiles the kernel of the engine `compiled`, which simulates robots in SIMD lanes. Calls
    `tell` after each compiled function."""
    with event.install_listener("numba:compile", _Count(tell)):
        _prepare_engine("thesis", {"engine": "!Compiled"})


def compile_others(tell: Callable[[], None]) -> None:
    """Compiles the kernels of single robots, for the other engines. Calls `tell` after each
    compiled function."""
    with event.install_listener("numba:compile", _Count(tell)):
        witness = "!Drake {scheme: runge_kutta3, mode_changes: witness}"
        _prepare_engine("feedback", {"engine": witness})
        _prepare_engine("motors", {"engine": "!Drake", "terrain": Incline(slope=0.01)})
        robot = Robot.of(load_scenario("prism"))
        _ = robot.equilibrium
        parts, none = Packed((robot.model, Forces.of(robot.model))), np.zeros(0)
        pull_cables(parts, none, none, none, 0.0, none, none)


def _prepare_engine(name: str, changes: Mapping[str, Any]) -> None:
    scenario = load_scenario(name).with_changes(changes)
    engine_of(scenario).prepare(scenario)


class _Count(event.Listener):
    """Listener for numba's events that calls a function at the end of each compilation."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell = tell

    def on_start(self, event: event.Event) -> None:
        pass

    def on_end(self, event: event.Event) -> None:
        self._tell()
