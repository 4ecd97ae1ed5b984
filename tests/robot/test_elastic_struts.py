"""Struts with an axial stiffness, against springs in series."""

import math

import numpy as np
import pytest
from helpers.anchored import TREES, scenario_of

from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.robot.robot import Robot

G, MASS, LOAD = 9.80665, 2.0, 500.0
SOFT, HARD = 1e5, 1e6
"""Stiffness (N/m) of the strut and of the anchors."""


@pytest.mark.parametrize(("stiffness", "springs"), [(None, [HARD]), (SOFT, [HARD, SOFT])])
def test_a_rod_gives_way_and_vibrates_as_springs_in_series(stiffness, springs):
    tree, series = TREES["rod_down"], 1.0 / sum(1.0 / k for k in springs)
    rod = tree["struts"]["rod"] | {"axial_stiffness": stiffness}
    study = study_equilibrium(Robot.of(scenario_of(tree | {"struts": {"rod": rod}})))
    assert -1.0 - study.nodes.z["end"] == pytest.approx((LOAD + MASS * G) / series, rel=1e-6)
    expected = math.sqrt(series / MASS) / (2.0 * math.pi)
    assert np.abs(study.frequencies / expected - 1.0).min() < 1e-5
