"""The replay page: what it shows is the recording, and it needs nothing but itself."""

import html
import json
import re

import numpy as np
import pytest
from helpers import prism
from helpers.anchored import HUNG, scenario_of
from helpers.made_up_walk import LOAD, make_row, make_walk
from helpers.meshcat_page import commands, read_page

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.films.browser import do, wait_until_loaded
from tetra_drake.lab.films.video import encode, make_video
from tetra_drake.laws.terrain import Incline
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.settings.units import INCH, POUND_FORCE
from tetra_drake.visualization.replay import (
    RESOLUTION,
    Replay,
    frame_samples,
    ground_forces,
    pack_page,
)
from tetra_drake.visualization.scene import COLOURS, THICKEST, THINNEST, cable_paths, drawn_radii

from .conftest import opened

ROUNDING = 0.51 * RESOLUTION

NAME, DEED = '<script>bad()</script> & \\1 "gait"', "walks 4.4 in"
TITLE = f"{NAME}: {DEED}"


ROBOT, WALK = make_row(), make_walk(duration=0.5)
FRAMES = WALK.isel(time=frame_samples(WALK["time"].values))
"""The samples that the page shows."""
PLACE = "path => viewer.scene_tree.find(path).object.position.toArray()"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "new" / "replay.html"
    Replay(ROBOT, WALK, TITLE).save(path)
    return path


@pytest.fixture(scope="module")
def page(file):
    return read_page(file)


@pytest.fixture(scope="module")
def film(page):
    return film_of(page)


def film_of(page):
    """What the page plays, with motions (frames, numbers) in SI units."""
    (packed,) = re.findall(r"const recording = (.*);\n", page)
    film = json.loads(packed)
    for name in ("poses", "radii", "touches", "arrows", "traces"):
        rows = np.reshape(film[name], (len(film[name]), len(film["times"])))
        film[name] = film["resolution"] * np.cumsum(rows, axis=1).T
    return film


def test_frames_are_evenly_spread_over_the_samples():
    for samples, period, frames in ((1501, 0.01, 376), (11, 0.1, 11), (1, 1, 1)):
        chosen = frame_samples(period * np.arange(samples))
        assert (chosen[0], chosen[-1], len(chosen)) == (0, samples - 1, frames)
        assert frames == 1 or np.ptp(np.diff(chosen)) <= 1


def test_in_a_browser_bodies_are_where_they_were_and_cables_between_them(browser, file):
    with opened(browser, file.as_uri(), size=(150, 100), draws=False) as page:
        wait_until_loaded(page)
        for frame in (4, -1):
            do(page, "show", float(FRAMES["time"].values[frame]))
            places = [page.evaluate(PLACE, ["robot", body]) for body in FRAMES["body"].values]
            cable = ["cables", "actuated", "T1-T2 outer bottom_left"]
            length = page.evaluate(f"viewer.scene_tree.find({cable}).object.scale.z")
            # Times are rounded to 0.01 ms, and nothing moves at 1 m/s.
            np.testing.assert_allclose(places, FRAMES["p_WB"].values[frame], rtol=0, atol=1e-5)
            feet = FRAMES["p_WN"].sel(node=["T1 bottom_left", "T2 bottom_left"]).values[frame]
            assert length == pytest.approx(np.linalg.norm(feet[1] - feet[0]), abs=1e-4)


@pytest.mark.parametrize("program", ["cat > /dev/null; exit 228", "exit 0"])
def test_a_video_that_ffmpeg_does_not_finish_is_refused(program, tmp_path, monkeypatch, refused):
    pytest.importorskip("imageio_ffmpeg")
    ffmpeg, film = tmp_path / "ffmpeg", tmp_path / "talk.mp4"
    ffmpeg.write_text(f"#!/bin/sh\n{program}\n")
    ffmpeg.chmod(0o755)
    film.write_text("old")
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(ffmpeg))
    with refused(film, "", "ffmpeg"):
        encode([bytes(64 * 64 * 3)] * 50, film, size=(64, 64), fps=10.0)
    assert film.read_text() == "old"
    with refused(tmp_path / "talk.avi", "", ".mp4 or .gif"):
        make_video("", tmp_path / "talk.avi")


def test_nodes_sit_on_bodies_and_cables_join_them_and_swell_with_tension(structure, film):
    names = [node["path"][-1].removeprefix("node ") for node in film["nodes"]]
    assert names == list(structure.node_names)
    assert [node["body"] for node in film["nodes"]] == structure.carriers.tolist()
    places = [node["place"] for node in film["nodes"]]
    np.testing.assert_allclose(places, structure.p_BN, rtol=0, atol=1e-6)
    assert ["/" + "/".join(cable["path"]) for cable in film["cables"]] == cable_paths(structure)
    ends = structure.cables[["node_a", "node_b"]].tolist()
    assert [tuple(cable["nodes"]) for cable in film["cables"]] == ends
    tension, strut = FRAMES["tension"].values, drawn_radii(structure)[0].min()
    free = (film["radii"] > 1.1 * THINNEST * strut) & (film["radii"] < 1.2 * THICKEST * strut)
    ratios = (film["radii"] / tension)[free]
    full = THICKEST * strut / np.percentile(tension, 99)
    np.testing.assert_allclose(ratios, full, rtol=0.02)


