"""The cables as a system; their law is tested in tests/physics."""

from __future__ import annotations

import numpy as np

from tetra_drake.robot.structure import MakeStructure, node_positions
from tetra_drake.scenario.schema import Scenario
from tetra_drake.systems import CableNetwork


def test_ports_tell_the_tensions_and_lengths_of_equation_6(scenario: Scenario) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    cables = CableNetwork(structure, slack=False)
    context = cables.CreateDefaultContext()
    state, signals = structure.initial_state, np.array([1.0, 2.0, 3.0, 4.0])
    cables.GetInputPort("state").FixValue(context, state)
    cables.GetInputPort("signals").FixValue(context, signals)

    p_WN = node_positions(structure, state)
    table = structure.cables
    lengths = np.linalg.norm(p_WN[table["node_b"]] - p_WN[table["node_a"]], axis=1)
    driven = np.append(signals, 0.0)[table["signal"]]  # PASSIVE, -1, picks the zero
    tensions = table["stiffness"] * (lengths - table["free_length"]) + driven
    np.testing.assert_allclose(cables.GetOutputPort("lengths").Eval(context), lengths, rtol=1e-14)
    np.testing.assert_allclose(cables.GetOutputPort("tensions").Eval(context), tensions, rtol=1e-13)


def test_the_start_is_axially_balanced(scenario: Scenario) -> None:
    # The default spacing is where outer and inner cables balance along x. 2.94 in is rounded by
    # up to 0.005 in = 1.3e-4 m; three outer cables of 35 N/m and three inner ones of 53 N/m
    # make at most 263 N/m along x, so up to 0.033 N may be left (of 2.6 N in each cable).
    structure = MakeStructure(scenario.robot, scenario.cables)
    cables = CableNetwork(structure, slack=False)
    context = cables.CreateDefaultContext()
    cables.GetInputPort("state").FixValue(context, structure.initial_state)
    cables.GetInputPort("signals").FixValue(context, np.zeros(4))
    force = cables.GetOutputPort("generalized_force").Eval(context).reshape(-1, 6)
    np.testing.assert_allclose(force[:, 3], 0.0, atol=0.033)
    np.testing.assert_allclose(force[:, 4], 0.0, atol=1e-12)


def test_slack_cables_do_not_push(scenario: Scenario) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    signals = np.full(4, -100.0)
    for slack, least in ((True, 0.0), (False, -98.0)):
        cables = CableNetwork(structure, slack=slack)
        context = cables.CreateDefaultContext()
        cables.GetInputPort("state").FixValue(context, structure.initial_state)
        cables.GetInputPort("signals").FixValue(context, signals)
        tensions = cables.GetOutputPort("tensions").Eval(context)
        assert round(tensions.min()) in (least, round(least + 0.6)), tensions.min()
