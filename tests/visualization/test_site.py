"""The site: every page is in it, links lead somewhere, and it works in a browser and on a phone."""

from __future__ import annotations

import fnmatch
import functools
import http.server
import importlib
import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from .conftest import opened

CHECKOUT = Path(__file__).parents[2]
SITE = CHECKOUT / "diagrams/site"
PHONE, DESK = (360, 720), (1280, 800)
READ = ("index", "api", "runs/index", "runs/thesis/THESIS", "tetra_drake/scenario/KEYS")


def test_every_page_is_in_the_navigation():
    text = (SITE / "mkdocs.yml").read_text(encoding="utf-8")
    nav = re.findall(r"- (?:.*: )?(\S+\.md|\S+\*\S+)$", text, re.MULTILINE)
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=CHECKOUT, capture_output=True)
    no_pages = json.loads(re.search(r"no_pages: (\[.*\])", text)[1])
    names = [n for n in listed.stdout.decode().split() if (CHECKOUT / n).is_file()]
    pages = [n for n in names if not any(fnmatch.fnmatch(n, rest) for rest in no_pages)]
    assert [page for page in pages if not any(fnmatch.fnmatch(page, n) for n in nav)] == []
    assert "README.md" in pages


@pytest.fixture
def hooks(tmp_path, monkeypatch):
    pytest.importorskip("mkdocs")
    monkeypatch.syspath_prepend(str(SITE))
    module = importlib.import_module("hooks")
    monkeypatch.setattr(module, "RUNS", tmp_path / "kept")
    return module


def test_a_tutorial_is_run_once_and_shows_what_it_prints_and_draws(hooks, tmp_path):
    script, log = tmp_path / "01_try.py", tmp_path / "log.txt"
    draws = "open('01_try.png', 'w').write('drawn')"
    notes = f"open({str(log)!r}, 'a').write('run ')"
    script.write_text(f'"""A try: it adds."""\n\n# %% Adding.\nprint(1 + 2)\n{draws}\n{notes}\n')
    for _ in range(2):
        output = hooks.run(script, "0*")
    assert (output.printed, output.picture.read_text(), log.read_text()) == ("3", "drawn", "run ")
    page = hooks.tutorial_page(script, output)
    assert page.startswith("# 1. A try\n\nIt adds.\n\nAdding.\n\n~~~~python\nprint(1 + 2)")
    assert "~~~~text\n3\n~~~~" in page
    assert hooks.run(script, "02*").picture is None


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site, built without running tutorials."""
    pytest.importorskip("mkdocs")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", SITE / "mkdocs.yml"]
    environment = os.environ | {"TUTORIALS": "none"}
    command += ["-d", folder]
    built = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def address(site):
    """The address of the served site, with a slash at its end."""
    pages = functools.partial(http.server.SimpleHTTPRequestHandler, directory=site)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), pages)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()


@pytest.mark.slow
def test_no_page_is_wider_than_a_phone_or_complains(site, address, browser):
    wide = "document.scrollingElement.scrollWidth - innerWidth"
    pages = {*site.rglob("*.html")} - {*site.glob("runs/*/replay.html"), site / "404.html"}
    names = [str(page.relative_to(site)) for page in sorted(pages)]
    with opened(browser, f"{address}index.html", size=PHONE, offline=False) as page:
        wider = []
        for name in [name for name in names if not name.startswith("tests/data/corpus/p")]:
            page.goto(address + name)
            wider += [name] if page.evaluate(wide) > 0 else []
    assert wider == []


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_are_accessible(address, browser, scheme):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    with opened(browser, f"{address}index.html", size=DESK, offline=False) as page:
        page.emulate_media(color_scheme=scheme)
        for name in READ:
            page.goto(f"{address}{name}.html")
            page.wait_for_timeout(200)  # until the theme has wrapped tables
            report = axe.run(page)
            assert report.violations_count == 0, report.generate_report()
