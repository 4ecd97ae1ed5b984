"""A mass that breaks free under the friction of the thesis, again and again."""

import numpy as np
import pytest
from helpers.anchored import scenario_of
from helpers.converged import CONVERGED
from helpers.hanging import HANGING, MASS
from helpers.hanging import STIFFNESS as CABLE_STIFFNESS
from scipy.integrate import solve_ivp

from tetra_drake.engines.simulate import simulate
from tetra_drake.laws.contact import GroundSection
from tetra_drake.laws.friction import ResetIntegrator
from tetra_drake.laws.terrain import Flat
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.scenario.engine_kinds import Drake

G = 9.80665


PULLED = {
    "nodes": {"a": [0.0, 0.0, 0.002], "b": [0.2, 0.0, 0.002], "p": [0.1, 0.0, 0.0]},
    "contacts": ["p"],
}
"""HANGING, with its point mass on the ground. Its cables lift a third of its weight."""

BRISTLE = {
    "stiction_range": 1e-4,
    "stiction_damping": 0.5,
    "stiction_switch": 0.7,
    "proportional_stiction": 2e4,
    "stiffness": 1000.0,
}
"""Constants of the reset integrator, in SI units."""


def pulled_over_the_ground(start: float, times: np.ndarray) -> np.ndarray:
    """Coordinate (m) over times (s) of a point mass that two cables pull to 0 against friction, by
    an integration of its deflection (m) that an event sets to 0 at the stiction range."""
    p0, *constants = BRISTLE.values()
    sigma_1, switch, sigma_0, k = constants

    def rates(_, y):
        x, v, bend = y
        friction = (k + sigma_0 * abs(v)) * (1.0 + switch) * bend + sigma_1 * v
        return [v, -(2.0 * CABLE_STIFFNESS * x + friction) / MASS, v]

    def breaks_free(_, y):
        return p0 - abs(y[2])

    breaks_free.terminal, breaks_free.direction = True, -1
    fine = {"rtol": 1e-10, "atol": 1e-13, "events": breaks_free, "dense_output": True}
    time, y, found = 0.0, [start, 0.0, 0.0], np.empty(len(times))
    while time < times[-1]:
        part = solve_ivp(rates, (time, times[-1]), y, **fine)
        later = times >= time
        found[later] = part.sol(times[later])[0]
        time, y = part.t[-1], [*part.y[:2, -1], 0.0]
    return found


@pytest.mark.parametrize(("engine", "atol"), [(CONVERGED["compiled"], 1e-7), (Drake(), 2e-5)])
def test_a_mass_on_cables_breaks_free_as_an_integrator_with_resets_says(engine, atol):
    # From two starts at once, along x and y.
    starts, ground = [0.008, -0.005], GroundSection(stiffness=4000.0, damping=1e5)
    weight = MASS * G - 2.0 * CABLE_STIFFNESS * 0.002
    low = -weight / (ground.stiffness + 2.0 * CABLE_STIFFNESS)
    tree = HANGING | PULLED | {"offsets": [[0.0] * 3, [*starts, low]]}
    changes = {"terrain": Flat(), "friction": ResetIntegrator(reset="range", **BRISTLE)}
    scenario = scenario_of(tree, 0.12, ground=ground, engine=engine, **changes)
    found = simulate(scenario, seeded_gait(scenario), record=True).trajectory
    for axis, start, middle in zip("xy", starts, (0.1, 0.0), strict=True):
        expected = pulled_over_the_ground(start, found.time.values)
        assert np.ptp(expected) > 20.0 * BRISTLE["stiction_range"]
        p_WN = found.p_WN.sel(node="p", axis=axis)
        np.testing.assert_allclose(p_WN - middle, expected, atol=atol)