def test_arrows_are_the_forces_of_the_ground(film):
    number, _ = film["legend"]["force"].split()
    forces = ground_forces(ROBOT, FRAMES)
    assert (forces[..., 2] == FRAMES["normal_force"].values).all() and forces[..., 2].max() > 0.0
    expected = forces * INCH / (float(number) * POUND_FORCE)
    arrows = film["arrows"].reshape(expected.shape)
    np.testing.assert_allclose(arrows, expected, rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(film["touches"] > 0.0, FRAMES["in_contact"].values > 0)


def test_forces_on_a_slope_are_turned_with_it():
    slope = 0.2
    inclined = make_row(changes={"terrain": Incline(slope=slope)})
    walk = make_walk().isel(time=[0, 50])
    turned = ground_forces(inclined, walk)[0, 0] / LOAD
    ahead, up = [np.cos(slope), 0.0, np.sin(slope)], [-np.sin(slope), 0.0, np.cos(slope)]
    np.testing.assert_allclose(turned, np.array(up) - 0.5 * np.array(ahead), rtol=0, atol=1e-12)


def test_progress_is_the_distance_or_the_turn(tmp_path, film):
    walked = WALK["p_WN"].values[:, 0, 0]
    inches = (walked[-1] - walked[0]) / INCH
    assert (film["progress"]["what"], film["progress"]["unit"]) == ("walked", " in")
    assert film["progress"]["values"][-1] == pytest.approx(inches, abs=0.06)
    turning = ROBOT.scenario.with_sections(objective={"heading_change": 1.0})
    quarter = WALK.copy(deep=True)
    quarter["q_WB"].values[:] = [1.0, 0.0, 0.0, 0.0]
    quarter["q_WB"].values[len(quarter.time) // 2 :] = np.sqrt([0.5, 0.0, 0.0, 0.5])
    Replay(Robot.of(turning), quarter, "a: b").save(tmp_path / "turn.html")
    progress = film_of(read_page(tmp_path / "turn.html"))["progress"]
    assert (progress["what"], progress["unit"], progress["values"][-1]) == ("turned", "°", 90.0)


def test_rear_feet_or_the_centre_leave_a_path(structure, film, tmp_path):
    feet = FRAMES["p_WN"].values[:, structure.markers[:2]].reshape(len(FRAMES["time"]), -1)
    np.testing.assert_allclose(film["traces"], feet, rtol=0, atol=ROUNDING)
    robot = prism.make_prism()
    motion = prism.slide_prism(robot, duration=0.2)
    Replay(robot, motion, "a prism").save(tmp_path / "prism.html")
    sliding = film_of(read_page(tmp_path / "prism.html"))
    assert not sliding["named"]  # bodies named after two nodes
    ends = [[0.0, 0.0, 0.08], [0.2 * prism.SPEED, 0.0, 0.08]]
    np.testing.assert_allclose(sliding["traces"][[0, -1]], ends, rtol=0, atol=ROUNDING)


def test_the_title_is_text_and_not_markup(page):
    packed = pack_page(page, title=TITLE)
    for tag, source, text in (("title", page, TITLE), ("title", packed, TITLE), ("h1", page, DEED)):
        title = re.search(rf"<{tag}>(.*?)</{tag}>", source)[1]
        assert html.unescape(title) == text and "<" not in title
    assert "bad()</script>" not in page + packed


def test_pages_share_one_version_of_a_viewer(page, tmp_path, refused):
    viewer, path = tmp_path / "shared" / "viewer #1.js", tmp_path / "runs" / "a" / "replay.html"
    save = Replay(ROBOT, WALK, TITLE).save
    save(path, viewer=viewer)
    script = viewer.read_text(encoding="utf-8")
    shared = read_page(path)
    assert script in page and script not in shared
    assert re.findall(r'src="(.*?)"', shared) == ["../../shared/viewer%20%231.js"]
    assert path.stat().st_size < 100_000

    other = tmp_path / "other.js"
    other.write_text(script[:-1])
    with refused(other, "", ""):
        save(tmp_path / "other.html", viewer=other)
    assert other.read_text(encoding="utf-8") == script[:-1]


def test_a_page_without_ground_shows_anchors_and_no_floor(tmp_path):
    hung = scenario_of(HUNG, duration=0.05)
    moved = simulate(hung, seeded_gait(hung), record=True).trajectory
    Replay(Robot.of(hung), moved, "a robot: hangs").save(tmp_path / "page.html")
    page = read_page(tmp_path / "page.html")
    film = film_of(page)
    colours = {node["path"][-1]: (node["body"], node["colour"]) for node in film["nodes"]}
    assert colours["node top"] == (-1, COLOURS["anchor"])
    assert colours["node a"] == (0, COLOURS["node"])
    assert commands(page, "/robot/world/node top") and not commands(page, "/floor/")
    assert "anchored node" in page and "on the ground</li>" not in page
