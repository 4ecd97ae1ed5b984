"""What a result says of its simulation."""

import pytest

from tetra_drake.results.result import ground_text
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.schema import Coulomb
from tetra_drake.scenario.terrain import HeightField, Rough


@pytest.mark.parametrize(
    ("scenario", "changes", "words"),
    [
        ("thesis", {}, set()),
        ("thesis", {"simulation.engine": "compiled"}, set()),
        ("thesis", {"simulation.engine": "mujoco"}, {"flat", "MuJoCo", "0.5"}),
        ("thesis", {"terrain": Rough(amplitude=0.0254, wavelength=0.1)}, {"amplitude 1 in"}),
        ("coulomb", {"simulation.engine": "mujoco"}, {"flat", "Coulomb"}),
        ("coulomb", {}, {"flat", "static 0.5", "kinetic 0.5"}),
        ("incline", {}, {"incline", "slope 5 deg", "static 0.5"}),
        ("steps", {"friction": Coulomb(lateral=2.0)}, {"height 0.25 in", "count 4", "lateral 2"}),
        (
            "thesis",
            {"terrain": HeightField(file="/far/away/hills.npy", cell=0.0254)},
            {"hills.npy"},
        ),
    ],
)
def test_the_ground_is_named_unless_it_is_the_thesiss(scenario, changes, words):
    text = ground_text(load_scenario(scenario).with_changes(changes))
    assert bool(text) == bool(words)
    assert all(word in text for word in words)
    assert "/far" not in text and "\n" not in text
