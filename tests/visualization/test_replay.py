"""The replay page: what it shows is the recording, and it needs nothing but itself."""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np
import pytest
import xarray
from helpers.meshcat_page import commands, read_page, unpack
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix

from tetra_drake.engines.simulate import simulate
from tetra_drake.formatting import fixed
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH
from tetra_drake.visualization.replay import (
    FRAMES_PER_SECOND,
    frame_samples,
    pack_page,
    replay_title,
    save_replay,
)
from tetra_drake.visualization.scene import ARROW_LENGTH, CABLE_RADIUS, HIDDEN

TITLE = '<script>bad()</script> & \\1 "gait": 4.36 in'

Tracks = dict[str, dict[str, tuple[np.ndarray, np.ndarray]]]
"""By path and property: times (frames,) in s and values (frames, ...) of the key frames."""


def recorded(scenario: Scenario) -> xarray.Dataset:
    trajectory = simulate(scenario=scenario, gait=seeded_gait(scenario), record=True).trajectory
    assert trajectory is not None
    return trajectory


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario().with_changes({"simulation.duration": 0.2, "simulation.steady_from": 0.1})


@pytest.fixture(scope="module")
def structure(scenario: Scenario) -> Structure:
    return MakeStructure(scenario.robot, scenario.cables)


@pytest.fixture(scope="module")
def trajectory(scenario: Scenario) -> xarray.Dataset:
    return recorded(scenario)


@pytest.fixture(scope="module")
def frames(trajectory: xarray.Dataset) -> xarray.Dataset:
    """The samples that the page shows."""
    return trajectory.isel(time=frame_samples(trajectory["time"].values))


@pytest.fixture(scope="module")
def page(
    scenario: Scenario, trajectory: xarray.Dataset, tmp_path_factory: pytest.TempPathFactory
) -> str:
    path = tmp_path_factory.mktemp("replay") / "new" / "replay.html"
    save_replay(path, scenario=scenario, trajectory=trajectory, title=TITLE)
    return read_page(path)


@pytest.fixture(scope="module")
def animation(page: str) -> Tracks:
    return read_animation(page)


def read_animation(page: str) -> Tracks:
    tracks: Tracks = {}
    for one in unpack(packed_animation(page))["animations"]:
        clip = one["clip"]
        tracks[one["path"]] = {
            track["name"]: (
                np.array([key["time"] for key in track["keys"]]) / clip["fps"],
                np.array([key["value"] for key in track["keys"]]),
            )
            for track in clip["tracks"]
        }
    return tracks


def packed_animation(page: str) -> bytes:
    """The one command of the page that holds all key frames."""
    (command,) = commands(page, "set_animation")
    return command


@pytest.mark.parametrize(
    ("samples", "period", "frames"),
    [(1501, 0.01, 376), (1500, 0.01, 375), (31, 0.01, 8), (11, 0.1, 11), (2, 0.001, 2), (1, 1, 1)],
)
def test_frames_are_evenly_spread_over_the_samples(
    samples: int, period: float, frames: int
) -> None:
    chosen = frame_samples(period * np.arange(samples))
    assert (chosen[0], chosen[-1], len(chosen)) == (0, samples - 1, frames)
    if frames > 1:
        steps = np.diff(chosen)
        assert 1 <= steps.min() <= steps.max() <= steps.min() + 1


def rotation(xyzw: np.ndarray) -> np.ndarray:
    return RotationMatrix(Quaternion(np.roll(xyzw, 1))).matrix()


def test_bodies_move_as_recorded(
    structure: Structure, frames: xarray.Dataset, animation: Tracks
) -> None:
    for i, body in enumerate(structure.bodies):
        times, positions = animation[f"/robot/{body}"][".position"]
        _, quaternions = animation[f"/robot/{body}"][".quaternion"]
        np.testing.assert_allclose(times, frames["time"], rtol=0, atol=1e-5)
        for p_WN, p, xyzw in zip(frames["p_WN"].values[:, i], positions, quaternions, strict=True):
            shown = p + structure.p_BN @ rotation(xyzw).T
            np.testing.assert_allclose(shown, p_WN, rtol=0, atol=1e-9)


def test_traces_show_only_what_has_been_walked(
    frames: xarray.Dataset, page: str, animation: Tracks
) -> None:
    traces = {path: tracks for path, tracks in animation.items() if path.startswith("/traces/")}
    lines = {}
    for command in commands(page, "/traces/"):
        content = unpack(command)
        if content["type"] == "set_object":
            (geometry,) = content["object"]["geometries"]
            points = geometry["data"]["attributes"]["position"]["array"]
            lines[content["path"]] = np.array(points)
    assert len(lines) == len(traces) == 1  # of five frames each; the recording lasts 0.2 s
    for path, tracks in traces.items():
        times, shown = tracks[".visible"]
        assert shown.tolist() == [False, True]
        np.testing.assert_allclose(times, [0.0, frames["time"].values[-1]], rtol=0, atol=1e-5)
        start, end = lines[path].reshape(-1, 2, 3).swapaxes(0, 1)
        bottom = frames["p_WN"].values[:, :, :2].reshape(frames.sizes["time"], -1, 3)
        np.testing.assert_allclose(start, bottom[:-1].reshape(-1, 3), rtol=0, atol=1e-6)
        np.testing.assert_allclose(end, bottom[1:].reshape(-1, 3), rtol=0, atol=1e-6)


