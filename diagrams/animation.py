"""The walking robot in pictures: a replay page, filmed in a headless browser.

    tetra-drake replay RUN|GAIT --out replay.html
    python diagrams/animation.py replay.html walking.gif walking.png

A GIF shows the first 15 s at twice their speed; a PNG the end of the motion, with the paths of the
bottom nodes. Needs Chromium or Chrome, and the Python package playwright
(`pip install -e '.[test]'`).
"""

from __future__ import annotations

import argparse
import contextlib
import io
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageChops

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file
from tetra_drake.visualization.scene import ASPECT, COLOURS, PASSIVE_COLOURS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

LIMITS = {".gif": 500_000, ".png": 60_000}
"""Sizes of files in bytes, for which pictures become as narrow as they must."""

GROUND_COLOURS = {".gif": 8, ".png": 64}
"""Number of colours that a picture has beside the robot's."""

WIDTHS, SUPERSAMPLING = range(720, 239, -80), 2  # pixels
START, END, STEP = 1.0, 15.0, 0.2  # s of the motion: of the frames, between frames
FRAME_TIME = 100  # ms: twice as fast as the robot walks

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_SOFTWARE_WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")


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


def shots(page: Page, times: Iterable[float], *, traces: bool) -> list[Image.Image]:
    """Pictures of a replay page at times (s) of the motion: the robot and its floor on white, with
    or without the traces."""
    page.add_style_tag(content="#heading, .dg { display: none !important }")
    for name, shown in {"Background": False, "forces": False, "traces": traces}.items():
        page.evaluate(
            "([name, shown]) => viewer.set_property([name], 'visible', shown)", [name, shown]
        )
    images = []
    for time in times:
        show_instant(page, time)
        images.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
    return images


def save(images: Sequence[Image.Image], path: Path) -> None:
    """Writes images on white as a picture or an endless animation, without the margins that all
    have, as wide as LIMITS allow."""
    white = Image.new("RGB", images[0].size, "white")
    boxes = np.array([ImageChops.difference(image, white).getbbox() for image in images])
    low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    cut = [image.crop((*low.tolist(), *high.tolist())) for image in images]
    palette = _palette(images[0], GROUND_COLOURS[path.suffix])
    with whole_file(path) as temporary:
        for width in WIDTHS:
            size = width, round(width * cut[0].height / cut[0].width)
            small = [image.resize(size, Image.Resampling.LANCZOS) for image in cut]
            first, *others = (
                image.quantize(palette=palette, dither=Image.Dither.NONE) for image in small
            )
            if path.suffix == ".gif":
                film = {"append_images": others, "duration": FRAME_TIME, "loop": 0}
                first.save(temporary, None, save_all=True, **film)
            else:
                first.save(temporary, optimize=True)
            if temporary.stat().st_size <= LIMITS[path.suffix]:
                break


def _palette(image: Image.Image, count: int) -> Image.Image:
    """The colours of the robot, those half faded into the floor, and `count` of an image."""
    rgb = {name: np.array(list(bytes.fromhex(code[1:]))) for name, code in COLOURS.items()}
    drawn = [rgb[name] for name in ("odd", "even", "actuated", *PASSIVE_COLOURS, "trace")]
    faded = [(colour + rgb["floor"]) // 2 for colour in drawn]
    others = image.quantize(count).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate([[255, 255, 255], *drawn, *faded, others]).tolist())
    return palette


def make_pictures(browser: Browser, replay: Path, files: Sequence[Path]) -> None:
    """Writes pictures of a replay page, of kinds in LIMITS."""
    page = browser.new_page(
        viewport={"width": WIDTHS[0], "height": round(WIDTHS[0] / ASPECT)},
        device_scale_factor=SUPERSAMPLING,
    )
    with contextlib.closing(page):
        page.goto(replay.resolve().as_uri())
        wait_until_loaded(page)
        duration = page.evaluate("viewer.animator.duration")
        for file in files:
            if file.suffix == ".gif":
                times = np.arange(START, min(duration, END), STEP).tolist()
                save(shots(page, times, traces=False), file)
            else:
                save(shots(page, [duration], traces=True), file)


def main() -> None:
    """Films a page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("replay", metavar="REPLAY.html", type=Path)
    parser.add_argument("files", metavar="FILE.gif|FILE.png", type=Path, nargs="+")
    options = parser.parse_args()
    for file in options.files:
        if file.suffix not in LIMITS:
            parser.error(f"{file}: expected a file that ends in {' or '.join(LIMITS)}")
    with launch_browser() as browser:
        make_pictures(browser, options.replay, options.files)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"animation.py: {error}")
