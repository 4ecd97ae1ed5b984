"""A walk made up for the tests of figures, of which everything is known."""

from __future__ import annotations

import numpy as np
import xarray

from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.load import load_scenario

PERIOD = 2.0  # s
SPEED = 0.01  # m/s
HEIGHT = 0.02  # m, to which a tetrahedron is lifted
LOAD = 0.2  # N, on a contact node that stands


def make_walk(*, bodies: int = 5, duration: float = 9.0) -> xarray.Dataset:
    """Tetrahedra that move on at SPEED; T1, T3 ... are lifted in the first half of each PERIOD
    and T2, T4 ... in the second. The tip of the lead never touches the ground."""
    scenario = load_scenario("thesis")
    scenario.robot.tetrahedra = bodies
    structure = MakeStructure(scenario.robot, scenario.cables)
    times = np.linspace(0.0, duration, round(duration / 0.01) + 1)
    phase = 2.0 * np.pi * times / PERIOD
    turn = np.where(np.arange(bodies) % 2, -1.0, 1.0)
    lift = HEIGHT * np.maximum(0.0, np.round(np.sin(phase), 12)[:, np.newaxis] * turn)
    way = np.stack([np.broadcast_to(SPEED * times[:, np.newaxis], lift.shape), 0 * lift, lift], -1)
    nodes = structure.p_WB[:, np.newaxis] + structure.p_BN + way[:, :, np.newaxis]

    names = np.array(structure.node_names)[structure.contacts]
    owners = structure.contacts // 4
    stands = (lift[:, owners] == 0.0) & (names != f"T{bodies} tip")
    normal = np.where(stands, LOAD, 0.0)
    friction = np.stack([-0.5 * normal, 0.0 * normal], axis=-1)
    signal = 2.0 * np.sin(phase[:, np.newaxis] - np.arange(bodies - 1))
    driver = structure.cables["signal"]
    tension = 3.0 + np.where(driver < 0, 0.0, signal[:, driver])
    return xarray.Dataset(
        {
            "p_WN": (("time", "tetrahedron", "node", "axis"), nodes),
            "tension": (("time", "cable"), tension),
            "signal": (("time", "junction"), signal),
            "normal_force": (("time", "contact"), normal),
            "friction_force": (("time", "contact", "horizontal"), friction),
        },
        coords={
            "time": times,
            "tetrahedron": list(structure.bodies),
            "node": ["bottom_left", "bottom_right", "top", "tip"],
            "cable": list(structure.cable_names),
            "contact": names.tolist(),
            "junction": [f"T{i + 1}-T{i + 2}" for i in range(bodies - 1)],
            "axis": ["x", "y", "z"],
            "horizontal": ["x", "y"],
        },
    )