def test_cables_reach_from_node_to_node_and_swell_with_tension(
    structure: Structure, frames: xarray.Dataset, animation: Tracks
) -> None:
    p_WN = frames["p_WN"].values.reshape(frames.sizes["time"], -1, 3)
    paths = {path.rsplit("/", 1)[1]: path for path in animation if path.startswith("/cables/")}
    assert sorted(paths) == sorted(structure.cable_names)
    for c, (name, cable) in enumerate(zip(structure.cable_names, structure.cables, strict=True)):
        kind = "actuated" if cable["signal"] >= 0 else name.split()[1]
        assert paths[name] == f"/cables/{kind}/{name}"
        tracks = animation[paths[name]]
        middle, xyzw, scale = (tracks[key][1] for key in (".position", ".quaternion", ".scale"))
        for f in range(len(middle)):
            half = rotation(xyzw[f])[:, 2] * scale[f, 2] / 2
            ends = [middle[f] - half, middle[f] + half]
            nodes = [p_WN[f, cable["node_a"]], p_WN[f, cable["node_b"]]]
            np.testing.assert_allclose(ends, nodes, rtol=0, atol=1e-9)
        np.testing.assert_allclose(scale[:, 2], frames["length"].values[:, c], rtol=1e-9)
        radius = CABLE_RADIUS * frames["tension"].values[:, c]
        np.testing.assert_allclose(scale[:, :2], np.column_stack([radius, radius]), rtol=1e-12)


def test_arrows_stand_on_their_nodes_and_are_as_long_as_the_force(
    frames: xarray.Dataset, animation: Tracks
) -> None:
    for contact in frames["contact"].values:
        body, node = contact.split()
        p_WN = frames["p_WN"].sel(tetrahedron=body, node=node).values
        normal = frames["normal_force"].sel(contact=contact).values
        friction = frames["friction_force"].sel(contact=contact).values
        sizes = {"normal": normal, "friction": np.linalg.norm(friction, axis=1)}
        for kind, size in sizes.items():
            tracks = animation[f"/forces/{kind}/{contact}"]
            np.testing.assert_allclose(tracks[".position"][1], p_WN, rtol=0, atol=1e-12)
            length = ARROW_LENGTH * size.clip(min=HIDDEN)
            np.testing.assert_allclose(tracks[".scale"][1][:, 2], length, rtol=1e-9)
    assert (frames["normal_force"].values > 0.0).any()


def test_the_title_is_text_and_not_markup(page: str) -> None:
    packed = pack_page(page, title=TITLE)
    for tag, source in (("title", page), ("h1", page), ("title", packed)):
        (found,) = re.findall(rf"<{tag}>(.*?)</{tag}>", source)
        assert html.unescape(found) == TITLE
        assert "<" not in found
    assert "bad()</script>" not in page + packed


def test_the_page_repeats_the_motion_and_loads_nothing_from_elsewhere(page: str) -> None:
    tags = re.findall(r"<(?:script|link|img|iframe|source)\b[^>]*>", page)
    assert tags
    assert not [tag for tag in tags if "src" in tag or "href" in tag]
    assert "WebSocket(url)" not in page
    options = unpack(packed_animation(page))["options"]
    assert options["play"] is True
    assert options["repetitions"] > 1000


def test_a_long_replay_stays_small(page: str) -> None:
    in_base64 = 4 / 3 * len(packed_animation(page))
    frames = 15.0 * FRAMES_PER_SECOND
    assert len(page) + frames * in_base64 / (0.2 * FRAMES_PER_SECOND) < 8e6, "in the browser"
    assert len(pack_page(page, title="any")) < 0.5 * len(page), "as a file"


def test_another_robot_and_a_slice_of_a_recording_replay_too(
    scenario: Scenario, tmp_path: Path
) -> None:
    two = scenario.with_changes({"robot.tetrahedra": 2})
    later = recorded(two).isel(time=slice(5, None))
    path = tmp_path / "replay.html"
    save_replay(path, scenario=two, trajectory=later, title="two")
    tracks = read_animation(read_page(path))
    assert sum(name.startswith("/robot/") for name in tracks) == 2
    assert sum(name.startswith("/cables/") for name in tracks) == 6
    assert tracks["/robot/T1"][".position"][0][0] == 0.0


def test_the_same_recording_gives_the_same_page(
    scenario: Scenario, trajectory: xarray.Dataset, page: str, tmp_path: Path
) -> None:
    title = replay_title("gait x", trajectory)
    x1 = trajectory["p_WN"].sel(tetrahedron="T1", node="bottom_left", axis="x")
    assert title == f"gait x: {fixed(float(x1[-1] - x1[0]) / INCH)} inches in 0.2 s"
    save_replay(tmp_path / "replay.html", scenario=scenario, trajectory=trajectory, title=TITLE)
    again = read_animation(read_page(tmp_path / "replay.html"))
    for name, tracks in read_animation(page).items():
        for track, (times, values) in tracks.items():
            np.testing.assert_array_equal(again[name][track][0], times)
            np.testing.assert_array_equal(again[name][track][1], values)
