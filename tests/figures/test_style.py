"""The look that figures share, and how they are written."""

import subprocess
import sys

import matplotlib
import pytest

from tetra_drake.figures.style import (
    LINE_COLOURS,
    OKABE_ITO,
    common_style,
    line_style,
    make_figure,
    save_figure,
)


@common_style()
def draw(*, title="title", value=1.0):
    figure, [[panel]] = make_figure(width_in=4.0, height_in=3.0)
    panel.plot([0.0, 1.0], [0.0, value], label="a line")
    panel.axvspan(0.2, 0.4)
    panel.set_title(title)
    panel.legend()
    return figure


def saved(folder, **options):
    save_figure(draw(**options), folder, "line")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_equal_data_give_equal_bytes_whatever_the_users_style(tmp_path):
    files = saved(tmp_path / "a")
    own = {"lines.linewidth": 9.0, "svg.hashsalt": None, "xtick.labelsize": 20.0}
    with matplotlib.rc_context(own):
        assert saved(tmp_path / "b") == files
        assert matplotlib.rcParams["lines.linewidth"] == 9.0
    assert saved(tmp_path / "c", value=2.0)["line.svg"] != files["line.svg"]
    assert set(files) == {"line.svg", "line.png"}
    assert b"<svg" in files["line.svg"] and b"<dc:date>" not in files["line.svg"]
    assert files["line.png"].startswith(b"\x89PNG")


def test_a_figure_that_cannot_be_drawn_leaves_nothing(tmp_path):
    with pytest.raises(ValueError, match="nonsense"):
        saved(tmp_path, title=r"$\nonsense$")
    assert list(tmp_path.iterdir()) == []


def test_series_differ_in_colour_and_many_in_colour_and_dashes():
    assert len({line_style(i)["color"] for i in range(len(LINE_COLOURS))}) == len(LINE_COLOURS)
    assert len({(s["color"], s["linestyle"]) for s in map(line_style, range(28))}) == 28
    assert OKABE_ITO["yellow"] not in LINE_COLOURS  # too faint on white


@pytest.mark.slow
def test_figures_need_no_pyplot_and_so_no_display():
    modules = ("book", "disturbed", "search")
    lines = [f"import tetra_drake.figures.{module}" for module in modules]
    program = "\n".join([*lines, "import sys; sys.exit('matplotlib.pyplot' in sys.modules)"])
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0
