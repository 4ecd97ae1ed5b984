"""The walking robot as an animated GIF: a replay page, filmed in a headless browser.

    python diagrams/robot.py
    python diagrams/animation.py diagrams/robot.html diagrams/walking.gif

Needs Chromium or Chrome, and the Python package playwright (`pip install -e '.[test]'`).
"""

from __future__ import annotations

import argparse
import contextlib
import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from tetra_drake.errors import InputError
from tetra_drake.visualization.scene import ASPECT, COLOURS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

WIDTH, HEIGHT, SUPERSAMPLING = 720, 243, 2  # pixels
START, STEP = 1.0, 0.2  # s of the motion: of the first frame, between frames
FRAME_TIME = 100  # ms: twice as fast as the robot walks

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_SOFTWARE_WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_HIDDEN = "/Background", "/traces", "/forces"


def find_browser() -> str | None:
    """The path of an installed Chromium or Chrome."""
    return next((path for path in map(shutil.which, _NAMES) if path), None)


@contextlib.contextmanager
def launch_browser() -> Iterator[Browser]:
    """A headless browser that draws WebGL without a graphics card.

    Raises InputError if none is installed.
    """
    from playwright.sync_api import sync_playwright

    path = find_browser()
    if path is None:
        raise InputError("browser", "", f"none is installed, expected one of {', '.join(_NAMES)}")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=_SOFTWARE_WEBGL)
        with contextlib.closing(browser):
            yield browser


def wait_until_loaded(page: Page) -> None:
    """Waits until a replay page has read all it holds."""
    page.wait_for_load_state("networkidle")
    page.wait_for_function("viewer.animator.duration > 0")


def show_instant(page: Page, time: float) -> None:
    """Stops a replay page at a time (s) of the motion."""
    page.evaluate(
        """async time => {
            viewer.animator.pause();
            viewer.animator.seek(time);
            viewer.animator.display_progress(time);
            const frame = () => new Promise(requestAnimationFrame);
            await frame();
            await frame();
        }""",
        time,
    )


def film(page: Page) -> Iterator[Image.Image]:
    """Frames of a replay page, as wide as its floor, on white and without texts."""
    page.add_style_tag(content="#heading, .dg { display: none !important }")
    page.evaluate(
        """([zoom, hidden]) => {
            for (const path of hidden) {
                viewer.set_property(path.split("/").slice(1), "visible", false);
            }
            viewer.camera.zoom = zoom;
            viewer.camera.updateProjectionMatrix();
        }""",
        [WIDTH / HEIGHT / ASPECT, _HIDDEN],
    )
    end = page.evaluate("viewer.animator.duration")
    for time in np.arange(START, end, STEP):
        show_instant(page, float(time))
        frame = Image.open(io.BytesIO(page.screenshot()))
        yield frame.convert("RGB").resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def save_gif(frames: list[Image.Image], path: Path) -> None:
    """Writes an endless animation in the scene's colours, and those half faded into the floor."""
    rgb = {name: np.array(list(bytes.fromhex(code[1:]))) for name, code in COLOURS.items()}
    ground = [np.full(3, 255), rgb["floor"], rgb["inch"], rgb["six_inches"]]
    drawn = [rgb[name] for name in ("odd", "even", "actuated", "outer", "inner")]
    faded = [(colour + rgb["floor"]) // 2 for colour in [*drawn, *ground[2:]]]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate([*ground, *drawn, *faded]).tolist())
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    first.save(path, save_all=True, append_images=others, duration=FRAME_TIME, loop=0)


def main() -> None:
    """Films a page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("replay", metavar="REPLAY.html", type=Path)
    parser.add_argument("out", metavar="FILE.gif", type=Path)
    options = parser.parse_args()
    with launch_browser() as browser:
        page = browser.new_page(
            viewport={"width": WIDTH, "height": HEIGHT}, device_scale_factor=SUPERSAMPLING
        )
        page.goto(options.replay.resolve().as_uri())
        wait_until_loaded(page)
        save_gif(list(film(page)), options.out)


if __name__ == "__main__":
    main()
