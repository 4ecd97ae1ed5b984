"""The replay page: what it shows is the recording, and it needs nothing but itself."""

import functools
import html
import json
import re

import numpy as np
import pytest
from helpers import prism
from helpers.meshcat_page import commands, read_page
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix

from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.gait import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.nesting import CABLES
from tetra_drake.visualization.replay import (
    RESOLUTION,
    frame_samples,
    legend_of,
    pack_page,
    save_replay,
)
from tetra_drake.visualization.scene import ARROW_LENGTH, CABLE_RADIUS, HIDDEN

ROUNDING = 0.51 * RESOLUTION

TITLE = '<script>bad()</script> & \\1 "gait": 4.36 in'


def recorded(scenario):
    return simulate(scenario=scenario, gait=seeded_gait(scenario), record=True).trajectory


@pytest.fixture(scope="module")
def scenario():
    return load_scenario().with_changes(
        {"simulation.duration": "0.2 s", "simulation.steady_from": "0.1 s"}
    )


@pytest.fixture(scope="module")
def trajectory(scenario):
    return recorded(scenario)


@pytest.fixture(scope="module")
def frames(trajectory):
    """The samples that the page shows."""
    return trajectory.isel(time=frame_samples(trajectory["time"].values))


@pytest.fixture(scope="module")
def page(scenario, trajectory, tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "new" / "replay.html"
    save_replay(path, robot=Robot.of(scenario), trajectory=trajectory, title=TITLE)
    return read_page(path)


@pytest.fixture(scope="module")
def tracks(page):
    """Key frames of the page."""
    return film_tracks(page)


def film_tracks(page):
    """By path and property: times (frames,) in s and values (frames, ...) of the key frames."""
    (packed,) = re.findall(r"const film = (.*);\n", page)
    film = json.loads(packed)
    times = np.array(film["ticks"]) / film["per_second"]
    tracks = {
        path: {
            name: (times, film["resolution"] * np.cumsum(rows, axis=1).T)
            for name, rows in properties.items()
        }
        for path, properties in film["motions"].items()
    }
    shown = np.array([False, True, True])
    for path, tick in film["traces"].items():
        tracks[path] = {"visible": (np.array([0.0, tick / film["per_second"], times[-1]]), shown)}
    return tracks


def rotation(xyzw):
    return RotationMatrix(Quaternion(np.roll(xyzw, 1))).matrix()


@pytest.mark.parametrize(
    ("samples", "period", "frames"),
    [(1501, 0.01, 376), (11, 0.1, 11), (1, 1, 1)],
)
def test_frames_are_evenly_spread_over_the_samples(samples, period, frames):
    chosen = frame_samples(period * np.arange(samples))
    assert (chosen[0], chosen[-1], len(chosen)) == (0, samples - 1, frames)
    steps = np.diff(chosen)
    assert frames == 1 or 1 <= steps.min() <= steps.max() <= steps.min() + 1


def test_bodies_move_as_recorded(frames, tracks):
    for i, body in enumerate(frames["body"].values):
        times, positions = tracks[f"/robot/{body}"]["position"]
        np.testing.assert_allclose(times, frames["time"], rtol=0, atol=1e-5)
        np.testing.assert_allclose(positions, frames["p_WB"][:, i], rtol=0, atol=ROUNDING)
        turned = np.roll(tracks[f"/robot/{body}"]["quaternion"][1], 1, axis=1)  # from x y z w
        np.testing.assert_allclose(turned, frames["q_WB"][:, i], rtol=0, atol=ROUNDING)


def test_traces_show_only_what_has_been_walked(frames, page, tracks):
    (path,) = (path for path in tracks if path.startswith("/traces/"))
    times, shown = tracks[path]["visible"]
    assert shown.tolist()[:2] == [False, True]  # five frames; the recording lasts 0.2 s
    assert shown[1:].all()
    end = frames["time"].values[-1]
    np.testing.assert_allclose(times, np.where(shown, end, 0.0), rtol=0, atol=1e-5)
    start, end = trace_of(page)
    bottom = frames["p_WN"][:, frames.node.str.contains("bottom").values].values
    np.testing.assert_allclose(start, bottom[:-1].reshape(-1, 3), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(end, bottom[1:].reshape(-1, 3), rtol=0, atol=ROUNDING)


def trace_of(page):
    """Starts and ends (2, lines, 3) of the lines of the one trace."""
    (trace,) = (one for one in commands(page, "/traces/") if one["type"] == "set_object")
    (geometry,) = trace["object"]["geometries"]
    points = np.array(geometry["data"]["attributes"]["position"]["array"])
    return points.reshape(-1, 2, 3).swapaxes(0, 1)


def test_a_structure_that_is_no_row_leaves_the_path_of_its_centre(tmp_path):
    robot = prism.make_prism()
    motion = prism.slide_prism(robot, duration=0.2)
    save_replay(tmp_path / "prism.html", robot=robot, trajectory=motion, title="a prism")
    page = read_page(tmp_path / "prism.html")
    assert "path of the centre" in page and "passive top cable" in page
    start, end = trace_of(page)
    np.testing.assert_allclose(start[0], [0.0, 0.0, 0.08], rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(end[-1], [0.2 * prism.SPEED, 0.0, 0.08], rtol=0, atol=ROUNDING)
    positions = film_tracks(page)["/robot/n2 n3"]["position"][1]
    np.testing.assert_allclose(positions[0], robot.structure.p_WB[2], rtol=0, atol=ROUNDING)


def test_cables_reach_from_node_to_node_and_swell_with_tension(structure, frames, tracks):
    p_WN = frames["p_WN"].values
    expected = set()
    for c, (name, cable) in enumerate(zip(structure.cable_names, structure.cables, strict=True)):
        kind = "actuated" if cable["signal"] >= 0 else f"passive {name.split()[1]}"
        expected.add(f"/cables/{kind}/{name}")
        track = tracks[f"/cables/{kind}/{name}"]
        middle, xyzw, scale = (track[key][1] for key in ("position", "quaternion", "scale"))
        half = np.array([rotation(q)[:, 2] for q in xyzw]) * scale[:, 2:] / 2
        np.testing.assert_allclose(
            middle - half, p_WN[:, cable["node_a"]], rtol=0, atol=2 * ROUNDING
        )
        np.testing.assert_allclose(
            middle + half, p_WN[:, cable["node_b"]], rtol=0, atol=2 * ROUNDING
        )
        radius = CABLE_RADIUS * frames["tension"].values[:, c]
        sides = np.column_stack([radius, radius])
        np.testing.assert_allclose(scale[:, :2], sides, rtol=0, atol=ROUNDING)
    assert {path for path in tracks if path.startswith("/cables/")} == expected


def test_arrows_stand_on_their_nodes_and_are_as_long_as_the_force(frames, tracks):
    for contact in frames["contact"].values:
        p_WN = frames["p_WN"].sel(node=contact).values
        normal = frames["normal_force"].sel(contact=contact).values
        friction = frames["friction_force"].sel(contact=contact).values
        sizes = {"normal": normal, "friction": np.linalg.norm(friction, axis=1)}
        for kind, size in sizes.items():
            track = tracks[f"/forces/{kind}/{contact}"]
            np.testing.assert_allclose(track["position"][1], p_WN, rtol=0, atol=ROUNDING)
            length = ARROW_LENGTH * size.clip(min=HIDDEN)
            scale = track["scale"][1]
            np.testing.assert_allclose(scale[:, 2], length, rtol=0, atol=ROUNDING)
            assert scale.min() > 0.0, "a scale of 0 makes matrices singular"
    assert (frames["normal_force"].values > 0.0).any()


def test_the_title_is_text_and_not_markup(page, trajectory):
    packed = pack_page(page, title=TITLE)
    for tag, source in (("title", page), ("h1", page), ("title", packed)):
        (title,) = re.findall(rf"<{tag}>(.*?)</{tag}>", source)
        assert html.unescape(title) == TITLE
        assert "<" not in title
    assert "bad()</script>" not in page + packed


def test_pages_share_a_viewer_of_which_there_is_one_version(
    scenario, trajectory, page, tmp_path, refused
):
    viewer, path = tmp_path / "shared" / "viewer #1.js", tmp_path / "runs" / "a" / "replay.html"
    robot = Robot.of(scenario)
    save = functools.partial(save_replay, robot=robot, trajectory=trajectory, title=TITLE)
    save(path, viewer=viewer)
    script = viewer.read_text(encoding="utf-8")
    shared = read_page(path)
    assert script in page and script not in shared
    assert re.findall(r'src="(.*?)"', shared) == ["../../shared/viewer%20%231.js"]
    assert len(shared) == pytest.approx(len(page) - len(script), abs=500)
    assert path.stat().st_size < 100_000

    written = viewer.stat().st_mtime_ns
    save(tmp_path / "shared" / "replay.html", viewer=viewer)
    assert viewer.stat().st_mtime_ns == written, "it was there"
    assert 'src="viewer%20%231.js"' in read_page(tmp_path / "shared" / "replay.html")

    other = tmp_path / "other.js"
    other.write_text(script[:-1])
    for wrong in (other, tmp_path):
        with refused(wrong, "", ""):
            save(tmp_path / "other.html", viewer=wrong)
    assert other.read_text(encoding="utf-8") == script[:-1]
    assert not (tmp_path / "other.html").exists()


def test_the_legend_names_kinds_of_cables_that_the_robot_has(scenario, structure, page):
    legend = legend_of(structure)
    assert [colour for colour, _ in legend[:3]] == ["actuated", "passive_1", "passive_2"]
    assert all(meaning in page for _, meaning in legend)
    driven = scenario.with_changes({"robot.actuation": [[cable] for cable in CABLES]})
    assert legend_of(Robot.of(driven).structure) == [legend[0], *legend[3:]]
