"""The notebook of the first tutorials: its cells are the scripts', and they run."""

import nbformat
import notebook


def outputs(cell):
    """Types of a cell's output, with the MIME types of what it displays."""
    return [(one["output_type"], *one.get("data", {})) for one in cell.get("outputs", [])]


def test_the_notebook_has_the_cells_of_the_scripts_and_their_outputs():
    kept, made = nbformat.read(notebook.NOTEBOOK, as_version=4), notebook.make_notebook()
    assert [cell["source"] for cell in kept.cells] == [cell["source"] for cell in made.cells]
    pictures = [one for cell in kept.cells for one in outputs(cell) if "image/png" in one]
    assert len(pictures) == len(notebook.SCRIPTS)  # each figure is shown once
