"""What the figures show of a trajectory."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import xarray
from helpers.made_up_walk import HEIGHT, PERIOD, SPEED, make_walk

from tetra_drake.engines.simulate import simulate
from tetra_drake.results.measures import (
    actuated_cable,
    distance_walked,
    last_step,
    lifted,
    off_ground,
    relative_distances,
    share_of_time,
)
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.structure import MakeStructure
from tetra_drake.scenario.schema import Scenario


def test_the_walk_of_these_tests_is_like_a_recorded_one(
    walk: xarray.Dataset, scenario: Scenario
) -> None:
    scenario.simulation = dataclasses.replace(scenario.simulation, duration=0.05, steady_from=0.02)
    result = simulate(scenario=scenario, gait=seeded_gait(scenario), record=True)
    recorded = result.trajectory
    assert recorded is not None
    for name, variable in walk.data_vars.items():
        assert variable.dims == recorded[name].dims
    for name in set(walk.coords) - {"time"}:
        assert walk[name].values.tolist() == recorded[name].values.tolist()


def test_distance_walked_counts_from_the_start(walk: xarray.Dataset) -> None:
    later = walk.sel(time=slice(1.0, None))
    np.testing.assert_allclose(distance_walked(later), SPEED * (later.time - 1.0), atol=1e-12)


def test_distances_are_those_of_the_centres_from_t1(
    walk: xarray.Dataset, scenario: Scenario
) -> None:
    distances = relative_distances(walk)
    assert distances.dims == ("time", "tetrahedron")
    expected = np.broadcast_to(scenario.robot.spacing * np.arange(5), distances.shape)
    np.testing.assert_allclose(distances, expected, atol=1e-12)


def test_the_actuated_cable_of_a_junction_is_driven_by_its_signal(scenario: Scenario) -> None:
    structure = MakeStructure(scenario.robot, scenario.cables)
    for signal, junction in enumerate(("T1-T2", "T2-T3", "T3-T4", "T4-T5")):
        cable = structure.cable_names.index(actuated_cable(junction))
        assert structure.cables[cable]["signal"] == signal


def test_a_tetrahedron_is_lifted_when_none_of_its_nodes_bears_a_force() -> None:
    walk = make_walk(bodies=11)  # T1 and T11 begin alike
    heights = walk.p_WN.sel(node="bottom_left", axis="z")
    np.testing.assert_array_equal(lifted(walk), heights > 1e-9)
    assert float(heights.max()) == pytest.approx(HEIGHT, rel=1e-3)


def test_a_lead_that_stands_on_its_tip_is_not_lifted(walk: xarray.Dataset) -> None:
    touching = walk.copy(deep=True)
    touching.normal_force.loc[{"contact": "T5 tip"}] = 0.1
    assert lifted(walk).sel(tetrahedron="T5").any()
    assert not lifted(touching).sel(tetrahedron="T5").any()
    assert lifted(touching).sel(tetrahedron="T3").any()


def test_share_of_time_is_that_of_the_lift(walk: xarray.Dataset) -> None:
    periods = walk.sel(time=slice(0.0, 4 * PERIOD))
    share = share_of_time(off_ground(periods).sel(contact="T1 bottom_left"))
    assert share == pytest.approx(0.5, abs=0.01)
    assert share_of_time(off_ground(periods).sel(contact="T5 tip")) == pytest.approx(1.0)


def test_a_step_is_one_period_of_the_signals_and_ends_late(walk: xarray.Dataset) -> None:
    step = last_step(walk)
    assert step is not None
    start, end = step
    assert end - start == pytest.approx(PERIOD, rel=1e-3)
    last = float(walk.time[-1])
    assert last - PERIOD <= end <= last


def test_signals_that_do_not_oscillate_make_no_step(walk: xarray.Dataset) -> None:
    assert last_step(walk.assign(signal=0.0 * walk.signal)) is None
    nearly = 1.0 + 1e-9 * walk.signal
    assert last_step(walk.assign(signal=nearly)) is None
    assert last_step(make_walk(duration=1.5)) is None
