"""A picture of the walking robot: a replay page at one instant, drawn by a headless browser.

Needs Chromium or Chrome, and the Python package playwright (`pip install -e '.[test]'`).
"""

from __future__ import annotations

import argparse
import contextlib
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tetra_drake.errors import InputError
from tetra_drake.files import whole_file

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

SIZE = 1280, 720
"""Pixels across and down."""

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


def main(arguments: Sequence[str] | None = None) -> int:
    """Writes the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("replay", metavar="REPLAY", type=Path, help="a replay.html")
    parser.add_argument("--time", metavar="S", type=float, default=0.0, help="default: %(default)s")
    parser.add_argument("--out", metavar="FILE.png", type=Path, required=True)
    options = parser.parse_args(arguments)
    if not options.replay.is_file():
        parser.error(f"{options.replay}: no such file")
    width, height = SIZE
    try:
        with launch_browser() as browser, whole_file(options.out) as file:
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(options.replay.resolve().as_uri())
            wait_until_loaded(page)
            show_instant(page, options.time)
            page.screenshot(path=file, type="png")
    except InputError as error:
        parser.error(str(error))
    return 0


if __name__ == "__main__":
    sys.exit(main())
