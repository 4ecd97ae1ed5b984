"""A gait as a table: each number where its row and column say."""

import dataclasses

import pytest

from tetra_drake.robot.gait import Gains, Gait, seeded_gait
from tetra_drake.robot.gait_table import gait_table
from tetra_drake.scenario.load import load_scenario


def matrices(text: str) -> dict[str, dict[tuple[int, int], str]]:
    """By kind of neuron, the cells by row and column."""
    found: dict[str, dict[tuple[int, int], str]] = {}
    columns: list[int] | None = None
    for line in text.splitlines():
        words = line.removesuffix("\\").split()
        if line.startswith("inhibition of the "):
            columns, cells = None, found.setdefault(words[3], {})
        elif found and not words:
            columns = None
        elif found and columns is None:
            columns = [int(word) for word in words]
        elif found and columns:
            cells |= {(int(words[0]), k): w for k, w in zip(columns, words[1:], strict=True)}
    return found


@pytest.fixture
def thesis_gait() -> Gait:
    """Weight w_i of the listing is i."""
    weights = tuple(float(i) for i in range(1, 25))
    return Gait(name="1 to 24", weights=weights, tau_a=0.3, tau_b=0.45)


def test_weights_stand_in_the_row_of_the_inhibited_and_the_column_of_the_inhibiting(
    thesis_gait, scenario
):
    found = matrices(gait_table(thesis_gait, scenario))
    # B.2: w1, w2, w3 act on neuron 1 from 3, 5, 7; w4 on 2 from 4; w24 on 8 from 6.
    extensors, flexors = found["extensor"], found["flexor"]
    assert [extensors[1, k] for k in (1, 2, 3, 4)] == ["-", "1.00", "2.00", "3.00"]
    assert (flexors[1, 2], flexors[4, 3]) == ("4.00", "24.00")
    assert len(extensors) == len(flexors) == 16


def test_settings_are_printed_where_they_are_set(thesis_gait, scenario):
    name, *lines = gait_table(thesis_gait, scenario).splitlines()
    assert name == "1 to 24"
    assert [line.split() for line in lines[:2]] == [
        ["tau_A", "0.3", "s"],
        ["tau_B", "0.45", "s,", "1.5", "tau_A"],
    ]
    assert lines[2] == "", "nothing else is set"
    gains = Gains(length=0.5, pitch=-0.25)
    set_all = dataclasses.replace(thesis_gait, turn=-0.5, gains=gains)
    lines = gait_table(set_all, scenario).splitlines()[3:5]
    assert [line.split(maxsplit=1)[0] for line in lines] == ["turn", "gains"]
    assert "-0.5" in lines[0]
    assert "length 0.5" in lines[1] and "pitch -0.25" in lines[1] and "load" not in lines[1]


def test_oscillators_have_their_cables_where_the_scenario_has_as_many(thesis_gait, scenario):
    text = gait_table(thesis_gait, scenario)
    assert "   4  T4-T5 outer bottom_left + outer bottom_right\n" in text
    undulation = load_scenario("undulation")
    assert "   3  T2-T3 outer bottom_left\n" in gait_table(seeded_gait(undulation), undulation)
    assert "T1-T2" not in gait_table(thesis_gait, undulation)


def test_of_24_oscillators_no_weight_is_lost_in_a_narrow_terminal():
    scenario = load_scenario("all-cables")
    gait = seeded_gait(scenario)
    wide, narrow = (gait_table(gait, scenario, width=width) for width in (None, 80))
    assert matrices(wide) == matrices(narrow)
    assert max(map(len, narrow.splitlines())) <= 80 < max(map(len, wide.splitlines())) < 130
    cells = [cell for matrix in matrices(wide).values() for cell in matrix.values()]
    assert len(cells) == 2 * 24**2
    assert len([cell for cell in cells if cell != "-"]) == len(gait.weights)


def test_weights_without_names_are_those_of_as_many_oscillators(thesis_gait, scenario):
    # 24 weights are neither the 4 of 3 tetrahedra nor the 40 of 6, but 2 m (m - 1) for m = 4.
    for tetrahedra in (3, 6):
        other = scenario.with_changes({"robot.tetrahedra": tetrahedra})
        found = matrices(gait_table(thesis_gait, other))
        assert found == matrices(gait_table(thesis_gait, scenario))
    odd = dataclasses.replace(thesis_gait, weights=(1.5,) * 23)
    text = gait_table(odd, scenario)
    assert not matrices(text)
    assert "23" in text


def test_named_weights_are_shown_by_their_names(scenario):
    gait = Gait(name="any", weights=(1.0, 2.0, 3.0), tau_a=0.3, tau_b=0.6)
    text = gait_table(gait, scenario, names=("7->2 flexor", "w2", "2->9999999 flexor"))
    assert matrices(text) == {
        "flexor": {(2, 2): "-", (2, 7): "1.00", (7, 2): "-", (7, 7): "-"},
    }
    assert "2 weights" in text, "those whose names say nothing"


def test_a_gait_without_weights_has_no_matrix(scenario):
    two = scenario.with_changes({"robot.tetrahedra": 2})
    text = gait_table(seeded_gait(two), two)
    assert not matrices(text)
    assert "   1  T1-T2 outer bottom_left + outer bottom_right" in text
