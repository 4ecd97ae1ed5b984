"""The recorded trajectory: evenly spaced samples that agree with the motion and with each other."""

from pathlib import Path

import numpy as np
import pytest
import xarray
from helpers import prism
from helpers.made_up_walk import make_walk

from tetra_drake.engines.simulate import simulate
from tetra_drake.results.trajectory import VARIABLES, sample_times
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.scenario.load import load_scenario


@pytest.fixture(scope="module", params=["!Drake", "!Compiled"])
def trajectory(request: pytest.FixtureRequest, data: Path) -> xarray.Dataset:
    times = {"simulation.duration": "2.0 s", "simulation.steady_from": "1.5 s"}
    scenario = load_scenario("thesis").with_changes(times | {"engine": request.param})
    gait = load_gait(data / "gait_g.json", scenario)
    return simulate(scenario=scenario, gait=gait, record=True).trajectory


def test_every_variable_has_a_unit_and_named_dimensions(trajectory: xarray.Dataset) -> None:
    dimensions = {name: along for name, (along, _, _) in VARIABLES.items()}
    assert {name: values.dims for name, values in trajectory.items()} == dimensions
    assert all(v.attrs["units"] for v in trajectory.data_vars.values())
    assert trajectory.time.attrs["units"] == "s"
    np.testing.assert_array_equal(trajectory.time, sample_times(2.0, 0.01))


@pytest.mark.parametrize(("duration", "count"), [(2.0, 201), (1.004, 101), (1.006, 102)])
def test_a_whole_number_of_periods_fits_any_duration(duration: float, count: int) -> None:
    times = sample_times(duration, 0.01)
    assert (times.size, times[0], times[-1]) == (count, 0.0, duration)
    assert np.ptp(np.diff(times)) < 1e-12


def test_positions_and_velocities_agree_between_samples(trajectory: xarray.Dataset) -> None:
    # Central differences over 20 ms of a motion at 0.7 to 2 Hz, where nothing changes its mode
    # before the start-up: the robot only settles.
    early = trajectory.sel(time=slice(0.6, 1.2))
    rates = (early.p_WN.values[2:] - early.p_WN.values[:-2]) / 0.02
    np.testing.assert_allclose(rates, early.v_WN.values[1:-1], atol=5e-5)


def test_parts_have_names_and_cables_are_selected_by_what_drives_them_and_their_groups() -> None:
    motion = prism.slide_prism(prism.make_prism(), duration=0.1)
    assert motion.node_body.sel(node="n5") == "n1 n5"
    assert motion.body.values.tolist() == ["n0 n4", "n1 n5", "n2 n3"]
    cable = motion.sel(cable="side n0 n3")
    assert (cable.cable_bodies.item(), cable.cable_group.item()) == ("n0 n4-n2 n3", "side")
    tension = make_walk(bodies=3, duration=0.1).tension
    driven = tension.sel(cable_signal="T2-T3").cable.values.tolist()
    assert driven == ["T2-T3 outer bottom_left", "T2-T3 outer bottom_right"]
    assert tension.sel(cable_group=["inner", "outer"]).identical(tension)
    assert tension.sel(cable_bodies=["T2-T3"]).cable.size == 6
