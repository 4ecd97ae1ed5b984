"""Hooks of MkDocs that make the site from the files of the repository, without a copy of any page.

Pages are the Markdown files in Git, at their places in it, so that their links hold. Beside them
are the files to which they lead: pictures as they are, sources as pages, folders as lists of their
sources. The page of a tutorial has what its script prints and draws at the build. The picture of a
recorded run opens its replay, which the build makes.
"""

from __future__ import annotations

import ast
import fnmatch
import functools
import hashlib
import logging
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import Any

from markdown import Extension, Markdown
from markdown.preprocessors import Preprocessor
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "diagrams"))

from cells import read_cells  # noqa: E402

TUTORIALS = "diagrams/tutorials"
RUNS = ROOT / "out/tutorials"
"""What tutorials print and draw, kept for the next build with the same sources."""
PACKAGE, STUB = "tetra_drake", "tetra_drake/__init__.pyi"
REPLAYS = ROOT / "out/replays"
"""Replays of the recorded runs, kept for the next build with the same sources and gaits."""
LANGUAGES = {".py": "python", ".yaml": "yaml", ".cff": "yaml"}
"""Endings of sources that are shown as pages, with their languages."""
_LINK = re.compile(r"""(\]\(|\b(?:src|href)=")([^)"#:\s]+)(?=[)"#])""")
_WALKING = re.compile(r'(<img src="([^":]*)walking\.(?:png|gif)"[^>]*>)')
"""The picture of a recorded run, and its folder."""
_HEADED_LIST = re.compile(r"^(\*[^\n]+\*)\n(?=- )", re.MULTILINE)
"""A line before a list, which needs an empty line between for Python-Markdown."""
_DOCTEST = re.compile(r"^>>> .*(?:\n(?=\S).*)*", re.MULTILINE)
_UNLISTED = "---\nsearch: {exclude: true}\n---\n"
CORRECTIONS = {
    r"<th([^>]*)></th>": r"<td\1></td>",
    r'(<img [^>]*)width="([\d.]+%)"': r'\1style="width: \2"',
    r' autocorrect="off"| tabindex=""': "",
    r'(<input [^>]*type="(?:radio|checkbox)"[^>]*) autocomplete="off"': r"\1",
    r'(<div class="md-search"[^>]*role="dialog")': r'\1 aria-label="Search"',
}
"""Patterns in pages as the theme and Python-Markdown write them, and what is right."""
_log = logging.getLogger("mkdocs.plugins.tetra_drake")


class Doctests(Preprocessor):
    """Shows lines of a docstring from `>>>` to the next empty line as code."""

    def run(self, lines: list[str]) -> list[str]:
        """The lines of a text, with fences about doctests."""
        return _DOCTEST.sub(r"~~~~pycon\n\g<0>\n~~~~", "\n".join(lines)).split("\n")


