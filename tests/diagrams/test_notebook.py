"""The notebook of the first tutorials: its cells are the scripts', and they run."""

import nbformat
import notebook
import pytest
from helpers.shorter import shortened

IN_A_NOTEBOOK = """\
import tetra_drake as td
times = {"simulation.duration": "0.5 s", "simulation.steady_from": "0.1 s"}
small = td.load_scenario("quick").with_changes(times | {"evolution.evaluations": 12})
run = td.evolve(small, "out/diagram", progress=True, reevaluate=False, report=False)
"""


def outputs(cell):
    """Types of a cell's output, with the MIME types of what it displays."""
    return [(one["output_type"], *one.get("data", {})) for one in cell.get("outputs", [])]


def test_the_notebook_has_the_cells_of_the_scripts_and_their_outputs():
    kept, made = nbformat.read(notebook.NOTEBOOK, as_version=4), notebook.make_notebook()
    assert [cell["source"] for cell in kept.cells] == [cell["source"] for cell in made.cells]
    pictures = [one for cell in kept.cells for one in outputs(cell) if "image/png" in one]
    assert len(pictures) == len(notebook.SCRIPTS)  # each figure is shown once


@pytest.mark.slow
def test_its_cells_run_and_values_are_shown_as_tables(tmp_path):
    made = notebook.make_notebook()
    for cell in made.cells:
        cell["source"] = shortened(cell["source"])
    shown = ["scenario", "gait", "result", "result.metrics", "run"]
    for source in (IN_A_NOTEBOOK, *shown, 'td.load_scenario("nonsense")'):
        made.cells.append(nbformat.v4.new_code_cell(source))
    made.cells[-1]["metadata"]["tags"] = ["raises-exception"]
    done = notebook.execute(made, tmp_path)
    evolved, *values, refused = done.cells[-len(shown) - 2 :]
    assert any("evaluations: 12 of 12" in str(one) for one in evolved["outputs"])
    for cell in values:
        ((_, *kinds),) = outputs(cell)
        assert "text/html" in kinds, cell["source"]
        assert "<td" in cell["outputs"][0]["data"]["text/html"]
    (error,) = refused["outputs"]
    assert len(error["traceback"]) == 1 and "nonsense" in error["traceback"][0]
