"""The pages in a real browser, headless and without network."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from helpers.made_up_walk import make_row, make_walk

from tests.visualization.conftest import WINDOW, opened
from tetra_drake.lab.films.browser import do, wait_until_loaded
from tetra_drake.lab.films.video import make_video
from tetra_drake.settings.units import INCH
from tetra_drake.visualization.replay import Replay

pytestmark = pytest.mark.slow

WALK = make_walk(duration=5.0)


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    Replay(make_row(), WALK, "a gait: walks 2.0 in").save(path)
    return path


@pytest.fixture(scope="module")
def page(browser, replay):
    """The replay page once it plays by itself; tests may stop and resize it."""
    with opened(browser, replay.as_uri()) as loaded:
        loaded.wait_for_function("parseFloat(document.getElementById('clock').value) > 0.1")
        do(loaded, "pause")
        yield loaded


PROJECT = Path(__file__).with_name("project.js").read_text("utf-8")


def extent(page, time):
    """Share of the picture's half width or height that the robot reaches."""
    points = WALK["p_WN"].sel(time=time).values
    return np.abs(np.array(page.evaluate(PROJECT, points.tolist()))[:, :2]).max()


def test_the_camera_follows_and_keeps_the_robot_large(page):
    for width, height in ((300, 500), WINDOW):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_function(f"viewer.renderer.domElement.width == {width}")
        for time in (0.0, 5.0):
            do(page, "show", time)
            assert 0.5 < extent(page, time) < 0.85, f"in a width of {width}"


def text(page, output):
    """What an output of the page says."""
    return page.evaluate("id => document.getElementById(id).value", output)


def test_the_bar_plays_stops_and_tells_time_and_distance(page):
    do(page, "show", 5.0)
    x = WALK["p_WN"].values[:, 0, 0] / INCH
    assert text(page, "clock") == "5.0 / 5.0 s"
    assert text(page, "reached") == f"walked {x[-1] - x[0]:.1f} in"
    page.locator("#time").fill("2")
    assert text(page, "clock") == "2.0 / 5.0 s"
    page.locator("#play").click()
    page.wait_for_function("parseFloat(document.getElementById('clock').value) > 2.1")
    page.locator("#play").click()
    # Keys do the same.
    do(page, "show", 2.0)
    page.evaluate("document.activeElement.blur()")
    for key, time in (("ArrowRight", "2.1"), ("Shift+ArrowRight", "3.1"), ("ArrowLeft", "3.0")):
        page.keyboard.press(key)
        assert text(page, "clock") == f"{time} / 5.0 s"
    page.locator("#time").focus()  # where the browser has its own use of keys
    for pressed in ("true", "false"):
        page.keyboard.press("Space")
        assert page.locator("#play").get_attribute("aria-pressed") == pressed


def test_on_a_phone_nothing_lies_over_the_robot(browser, replay):
    box = "id => document.getElementById(id).getBoundingClientRect().toJSON()"
    with opened(browser, replay.as_uri(), size=(400, 700)) as page:
        wait_until_loaded(page)
        for legend_is_open in (False, True):
            page.evaluate(f"document.getElementById('legend').open = {str(legend_is_open).lower()}")
            page.wait_for_timeout(200)
            pane = page.evaluate(box, "meshcat-pane")
            assert pane["height"] > 250
            assert page.evaluate(box, "heading")["bottom"] <= pane["top"] + 1
            for below in ("bar", "legend"):
                assert page.evaluate(box, below)["top"] >= pane["bottom"] - 1
        assert page.evaluate("document.documentElement.scrollWidth") <= 400


@pytest.mark.parametrize(("name", "view"), [("talk.mp4", "side"), ("talk.gif", "top")])
def test_a_video_has_its_size_rate_and_speed(browser, replay, tmp_path, name, view):
    """The motion of 5 s takes 0.5 s at ten times its speed. The page's texts would fill it."""
    reader = pytest.importorskip("imageio_ffmpeg").read_frames
    settings = {"size": (320, 180), "fps": 10.0, "view": view, "speed": 10.0}
    with ThreadPoolExecutor(1) as pool:  # this thread may have the browser of other tests
        pool.submit(make_video, replay.read_text(), tmp_path / name, **settings).result()
    about, *frames = reader(str(tmp_path / name))
    assert about["size"] == (320, 180) and about["fps"] == pytest.approx(10.0)
    assert len(frames) == 5 and frames[0] != frames[-1]
