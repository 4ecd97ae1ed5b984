"""The pages in a real browser, headless and without network.

Without Chromium the tests skip; where CI is set they fail instead.
"""

from __future__ import annotations

import base64
import contextlib
import io
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import animation
import numpy as np
import pytest
import xarray
from helpers.meshcat_page import unpack
from matplotlib.colors import hex2color, rgb_to_hsv
from matplotlib.image import imread
from PIL import Image

from tetra_drake.cli import main
from tetra_drake.engines.simulate import simulate
from tetra_drake.robot.gait import load_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Scenario
from tetra_drake.visualization.replay import frame_samples, replay_title, save_replay
from tetra_drake.visualization.scene import COLOURS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

if not os.environ.get("CI"):
    pytest.importorskip("playwright")
    if animation.find_browser() is None:
        pytest.skip("neither Chromium nor Chrome is installed", allow_module_level=True)

CABLES = ("actuated", "outer", "inner")
CANVAS = 900, 600
PATIENCE = 90_000  # ms
WINDOW = 600, 400  # small, as it is drawn again and again in software


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """Long enough to get somewhere."""
    thesis = load_scenario()
    return thesis.with_changes({"simulation.duration": 5.0})


@pytest.fixture(scope="module")
def trajectory(scenario: Scenario, data: Path) -> xarray.Dataset:
    gait = load_gait(data / "gait_g.json", scenario)
    recorded = simulate(scenario=scenario, gait=gait, record=True).trajectory
    assert recorded is not None
    return recorded


