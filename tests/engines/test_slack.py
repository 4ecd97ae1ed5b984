"""A ball on a loose tether: it falls freely, then the tether catches it."""

import math

import numpy as np
import pytest
from helpers.anchored import LINE, TREES, scenario_of
from scipy.integrate import solve_ivp

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.command import Command
from tetra_drake.scenario.scenario import Scenario

DROP, G = 0.5, 9.80665  # m until the tether of 1 m is taut, m/s^2


def dropped(engine: str, *, damping: float) -> Scenario:
    """A ball that is dropped from half a metre below its hook, on a tether of 1 m."""
    tether = TREES["tethered"]["cables"]["tether"] | {"damping": damping}
    up = [0.0, 0.0, 0.5 + G / LINE["stiffness"]]  # from where it hangs
    tree = TREES["tethered"] | {"cables": {"tether": tether}, "offsets": [up]}
    # MuJoCo knows no stiffness of friction.
    changes = {"simulation.sample_period": "5 ms", "friction.stiffness": "0 N/m"}
    return scenario_of(tree, duration=1.0, engine=engine, **changes)


FALLS = [("!Compiled", 20.0, 0.0), ("!Drake", 20.0, 2.0), ("!Mujoco", 20.0, 0.0)]
FALLS += [("!Mujoco", 0.0, 2.0)]


@pytest.mark.parametrize(("engine", "damping", "push"), FALLS)
def test_a_loose_tether_neither_brakes_nor_pushes_a_falling_ball(engine, damping, push):
    command = Command("push", 1.0, np.array([[-push]]))
    scenario = dropped(engine, damping=damping)
    found = simulate(scenario, command=command, record=True).trajectory
    height = found.p_WN.sel(node="ball", axis="z")
    falls = found.time < math.sqrt(2.0 * DROP / G)  # 0.319 s
    expected = 1.5 - 0.5 * G * found.time**2
    np.testing.assert_allclose(height[falls], expected[falls], atol=2e-4)
    tension = found.tension.isel(cable=0)
    assert not tension[falls].values.any()

    def motion(time: float, y: np.ndarray) -> list[float]:
        return [y[1], G - pull(y)]

    def pull(y: np.ndarray) -> float:
        elastic = max(0.0, LINE["stiffness"] * (y[0] - DROP))
        return max(0.0, elastic + float(np.clip(damping * y[1], -elastic, elastic)) - push)

    caught = solve_ivp(motion, (0.0, 1.0), [0.0, 0.0], t_eval=found.time.values, max_step=5e-3)
    np.testing.assert_allclose(1.5 - height, caught.y[0], atol=1e-3)
    assert max(map(pull, caught.y.T)) > 50.0
