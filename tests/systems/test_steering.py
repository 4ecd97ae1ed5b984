"""Steering as a system: what decides on the turn."""

import math

import numpy as np
import pytest

from tetra_drake.systems import Steering


def doubled(turn: np.ndarray) -> np.ndarray:
    return np.array([2.0 * turn, 0.0])


@pytest.mark.parametrize(
    ("turn", "port", "decides"),
    [
        (0.25, None, 0.25),
        (lambda time: 0.1 * time, None, 0.3),
        (lambda time: 0.1 * time, -0.5, -0.5),
    ],
    ids=["number", "function of time", "port"],
)
def test_the_port_decides_if_it_is_connected(turn, port, decides):
    steering = Steering(doubled, turn=turn)
    context = steering.CreateDefaultContext()
    context.SetTime(3.0)
    if port is not None:
        steering.GetInputPort("turn").FixValue(context, [port])
    assert steering.get_output_port().Eval(context) == pytest.approx([2.0 * decides, 0.0])


@pytest.mark.parametrize("turn", [5.0, -1.1, math.nan])
def test_a_turn_beyond_its_limits_is_refused_on_the_port_as_by_a_function(turn, refused):
    for given, port in ((0.0, turn), (lambda time: turn, None)):
        steering = Steering(doubled, turn=given)
        context = steering.CreateDefaultContext()
        context.SetTime(3.0)
        if port is not None:
            steering.GetInputPort("turn").FixValue(context, [port])
        with refused("steering", "at 3 s", str(turn)):
            steering.get_output_port().Eval(context)
