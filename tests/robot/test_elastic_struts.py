"""Struts with an axial stiffness, against springs in series."""

import math

import numpy as np
import pytest
from helpers.anchored import scenario_of

from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.robot.robot import Robot

G, MASS, LOAD = 9.80665, 2.0, 500.0
SOFT, HARD = 1e5, 1e6
"""Stiffness (N/m) of the strut and of the anchors."""


def hanging(axial_stiffness: float | None) -> Robot:
    """A strut of hardly any mass that hangs from an anchor and bears a mass and a load."""
    make = {"pairs": [["hook", "end"]], "diameter": 0.01, "density": 1e-3, "node_diameter": 0.0}
    tree = {
        "nodes": {"hook": [0.0, 0.0, 0.0], "end": [0.0, 0.0, -1.0]},
        "struts": {"rod": make | {"axial_stiffness": axial_stiffness}},
        "masses": {"end": MASS},
        "anchors": {"hook": "xyz"},
        "anchor_stiffness": HARD,
        "loads": {"end": [0.0, 0.0, -LOAD]},
    }
    return Robot.of(scenario_of(tree))


@pytest.mark.parametrize(("stiffness", "springs"), [(None, [HARD]), (SOFT, [HARD, SOFT])])
def test_a_rod_gives_way_and_vibrates_as_springs_in_series(stiffness, springs):
    study, series = study_equilibrium(hanging(stiffness)), 1.0 / sum(1.0 / k for k in springs)
    assert -1.0 - study.nodes.z["end"] == pytest.approx((LOAD + MASS * G) / series, rel=1e-6)
    expected = math.sqrt(series / MASS) / (2.0 * math.pi)
    assert np.abs(study.frequencies / expected - 1.0).min() < 1e-5
