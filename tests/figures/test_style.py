"""The look that figures share, and how they are written."""

import matplotlib
from matplotlib.figure import Figure

from tetra_drake.figures.style import common_style, figure_function, page_of, save_figure


@figure_function
def draw(value):
    page = page_of(height_in=3.0)
    panel = page.subplots()
    panel.plot([0.0, 1.0], [0.0, value], label="a line")
    panel.legend()
    return page


def saved(folder, *, value=1.0, kinds=("svg", "png", "pdf")):
    save_figure(draw(value), folder, "line", kinds=kinds)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_equal_data_give_equal_bytes_whatever_the_users_style(tmp_path):
    files = saved(tmp_path / "a")
    users = {"lines.linewidth": 9.0, "svg.hashsalt": None, "xtick.labelsize": 20.0}
    with matplotlib.rc_context(users):
        assert saved(tmp_path / "b") == files
        assert matplotlib.rcParams["lines.linewidth"] == 9.0
    assert saved(tmp_path / "c", value=2.0, kinds=["svg"])["line.svg"] != files["line.svg"]
    starts = {"line.svg": b"<?xml", "line.png": b"\x89PNG", "line.pdf": b"%PDF"}
    assert {name: files[name][: len(start)] for name, start in starts.items()} == starts


def test_a_name_is_no_formula_but_a_text_in_the_common_style_may_be():
    named = figure_function(lambda: page_of(height_in=1.0).suptitle("$x^2$").figure)()
    assert not named.texts[0].get_parse_math()
    with common_style():
        assert Figure().text(0.0, 0.0, "$x^2$").get_parse_math()
