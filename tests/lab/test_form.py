"""Form-finding, against closed forms and the equilibrium that another way computes."""

import math

import pytest

import tetra_drake as td


def at_rest_without_weight(scenario):
    return td.study_equilibrium(scenario.with_changes({"robot.gravity": "0 m/s^2"}))


def test_a_prism_of_three_bars_has_the_force_densities_of_theory():
    """Twisted by 30 degrees, vertical over horizontal ones are 2 sin(60 degrees)."""
    found = td.form_find("prism", {"side": "9 N"})
    density = at_rest_without_weight(found).cables.groupby("group")["force_density"].mean()
    assert density["side"] / density["top"] == pytest.approx(math.sqrt(3.0))
    assert density["bottom"] == pytest.approx(density["top"])
    assert found.robot.cables["side"].tension == 9.0


def test_without_weight_the_found_structure_rests_where_its_file_has_it():
    found = td.form_find("six_bar", {"shell": "9 N"})
    study = at_rest_without_weight(found)
    for node, place in found.robot.nodes.items():
        assert study.nodes.loc[node, ["x", "y", "z"]].tolist() == pytest.approx(place, abs=1e-6)
    assert study.cables["tension"].to_numpy() == pytest.approx(9.0, rel=1e-4)


def test_a_group_may_be_without_tension():
    pairs = [["n0", "n5"], ["n1", "n3"], ["n2", "n4"]]
    idle = {"pairs": pairs, "stiffness": "100 N/m", "damping": "1 N*s/m", "tension": "1 N"}
    crossed = td.load_scenario("prism").with_changes({"robot.cables.idle": idle})
    found = td.form_find(crossed, {"side": "9 N", "idle": "0 N"})
    tensions = {name: group.tension for name, group in found.robot.cables.items()}
    assert tensions["idle"] == pytest.approx(0.0, abs=1e-9)
    own = td.form_find("prism", {"side": "9 N"}).robot.cables
    assert tensions["top"] == pytest.approx(own["top"].tension)
