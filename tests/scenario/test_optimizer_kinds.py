"""The section `optimizer` of a scenario."""

import pytest

from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.optimizer_kinds import (
    CmaEs,
    QualityDiversity,
    RandomSearch,
    SteadyState,
)
from tetra_drake.scenario.units import INCH

MINE = "name: mine\nevolution: {evaluations: 900}\noptimizer: "


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("!CmaEs {sample: 7, population: 20}", CmaEs(sample=7, population=20)),
        ("!RandomSearch", RandomSearch()),
        (
            "!QualityDiversity {measures: {speed: [0 in/s, 2 in/s], lifted: [0, 1]}}",
            QualityDiversity(measures={"speed": [0.0, 2.0 * INCH], "lifted": [0.0, 1.0]}),
        ),
        ("!SteadyState {}", SteadyState()),
    ],
)
def test_a_file_chooses_the_optimiser_and_its_budget(load_text, tmp_path, text, kind):
    loaded = load_text(MINE + text)
    assert (loaded.optimizer, loaded.evolution.evaluations) == (kind, 900)
    (tmp_path / "dumped.yaml").write_text(dump_scenario(loaded))
    assert load_scenario(tmp_path / "dumped.yaml") == loaded
    assert load_scenario().with_changes({"optimizer": kind}).optimizer == kind
