"""Headless browser that shows replay pages: Chromium or Chrome, by the package playwright."""

from __future__ import annotations

import contextlib
import io
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING

from PIL import Image

from tetra_drake.errors import InputError
from tetra_drake.machine import check_package

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_SOFTWARE_WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def find_browser() -> str | None:
    """Path of an installed Chromium or Chrome; None if there is none."""
    return next((path for path in map(shutil.which, _NAMES) if path), None)


@contextlib.contextmanager
def launch_browser() -> Iterator[Browser]:
    """Context manager: a headless browser that draws WebGL without a graphics card.

    Raises InputError if no browser or no playwright is installed, or if the browser fails.
    """
    check_package("playwright", extra="video", source="browser")
    from playwright.sync_api import Error, sync_playwright

    path = find_browser()
    if path is None:
        expected = f"expected one of {', '.join(_NAMES)}; install it by: apt install chromium"
        raise InputError("browser", "", f"none is installed, {expected}")
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=path, args=_SOFTWARE_WEBGL)
            with contextlib.closing(browser):
                yield browser
    except Error as error:
        problem = f"{path} did not start, or failed: {error.message.splitlines()[0]}"
        raise InputError("browser", "", problem) from error


def picture_of(page: Page) -> Image.Image:
    """Screenshot of a page, in RGB."""
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def wait_until_loaded(page: Page) -> None:
    """Waits until the scripts of a replay page have built the scene."""
    page.wait_for_function("window.film")


def do(page: Page, call: str, *arguments: object) -> None:
    """Calls a function of a replay page's script film.js by its name `call`, such as "show", with
    these arguments, and waits until the page is drawn."""
    page.evaluate(
        """async ([call, given]) => {
            film[call](...given);
            const frame = () => new Promise(requestAnimationFrame);
            await frame();
            await frame();
        }""",
        [call, list(arguments)],
    )
