"""Form-finding, against closed forms and the equilibrium that another way computes."""

import pytest

import tetra_drake as td


@pytest.mark.parametrize(("name", "group"), [("prism", "side"), ("six_bar", "shell")])
def test_without_weight_the_found_structure_rests_where_its_file_has_it(name, group):
    found = td.form_find(name, {group: "9 N"})
    study = td.study_equilibrium(found.with_changes({"robot.gravity": "0 m/s^2"}))
    for node, place in found.robot.nodes.items():
        assert study.nodes.loc[node, ["x", "y", "z"]].tolist() == pytest.approx(place, abs=1e-6)
    tensions = study.cables.query("group == @group")["tension"].to_numpy()
    assert tensions == pytest.approx(9.0, rel=1e-4)


def test_a_group_may_be_without_tension():
    pairs = [["n0", "n5"], ["n1", "n3"], ["n2", "n4"]]
    idle = {"pairs": pairs, "stiffness": "100 N/m", "damping": "1 N*s/m", "tension": "1 N"}
    crossed = td.load_scenario("prism").with_changes({"robot.cables.idle": idle})
    found = td.form_find(crossed, {"side": "9 N", "idle": "0 N"})
    tensions = {name: group.tension for name, group in found.robot.cables.items()}
    assert tensions["idle"] == pytest.approx(0.0, abs=1e-9)
    own = td.form_find("prism", {"side": "9 N"}).robot.cables
    assert tensions["top"] == pytest.approx(own["top"].tension)
