"""A recorded trajectory as a dataset."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import xarray

from tetra_drake.engines.simulate import simulate
from tetra_drake.results.trajectory import save_dataset
from tetra_drake.robot.gait import load_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario


def recorded(scenario: Scenario, data: Path, *, duration: float) -> xarray.Dataset:
    simulation = dataclasses.replace(
        scenario.simulation, duration=duration, steady_from=0.5 * duration
    )
    short = dataclasses.replace(scenario, simulation=simulation)
    gait = load_gait(data / "gait_g.json", oscillators=4)
    trajectory = simulate(scenario=short, gait=gait, record=True).trajectory
    assert trajectory is not None
    return trajectory


@pytest.fixture(scope="module")
def trajectory() -> xarray.Dataset:
    return recorded(load_scenario("thesis"), Path(__file__).parents[1] / "data", duration=3.0)


def test_every_variable_has_a_unit_and_named_dimensions(trajectory: xarray.Dataset) -> None:
    dims = {
        "p_WN": ("time", "tetrahedron", "node", "axis"),
        "v_WN": ("time", "tetrahedron", "node", "axis"),
        "tension": ("time", "cable"),
        "length": ("time", "cable"),
        "signal": ("time", "junction"),
        "normal_force": ("time", "contact"),
        "friction_force": ("time", "contact", "horizontal"),
        "in_contact": ("time", "contact"),
        "friction_mode": ("time", "contact", "horizontal"),
    }
    assert {name: v.dims for name, v in trajectory.data_vars.items()} == dims
    assert all(v.attrs["units"] for v in trajectory.data_vars.values())
    assert trajectory.time.attrs["units"] == "s"


def test_times_rise_from_start_to_end_about_a_period_apart(trajectory: xarray.Dataset) -> None:
    times = trajectory.time.values
    assert times[0] == 0.0 and times[-1] == 3.0
    steps = np.diff(times)
    assert (steps > 0.0).all()
    # A sample is the first step end at or after an instant 10 ms apart; steps last up to 8 ms.
    assert steps.max() <= 0.018 + 1e-9
    assert 3.0 / 0.018 <= len(times) <= 3.0 / 0.010 + 2


def test_velocities_are_the_rates_of_positions(trajectory: xarray.Dataset) -> None:
    # Before the actuation starts the robot only settles, slowly against 10 ms.
    early = trajectory.sel(time=slice(0.6, 1.2))
    seconds = early.time.values
    rates = np.diff(early.p_WN.values, axis=0) / np.diff(seconds)[:, None, None, None]
    means = 0.5 * (early.v_WN.values[1:] + early.v_WN.values[:-1])
    np.testing.assert_allclose(rates, means, atol=2e-5)


def test_cables_reach_from_node_to_node(trajectory: xarray.Dataset) -> None:
    def node(tetrahedron: str, name: str) -> np.ndarray:
        return trajectory.p_WN.sel(tetrahedron=tetrahedron, node=name).values

    for cable, a, b in (
        ("T2-T3 outer top", node("T2", "top"), node("T3", "top")),
        ("T4-T5 inner bottom_left", node("T4", "tip"), node("T5", "bottom_left")),
    ):
        distance = np.linalg.norm(b - a, axis=-1)
        np.testing.assert_allclose(trajectory.length.sel(cable=cable), distance, rtol=1e-12)


def test_forces_belong_to_the_recorded_states(trajectory: xarray.Dataset) -> None:
    assert (trajectory.signal.sel(time=slice(0.0, 1.2)) == 0.0).all()
    assert (abs(trajectory.signal.sel(time=slice(1.3, 3.0))) > 0.0).any()
    # Normal force exactly where a node is below the ground, friction only there (its modes
    # are those of the step, so a node just lifting or landing may differ at single samples).
    contact = [name.split() for name in trajectory.contact.values]
    heights = np.stack(
        [trajectory.p_WN.sel(tetrahedron=t, node=n, axis="z").values for t, n in contact], axis=1
    )
    above = heights > 0.0
    normal = trajectory.normal_force.values
    assert (normal[above] == 0.0).all() and (normal[~above] > 0.0).any()
    airborne = trajectory.in_contact.values == 0
    assert (trajectory.friction_force.values[airborne] == 0.0).all()
    assert np.mean(airborne != above) < 0.05


def test_what_is_saved_is_what_is_read(trajectory: xarray.Dataset, tmp_path: Path) -> None:
    save_dataset(trajectory, tmp_path / "t.nc")
    with xarray.open_dataset(tmp_path / "t.nc", engine="h5netcdf") as loaded:
        xarray.testing.assert_identical(loaded.load(), trajectory)