@pytest.fixture(scope="module")
def replay(
    scenario: Scenario, trajectory: xarray.Dataset, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    path = tmp_path_factory.mktemp("replay") / "replay.html"
    title = replay_title("a gait", trajectory)
    save_replay(path, scenario=scenario, trajectory=trajectory, title=title)
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with animation.launch_browser() as launched:
        yield launched


@contextlib.contextmanager
def new_page(
    browser: Browser, *, size: tuple[int, int] = WINDOW, offline: bool = True
) -> Iterator[Page]:
    width, height = size
    context = browser.new_context(viewport={"width": width, "height": height}, offline=offline)
    with contextlib.closing(context):
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        yield page


@contextlib.contextmanager
def opened(browser: Browser, path: Path, size: tuple[int, int] = WINDOW) -> Iterator[Page]:
    """A file's page, loaded with the network off; it must not complain, nor ask for anything
    but what lies beside it."""
    complaints: list[str] = []
    requests: list[str] = []
    with new_page(browser, size=size) as page:
        page.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(path.as_uri())
        yield page
    assert not complaints
    local = ("data:", "blob:", path.parent.as_uri())
    assert not [url for url in requests if not url.startswith(local)]


@pytest.fixture(scope="module")
def page(browser: Browser, replay: Path) -> Iterator[Page]:
    """The replay page, for tests that leave it as it was but for the time it shows."""
    with opened(browser, replay) as loaded:
        animation.wait_until_loaded(loaded)
        animation.show_instant(loaded, 0.0)
        yield loaded


def picture(page: Page) -> np.ndarray:
    """What the canvas shows, without the texts over it: (rows, columns, 3) from 0 to 1."""
    url = page.evaluate("([width, height]) => viewer.capture_image(width, height)", CANVAS)
    png = io.BytesIO(base64.b64decode(url.removeprefix("data:image/png;base64,")))
    image: np.ndarray = imread(png, format="png")[..., :3]
    return image


def pixels_of(image: np.ndarray, name: str) -> np.ndarray:
    """Rows and columns (pixels, 2) of what has the hue of one of COLOURS, however lit."""
    hue, saturation, _ = np.moveaxis(rgb_to_hsv(image), -1, 0)
    wanted, wanted_saturation, _ = rgb_to_hsv(hex2color(COLOURS[name]))
    apart = np.abs((hue - wanted + 0.5) % 1.0 - 0.5)
    return np.argwhere((apart < 0.02) & (saturation > 0.7 * wanted_saturation))


def test_plays_by_itself_at_real_speed(
    browser: Browser, replay: Path, trajectory: xarray.Dataset
) -> None:
    with opened(browser, replay) as page:
        animation.wait_until_loaded(page)
        assert page.title() == page.locator("h1").text_content()
        assert page.title() == replay_title("a gait", trajectory)
        page.wait_for_function("viewer.animator.playing && viewer.animator.time > 0.1")
        speed = page.evaluate("[viewer.animator.mixer.timeScale, viewer.animator.duration]")
        assert speed == pytest.approx([1.0, 5.0])
        page.wait_for_function("parseFloat(document.getElementById('clock').value) > 0")


def test_cables_are_seen_and_move_to_the_right(page: Page) -> None:
    columns = []
    for time in (0.0, 5.0):
        animation.show_instant(page, time)
        image = picture(page)
        for name in CABLES:
            assert len(pixels_of(image, name)) > 100, name
        columns.append(pixels_of(image, "inner")[:, 1].mean())
    assert columns[1] > columns[0] + 10


def test_the_browser_puts_the_bodies_where_they_were(
    page: Page, trajectory: xarray.Dataset
) -> None:
    frames = trajectory.isel(time=frame_samples(trajectory["time"].values))
    for frame in (0, 60, -1):
        animation.show_instant(page, float(frames["time"].values[frame]))
        for body in frames["tetrahedron"].values:
            path = f"['robot', '{body}']"
            shown = page.evaluate(f"viewer.scene_tree.find({path}).object.position.toArray()")
            recorded = frames["p_WB"].sel(tetrahedron=body).values[frame]
            # Times of key frames are rounded to 0.01 ms, and nothing moves at 1 m/s.
            np.testing.assert_allclose(shown, recorded, rtol=0, atol=1e-5)


def test_traces_end_where_the_robot_is(page: Page) -> None:
    for time in (1.0, 4.0):
        animation.show_instant(page, time)
        shown = page.evaluate(
            """viewer.scene_tree.find(['traces']).object.children
                .filter(trace => trace.visible).map(trace => parseFloat(trace.name))"""
        )
        assert time - 0.2 < max(shown) <= time


def test_every_window_shows_the_whole_robot_and_its_path(
    browser: Browser, replay: Path, trajectory: xarray.Dataset
) -> None:
    points = trajectory["p_WN"].values[::50].reshape(-1, 3).tolist()
    with opened(browser, replay, (500, 700)) as page:
        animation.wait_until_loaded(page)
        for width, height in ((500, 700), (640, 360), (300, 600), (1000, 300)):
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_function(f"viewer.renderer.domElement.width == {width}")
            seen = page.evaluate(
                """points => {
                    viewer.render();
                    // Meshcat's scene has its y axis up, so World is turned in it.
                    const world = viewer.scene_tree.object.matrixWorld;
                    return points.map(point => new MeshCat.THREE.Vector3(...point)
                        .applyMatrix4(world).project(viewer.camera).toArray());
                }""",
                points,
            )
            extent = np.abs(np.array(seen)[:, :2]).max()
            assert 0.5 < extent < 1.0, f"in a window of {width} to {height}"


def test_a_page_is_filmed(
    browser: Browser, replay: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(animation, "STEP", 1.5)
    with opened(browser, replay, size=(animation.WIDTH, animation.HEIGHT)) as page:
        animation.wait_until_loaded(page)
        animation.save_gif(list(animation.film(page)), tmp_path / "walking.gif")
    with Image.open(tmp_path / "walking.gif") as gif:
        assert gif.size == (animation.WIDTH, animation.HEIGHT)
        shots = []
        for frame in range(gif.n_frames):
            gif.seek(frame)
            shots.append(np.asarray(gif.convert("RGB")) / 255)
    assert len(shots) == 3  # at 1, 2.5 and 4 s of 5
    assert len(pixels_of(shots[-1], "inner")) > 100
    assert (shots[0][:5] == 1.0).all()  # no sky, no texts
    odd = [pixels_of(shot, "odd")[:, 1].mean() for shot in (shots[0], shots[-1])]
    assert odd[0] < odd[1]  # it walks to the right


SHORT = "base: thesis\nname: short\nsimulation: {duration: 1 s, steady_from: 0.5 s}\n"


def test_a_simulation_can_be_watched_as_it_runs(browser: Browser, tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text(SHORT)
    process = subprocess.Popen(
        [sys.executable, "-m", "tetra_drake", "simulate", "--scenario=short.yaml", "--meshcat"],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    messages: list[bytes] = []
    with process, new_page(browser, offline=False) as page:
        try:
            assert process.stdout is not None
            page.on(
                "websocket",
                lambda socket: socket.on("framereceived", lambda frame: messages.append(frame)),
            )
            page.goto(re.findall(r"http://\S+", process.stdout.readline())[0])
            page.wait_for_function("viewer.animator.duration > 0.9")
            _, errors = process.communicate(input="\n", timeout=60)
        finally:
            process.kill()
    assert (process.returncode, errors) == (0, "")
    moves = [unpack(message) for message in messages if b"set_transform" in message]
    matrices = {tuple(move["matrix"]) for move in moves if move["path"] == "/robot/T1"}
    assert len(matrices) > 10, "it was shown moving"


TINY = """\
base: thesis
name: tiny <i>"run"</i> &
simulation: {duration: 2 s, steady_from: 1 s}
evolution: {population: 3, tournament: 2}
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report that `evolve` leaves of a run with a name that must not become markup."""
    folder = tmp_path_factory.mktemp("evolve")
    (folder / "tiny.yaml").write_text(TINY)
    scenario = ["--scenario", str(folder / "tiny.yaml")]
    counts = ["--trials", "1", "--iterations", "1", "--workers", "1"]
    assert main(["evolve", *scenario, *counts, "--out", str(folder / "run")]) == 0
    return folder / "run" / "report.html"


def test_the_report_shows_its_figures_and_leads_to_the_replay(
    browser: Browser, report: Path
) -> None:
    with opened(browser, report) as page:
        page.wait_for_load_state("networkidle")
        assert page.title().startswith('tiny <i>"run"</i> &, seed 0')
        assert page.locator("i").count() == 0
        assert page.locator("img").count() > 9
        assert page.evaluate("[...document.images].every(image => image.naturalWidth > 100)")
        page.get_by_role("link", name="Watch it walk").click()
        animation.wait_until_loaded(page)
        assert page.evaluate("viewer.animator.duration") == pytest.approx(2.0)


@pytest.mark.parametrize("width", [400, 1280])
def test_the_report_fits_its_window(browser: Browser, report: Path, width: int) -> None:
    with opened(browser, report, (width, 800)) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= width
