"""A real browser, headless and without network."""

import contextlib
import os
from pathlib import Path

import pytest
from pydrake.geometry import MeshcatParams

from tetra_drake.lab.films.browser import find_browser, launch_browser
from tetra_drake.visualization.replay import quiet_meshcat

PATIENCE = 90_000  # ms
WINDOW = 600, 400  # small, as it is drawn again and again in software
NO_PIXELS = Path(__file__).with_name("no_pixels.js").read_text("utf-8")


@pytest.fixture(scope="module")
def browser():
    """Without Chromium the tests skip; where CI is set they fail instead."""
    if not os.environ.get("CI"):
        pytest.importorskip("playwright")
        if find_browser() is None:
            pytest.skip("neither Chromium nor Chrome is installed")
    with launch_browser() as launched:
        yield launched


@pytest.fixture
def meshcat():
    return quiet_meshcat(MeshcatParams(host="localhost", port=0))


@contextlib.contextmanager
def opened(browser, address, *, size=WINDOW, offline=True, draws=True):
    """A page, which must not complain, nor ask for anything but what lies beside it. Without
    `draws` its pixels stay empty, which takes a third of the time."""
    complaints, requests = [], []
    viewport = dict(zip(("width", "height"), size, strict=True))
    with contextlib.closing(browser.new_context(viewport=viewport, offline=offline)) as context:
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        if not draws:
            page.add_init_script(NO_PIXELS)
        page.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(address)
        yield page
    assert not complaints
    local = ("data:", "blob:", address.rpartition("/")[0])
    assert not [url for url in requests if not url.startswith(local)]
