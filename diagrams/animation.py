"""Pictures and films of a walking robot, from its replay page in a headless browser.

    tetra-drake replay RUN|GAIT --out replay.html
    python diagrams/animation.py replay.html walking.gif walking.png

A GIF shows 6 s at twice their speed, with a camera that follows. A PNG shows the robot
at four equally spaced times, with the distance walked. Needs Chromium or Chrome, and the Python
package playwright (`pip install -e '.[test]'`).
"""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file
from tetra_drake.lab.films.browser import do, launch_browser, picture_of, wait_until_loaded
from tetra_drake.visualization.scene import COLOURS

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

LIMITS = {".gif": 400_000, ".png": 90_000}
"""Largest sizes of files in bytes. Pictures become narrower to meet them."""

GROUND_COLOURS = {".gif": 8, ".png": 100}
"""Number of colours of a picture in addition to the robot's colours."""

GREYS = 8
"""Number of greys of a picture."""

ASPECTS = {".gif": 16 / 9, ".png": 2.8}
"""Ratio of width to height of a picture."""

WIDTHS = {".gif": range(560, 239, -40), ".png": range(800, 239, -80)}
"""Width in pixels."""

SUPERSAMPLING = 2
START, END, STEP = 4.0, 10.0, 0.2  # first and last frame, and time between frames, in s
FRAME_TIME = 100  # ms: twice as fast as the robot walks
INSTANTS = 4  # of a still


def shots(page: Page, times: Iterable[float]) -> list[Image.Image]:
    """Pictures of the robot at times (s) of the motion."""
    do(page, "dress", False)
    page.evaluate("viewer.set_property(['floor', 'squares'], 'visible', false)")  # they flicker
    images = []
    for time in times:
        do(page, "show", time)
        images.append(picture_of(page))
    return images


def still(page: Page, times: Sequence[float]) -> Image.Image:
    """One picture of the robot at several times (s) of the motion."""
    do(page, "still", list(times))
    return picture_of(page)


def save(images: Sequence[Image.Image], path: Path) -> None:
    """Writes images as a picture or as an endless animation. Its width is limited by LIMITS."""
    palette = _palette(images[0], GROUND_COLOURS[path.suffix])
    with whole_file(path) as temporary:
        for width in WIDTHS[path.suffix]:
            size = width, round(width * images[0].height / images[0].width)
            small = [image.resize(size, Image.Resampling.LANCZOS) for image in images]
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
    """Palette of a picture: the robot's colours in light and shade, greys for shadows and grid, and
    `count` colours of an image."""
    names = ("rear", "lead", "node", "stance", "actuated", "passive")
    robot = np.array([list(bytes.fromhex(COLOURS[name][1:])) for name in names])
    greys = np.repeat(np.linspace(120, 225, GREYS), 3)
    others = image.quantize(count).getpalette() or []
    palette = Image.new("P", (1, 1))
    colours = np.concatenate([*(robot * 0.7), *robot, greys, others])
    palette.putpalette(colours.astype(int).tolist())
    return palette


def make_picture(browser: Browser, replay: Path, file: Path) -> None:
    """Writes a picture or film of a replay page. The suffix of the file must be a key of LIMITS."""
    width = WIDTHS[file.suffix][0]
    height = round(width / ASPECTS[file.suffix])
    page = browser.new_page(
        viewport={"width": width, "height": height}, device_scale_factor=SUPERSAMPLING
    )
    with contextlib.closing(page):
        page.goto(replay.resolve().as_uri())
        wait_until_loaded(page)
        duration = page.evaluate("film.duration")
        if file.suffix == ".gif":
            save(shots(page, np.arange(START, min(duration, END), STEP).tolist()), file)
        else:
            times = np.linspace(0.0, duration, INSTANTS).round(2).tolist()
            save([still(page, times)], file)


def main() -> None:
    """Runs the script: films a replay page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("replay", metavar="REPLAY.html", type=Path)
    parser.add_argument("files", metavar="FILE.gif|FILE.png", type=Path, nargs="+")
    options = parser.parse_args()
    for file in options.files:
        if file.suffix not in LIMITS:
            parser.error(f"{file}: expected a file that ends in {' or '.join(LIMITS)}")
    with launch_browser() as browser:
        for file in options.files:
            make_picture(browser, options.replay, file)


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"animation.py: {error}")
