"""Makes the notebook of the first three tutorials, with its outputs.

    python diagrams/notebook.py

It has the cells of the scripts; in place of a picture in a file, a figure is shown. Needs the
packages nbclient and ipykernel (`pip install -e '.[test]'`).
"""

from __future__ import annotations

import argparse
import re
import tempfile
from pathlib import Path

import nbformat
from cells import read_cells
from nbclient import NotebookClient

TUTORIALS = Path(__file__).parent / "tutorials"
SCRIPTS = ("01_first_gait", "02_evolution", "03_objective")
NOTEBOOK = TUTORIALS / "01_to_03.ipynb"

_SAVED = re.compile(r'\.savefig\(f"\{Path\(__file__\).*\)')


def make_notebook() -> nbformat.NotebookNode:
    """The notebook without outputs."""
    cells = [nbformat.v4.new_code_cell("%matplotlib inline", id="inline")]
    for script in SCRIPTS:
        title, parts = read_cells(TUTORIALS / f"{script}.py")
        cells.append(nbformat.v4.new_markdown_cell(f"## {title}", id=script))
        for number, cell in enumerate(parts):
            code = _SAVED.sub("", cell.code).strip()
            cells.append(nbformat.v4.new_markdown_cell(cell.about, id=f"{script}-{number}"))
            cells.append(nbformat.v4.new_code_cell(code, id=f"{script}-{number}-code"))
    return nbformat.v4.new_notebook(cells=cells)


def execute(notebook: nbformat.NotebookNode, folder: str | Path) -> nbformat.NotebookNode:
    """Executes a notebook in a folder. Raises CellExecutionError if a cell fails."""
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook.metadata["kernelspec"] = kernel
    resources = {"metadata": {"path": str(folder)}}
    return NotebookClient(
        notebook, timeout=1200, record_timing=False, resources=resources
    ).execute()


def main(out: Path = NOTEBOOK) -> None:
    """Executes the notebook in an empty folder, and writes it."""
    with tempfile.TemporaryDirectory() as folder:
        notebook = execute(make_notebook(), folder)
    nbformat.write(notebook, out)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", nargs="?", type=Path, default=NOTEBOOK)
    main(parser.parse_args().out)
