"""The look that figures share, and how they are written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest
from matplotlib.figure import Figure

from tetra_drake.figures.style import (
    LINE_COLOURS,
    OKABE_ITO,
    common_style,
    line_style,
    make_figure,
    save_figure,
)


@common_style()
def draw(*, title: str = "title", value: float = 1.0) -> Figure:
    figure, [[panel]] = make_figure(width_in=4.0, height_in=3.0)
    panel.plot([0.0, 1.0], [0.0, value], label="a line")
    panel.axvspan(0.2, 0.4)
    panel.set_title(title)
    panel.legend()
    return figure


def written(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_figure_is_written_as_svg_and_png(tmp_path: Path) -> None:
    save_figure(draw(), tmp_path / "new", "line")
    files = written(tmp_path / "new")
    assert set(files) == {"line.svg", "line.png"}
    assert b"<svg" in files["line.svg"]
    assert files["line.png"].startswith(b"\x89PNG")


def test_equal_data_give_equal_bytes_whatever_the_users_style(tmp_path: Path) -> None:
    save_figure(draw(), tmp_path / "a", "line")
    own = {"lines.linewidth": 9.0, "svg.hashsalt": None, "xtick.labelsize": 20.0}
    with matplotlib.rc_context(own):
        save_figure(draw(), tmp_path / "b", "line")
        assert matplotlib.rcParams["lines.linewidth"] == 9.0
    save_figure(draw(value=2.0), tmp_path / "c", "line")
    assert written(tmp_path / "a") == written(tmp_path / "b")
    assert written(tmp_path / "a")["line.svg"] != written(tmp_path / "c")["line.svg"]
    assert b"<dc:date>" not in written(tmp_path / "a")["line.svg"]


def test_a_figure_that_cannot_be_drawn_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nonsense"):
        save_figure(draw(title=r"$\nonsense$"), tmp_path, "line")
    assert list(tmp_path.iterdir()) == []


def test_a_file_for_a_folder_is_refused(tmp_path: Path, refused) -> None:
    (tmp_path / "file").write_text("")
    with refused(tmp_path / "file" / "line.svg", "", "its folder is a file"):
        save_figure(draw(), tmp_path / "file", "line")


def test_axes_always_come_in_rows_and_columns() -> None:
    for rows, columns in ((1, 1), (3, 1), (2, 4)):
        _, panels = make_figure(width_in=4.0, height_in=3.0, rows=rows, columns=columns)
        assert panels.shape == (rows, columns)


def test_series_differ_in_colour_and_many_in_colour_and_dashes() -> None:
    assert len({line_style(i)["color"] for i in range(len(LINE_COLOURS))}) == len(LINE_COLOURS)
    assert len({(s["color"], s["linestyle"]) for s in map(line_style, range(28))}) == 28
    assert OKABE_ITO["yellow"] not in LINE_COLOURS  # too faint on white


def test_figures_need_no_pyplot_and_so_no_display() -> None:
    modules = ("forces", "motion", "evolution", "engines")
    program = "\n".join(
        [
            *(f"import tetra_drake.figures.{module}" for module in modules),
            "import sys",
            "sys.exit('matplotlib.pyplot' in sys.modules)",
        ]
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0
