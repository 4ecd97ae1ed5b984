"""The commands `analyse` and `tables`, as a person meets them."""

import pytest

from tetra_drake.cli import main

MARKS = "<!-- table {}: made by tetra-drake tables -->\n<!-- end -->\n"


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("# Page\n\n" + MARKS.format("comparison"))
    return path


def test_all_tables_are_printed(runs, capsys):
    assert main(["tables", str(runs)]) == 0
    printed = capsys.readouterr().out
    assert "| best evolved distance, in | 14.34 | 20.00 | 6.00 |" in printed
    assert "\nresimulation\n\n| best gait |" in printed


def test_tables_go_into_files(runs, page, tmp_path, capsys):
    other = tmp_path / "other.md"
    other.write_text(MARKS.format("engines") + MARKS.format("tau-mutation"))
    assert main(["tables", str(runs), "--into", str(page), "--into", str(other)]) == 0
    assert str(other) in capsys.readouterr().out
    assert "| 14.34 | 20.00 | 6.00 |" in page.read_text()
    assert page.read_text().startswith("# Page\n")
    assert "**mean**" in other.read_text()


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (MARKS.format("engine"), "line 1: no table is called 'engine'"),
        (MARKS.format("engines").replace("<!-- end -->", ""), "line 1: table engines has no line"),
        ("nothing", "holds no line"),
        (None, "no such file"),
    ],
)
def test_if_one_file_is_no_good_none_is_written(runs, page, tmp_path, capsys, text, problem):
    before, bad = page.read_text(), tmp_path / "bad.md"
    if text is not None:
        bad.write_text(text)
    assert main(["tables", str(runs), "--into", str(page), "--into", str(bad)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"tetra-drake: {bad}: ")
    assert problem in line
    assert page.read_text() == before


@pytest.mark.parametrize("command", ["analyse", "tables"])
def test_a_folder_without_a_run_is_refused(command, tmp_path, capsys):
    assert main([command, str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"tetra-drake: {tmp_path}: holds no ")
    assert not list(tmp_path.iterdir())
