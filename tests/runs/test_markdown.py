"""Tables in Markdown, and what stands between marker lines."""

import pytest

from tetra_drake.experiment.markdown import fill_tables, fixed, markdown_table, signed

BEGIN, END = "<!-- table {}: made by tetra-drake tables -->", "<!-- end -->"
PAGE = f"""# Title

{BEGIN.format("one")}
something old

and older
{END}

between <!-- end -->

{BEGIN.format("two")}
{END}
"""


def make(name):
    return {"one": "| 1 |", "two": "| 2 |"}[name]


def test_tables_take_the_place_of_what_stood_between_their_markers():
    expected = f"""# Title

{BEGIN.format("one")}

| 1 |

{END}

between <!-- end -->

{BEGIN.format("two")}

| 2 |

{END}
"""
    assert fill_tables(PAGE, make, source="page.md") == expected


def test_filling_a_filled_page_changes_nothing():
    filled = fill_tables(PAGE, make, source="page.md")
    assert fill_tables(filled, make, source="page.md") == filled


def test_an_unknown_table_is_refused(refused):
    page = PAGE.replace("table two", "table three")
    with refused("page.md", "line 11", "no table is called 'three'"):
        fill_tables(page, make, source="page.md")


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(PAGE.rsplit(END, 1)[0], id="at the end of the file"),
        pytest.param(
            f"{BEGIN.format('one')}\n\n{BEGIN.format('two')}\n{END}\n", id="before another table"
        ),
    ],
)
def test_a_table_without_an_end_is_refused(page, refused):
    line = "line 11" if page.startswith("#") else "line 1"
    with refused("page.md", line, "has no line `<!-- end -->` after it"):
        fill_tables(page, make, source="page.md")


def test_a_page_without_a_place_for_a_table_is_refused(refused):
    with refused("page.md", "", "holds no line `<!-- table NAME"):
        fill_tables("# Title\n", make, source="page.md")


def test_a_table_aligns_text_to_the_left_and_numbers_to_the_right():
    table = markdown_table(["what", "n", "why"], [["a", "1", "so"]], text_columns=(0, 2))
    assert table == "| what | n | why |\n| --- | ---: | --- |\n| a | 1 | so |"


def test_numbers_that_round_to_zero_have_no_sign():
    assert [fixed(x) for x in (-0.001, -0.006, 1.0, float("nan"))] == ["0.00", "-0.01", "1.00", "-"]
    assert [signed(x) for x in (0.001, 0.006, -1.0, float("nan"))] == [
        "0.00",
        "+0.01",
        "-1.00",
        "-",
    ]
