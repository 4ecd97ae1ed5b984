"""The section `optimizer` of a scenario."""

import pytest

from tetra_drake.errors import InputError
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.optimizer_kinds import (
    CmaEs,
    QualityDiversity,
    RandomSearch,
    SteadyState,
)
from tetra_drake.scenario.units import INCH

MINE = "base: thesis\nname: mine\nevolution: {evaluations: 900}\noptimizer: "


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
def test_a_file_chooses_the_optimiser_and_its_budget(tmp_path, text, kind):
    file = tmp_path / "mine.yaml"
    file.write_text(MINE + text)
    loaded = load_scenario(file)
    assert (loaded.optimizer, loaded.evolution.evaluations) == (kind, 900)
    file.write_text(dump_scenario(loaded))
    assert load_scenario(file) == loaded
    assert load_scenario().with_changes({"optimizer": kind}).optimizer == kind


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("!CmaEs {populaton: 9}", "optimizer.populaton"),
        ("!CmaEs {population: 3}", "optimizer.population"),
        ("!CMAES {}", "optimizer"),
        ("!QualityDiversity {measures: {lifted: [0, 1]}}", "optimizer.measures"),
        ("!QualityDiversity {measures: {lited: [0, 1]}}", "optimizer.measures.lited"),
        (
            "!QualityDiversity {measures: {lifted: [0, 1], tension: [1 lbf, 0 lbf]}}",
            "optimizer.measures.tension",
        ),
        ("!QualityDiversity {cells: [9, 1]}", "optimizer.cells[1]"),
    ],
)
def test_a_wrong_one_is_refused(tmp_path, text, key):
    (tmp_path / "mine.yaml").write_text(MINE + text)
    with pytest.raises(InputError) as caught:
        load_scenario(tmp_path / "mine.yaml")
    assert caught.value.key == key