class DoctestExtension(Extension):
    """Extension of Python-Markdown with Doctests, before fences are found."""

    def extendMarkdown(self, md: Markdown) -> None:
        """Registers the preprocessor."""
        md.preprocessors.register(Doctests(md), "doctests", 30)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Replaces names of files in the navigation by their pages, and patterns by what matches."""
    written = str(config.nav)
    others = [name for name in tracked() if f"'{name}'" not in written]

    def pages(nav: Any) -> Any:
        if isinstance(nav, dict):
            return {title: pages(part) for title, part in nav.items()}
        if isinstance(nav, str):
            return page_of(nav)
        each = (fnmatch.filter(others, part) if "*" in part else [part] for part in nav)
        return [pages(part) for parts in each for part in parts]

    config.nav = pages(config.nav)
    if address := config.extra["repository"]:
        config.nav.append({"Repository": address})
    config.markdown_extensions.append(DoctestExtension())
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages, and all to which they lead."""
    names = tracked()
    folders = {str(folder) for name in names for folder in Path(name).parents}
    no_pages = {name for rest in config.extra["no_pages"] for name in fnmatch.filter(names, rest)}
    todo = [name for name in names if name.endswith(".md") and name not in no_pages]
    for name in todo:  # which grows
        if name.endswith(".md"):
            text = (ROOT / name).read_text(encoding="utf-8")
            targets = {normpath(join(dirname(name), link)) for _, link in _LINK.findall(text)}
            todo += sorted(targets & folders.union(names).difference(todo))
    scripts = fnmatch.filter(names, f"{TUTORIALS}/*.py")
    for name in set(todo).difference(scripts):
        files.append(file_of(name, config))
    for name in scripts:
        script, picture = ROOT / name, str(Path(name).with_suffix(".png"))
        output = run(script, config.extra["tutorials"])
        files.append(File.generated(config, page_of(name), content=tutorial_page(script, output)))
        if output.picture:
            if kept := files.get_file_from_path(picture):
                files.remove(kept)
            files.append(File.generated(config, picture, abs_src_path=str(output.picture)))
    for file in sorted(replays().rglob("*.*")):
        name = f"runs/{file.relative_to(replays())}"
        files.append(File.generated(config, name, abs_src_path=str(file)))
    for page, module in (("api", PACKAGE), ("api_systems", f"{PACKAGE}.systems")):
        files.append(File.generated(config, f"{page}.md", content=api_page(module)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Leads links to sources and folders to their pages, and pictures of runs to replays."""
    if page.is_homepage:
        page.meta["hide"] = ["navigation"]

    def to_page(link: re.Match[str]) -> str:
        name = normpath(join(dirname(page.file.src_uri), link[2]))
        return link[1] + link[2].rstrip("/") + page_of(name).removeprefix(name)

    markdown = _HEADED_LIST.sub(r"\1\n\n", _LINK.sub(to_page, markdown))
    return _WALKING.sub(r'<a href="\2replay.html">\1</a>', markdown)


def on_post_page(output: str, **_: Any) -> str:
    """Corrects what HTML does not allow, and names what has no name for screen readers."""
    for wrong, right in CORRECTIONS.items():
        output = re.sub(wrong, right, output)
    return output


on_post_template = on_post_page  # for the page 404.html


def tracked() -> list[str]:
    """Names of the files in Git, in order."""
    command = ["git", "ls-files", "-z"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, check=True, text=True).stdout
    return sorted(name for name in listed.split("\0") if (ROOT / name).is_file())


def page_of(name: str) -> str:
    """Name of the page of a file or of a folder; the file's own name where it is its own page."""
    is_shown = Path(name).suffix in LANGUAGES or (ROOT / name).is_dir()
    return f"{name}.md" if is_shown else name


def file_of(name: str, config: MkDocsConfig) -> File:
    """The file of MkDocs for a file or folder of the repository."""
    path, shown = ROOT / name, page_of(name)
    if path.is_dir():
        text = folder_page(path)
    elif shown != name:
        source = path.read_text(encoding="utf-8")
        text = f"{_UNLISTED}# `{name}`\n\n~~~~{LANGUAGES[path.suffix]}\n{source}\n~~~~\n"
    else:
        file = File.generated(config, name, abs_src_path=str(path))
        file.dest_uri = file.dest_uri.lstrip(".")  # hosts leave out names that begin with a dot
        return file
    return File.generated(config, shown, content=text, inclusion=InclusionLevel.NOT_IN_NAV)


def folder_page(folder: Path) -> str:
    """List of the sources in a folder, each with the first line of its docstring or comment."""
    lines = [f"{_UNLISTED}# `{folder.relative_to(ROOT)}/`\n"]
    for file in sorted(folder.iterdir()):
        if file.suffix == ".py" and (about := ast.get_docstring(ast.parse(file.read_bytes()))):
            lines.append(f"- `{file.name}`: {about.splitlines()[0]}")
        elif file.suffix == ".yaml":
            lines.append(f"- `{file.name}`")
    return "\n".join(lines)


def api_page(module: str) -> str:
    """Page of the names that a package exports, from the imports in its stub."""
    stub = ROOT / STUB
    source = stub if module == PACKAGE else stub.parent / module.rpartition(".")[2] / stub.name
    tree = ast.parse(source.read_text(encoding="utf-8"))
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.module]
    names = [(node.module, name.name) for node in imports for name in node.names]
    text = [f"# `{module}`\n", *(f"::: {where}.{name}\n" for where, name in names)]
    return "\n".join(text)


@dataclass(frozen=True)
class Output:
    """What a tutorial prints and draws, or why the build did not run it."""

    printed: str = ""
    picture: Path | None = None
    reason: str = ""


def run(script: Path, wanted: str) -> Output:
    """Runs a tutorial whose name is wanted, unless RUNS has its output with the same sources.

    Raises PluginError if it fails, but not if a package is missing that it imports itself.
    """
    if not fnmatch.fnmatch(script.stem, wanted):
        return Output(reason=f"it runs tutorials named {wanted}")
    sources = [script, *sorted((ROOT / PACKAGE).rglob("*.py"))]
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in sources)).hexdigest()
    folder, drawn = RUNS / f"{script.stem}-{digest[:16]}", f"{script.stem}.png"
    if not folder.exists():
        _log.info("Running %s", script.name)
        RUNS.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=RUNS) as work:
            Path(work, "runs").symlink_to(ROOT / "runs")  # which tutorials read
            done = subprocess.run(
                [sys.executable, script], cwd=work, capture_output=True, text=True
            )
            if done.returncode:
                last = (done.stderr.strip().splitlines() or ["no message"])[-1]
                if last.startswith("ModuleNotFoundError"):
                    return Output(reason=last)
                raise PluginError(f"{script.name} failed: {last}")
            if not Path(work, drawn).is_file():
                raise PluginError(f"{script.name} drew no {drawn}")
            kept = Path(work, "kept")
            kept.mkdir()
            (kept / "printed.txt").write_text(done.stdout, encoding="utf-8")
            Path(work, drawn).rename(kept / drawn)
            kept.rename(folder)
    return Output((folder / "printed.txt").read_text(encoding="utf-8").rstrip(), folder / drawn)


@functools.cache
def replays() -> Path:
    """Folder with the replays of the recorded runs, and what they load."""
    gaits = [ROOT / name for name in tracked() if fnmatch.fnmatch(name, "runs/*/best_gait.json")]
    sources = [*gaits, *sorted((ROOT / PACKAGE).rglob("*.py"))]
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in sources)).hexdigest()
    folder = REPLAYS / digest[:16]
    if not folder.exists():
        _log.info("Making the replays of the recorded runs")
        REPLAYS.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=REPLAYS) as work:
            made, script = Path(work, "made"), ROOT / "runs/gallery.py"
            subprocess.run([sys.executable, script, "--replays", made], cwd=ROOT, check=True)
            made.rename(folder)
    return folder


def tutorial_page(script: Path, output: Output) -> str:
    """Page of a tutorial: its cells, and its output."""
    title, cells = read_cells(script)
    heading, _, about = title.partition(":")
    about = about.strip()
    text = [f"# {int(script.stem[:2])}. {heading.strip()}", about[:1].upper() + about[1:]]
    for cell in cells:
        text += [cell.about, f"~~~~python\n{cell.code}\n~~~~"]
    if output.printed:
        text += ["## What it prints", f"~~~~text\n{output.printed}\n~~~~"]
    text += ["## What it draws", f"![Picture of {script.name}]({script.stem}.png)"]
    if output.reason:
        text.append(
            f"The picture is the repository's. This build did not run the script: {output.reason}"
        )
    return "\n\n".join(text)
