"""Gait files, random gaits, and the parameter space that evolution searches."""

import dataclasses
import itertools
import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import yaml

from tetra_drake.robot.gait import Gait
from tetra_drake.robot.gait_file import load_gait, save_gait
from tetra_drake.robot.parameter_space import ParameterSpace, seeded_gait
from tetra_drake.scenario.load import load_scenario

NAMES = [
    f"{source}->{onto} {kind}"
    for onto in range(1, 5)
    for kind in ("extensor", "flexor")
    for source in range(1, 5)
    if source != onto
]
"""B.2: w1, w2, w3 act on neuron 1 from 3, 5, 7; w4 on neuron 2 from 4; w24 on 8 from 6."""
WEIGHTS = {f"weight {name}": 1.0 + 0.1 * i for i, name in enumerate(NAMES)}
TAU_A, TAU_B = -2, -1
"""Places of the time constants in a vector."""


def write(folder: Path, content: object) -> Path:
    """A gait file; content that is not text is written as JSON (NaN and Infinity literally)."""
    file = folder / "mine.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return file


def gait_file(changes: Mapping[str, object] = {}, **keys: object) -> dict[str, object]:
    parameters = WEIGHTS | {"tau_A": 0.3} | changes
    return {"schema": 3, "name": "mine", "parameters": parameters} | keys


def test_a_gait_file_gives_parameters_by_name(tmp_path, scenario):
    shuffled = dict(reversed(WEIGHTS.items()))
    gait = load_gait(write(tmp_path, gait_file(parameters=shuffled | {"tau_A": 0.3})), scenario)
    assert gait == Gait("mine", WEIGHTS | {"tau_A": 0.3, "tau_B": 0.6})
    assert [*gait.parameters] == [*ParameterSpace.of(scenario).names]
    free = load_gait(write(tmp_path, gait_file({"tau_B": 0.45})), scenario)
    assert free == Gait("mine", WEIGHTS | {"tau_A": 0.3, "tau_B": 0.45})


def test_a_file_of_version_0_5_0_is_the_same_gait(tmp_path):
    scenario = load_scenario("feedback")
    old = {"schema": 2, "name": "old", "tau_a_s": 0.3, "gains": {"pitch": -0.2}}
    old["weights"] = {name.removeprefix("weight "): weight for name, weight in WEIGHTS.items()}
    gait = load_gait(write(tmp_path, old), scenario)
    gains = {"gain length": 0.0, "gain load": 0.0, "gain pitch": -0.2}
    assert gait.parameters == WEIGHTS | gains | {"tau_A": 0.3, "tau_B": 0.6}
    gait = load_gait(write(tmp_path, old | {"tau_b_s": 0.45}), scenario)
    assert gait.parameters["tau_B"] == 0.45
    listed = old | {"schema": 1, "weights": [*WEIGHTS.values()]}  # in the order of the names
    assert load_gait(write(tmp_path, listed), scenario) == load_gait(write(tmp_path, old), scenario)


@pytest.mark.parametrize("tetrahedra", [2, 4])
def test_a_gait_has_the_weights_of_its_robot(tmp_path, scenario, tetrahedra, refused):
    scenario = scenario.with_changes({"robot.tetrahedra": tetrahedra})
    # Two neurons per oscillator, each inhibited by its like in every other oscillator.
    gait = seeded_gait(scenario)
    assert len(gait.parameters) == 2 * (tetrahedra - 1) * (tetrahedra - 2) + 2
    save_gait(gait, tmp_path / "mine.json", scenario)
    with refused(tmp_path / "mine.json", "parameters", "lacks"):
        load_gait(tmp_path / "mine.json", scenario.with_changes({"robot.tetrahedra": 5}))


BAD = yaml.safe_load(Path(__file__).with_name("bad_gaits.yaml").read_text("utf-8"))
REFUSED = [(gait_file(changes, **keys), key, found) for changes, keys, key, found in BAD]
REFUSED += [
    ('{"schema": 3, "schema": 3, "parameters": {}}', "", "twice"),
    ("[" * 100_000, "", "JSON"),
]
REFUSED += [('{"tau_A": 1' + "0" * 5000 + "}", "", "JSON")]  # beyond Python's limit of digits


@pytest.mark.parametrize(("content", "key", "found"), REFUSED, ids=itertools.count())
def test_a_bad_file_is_refused_with_its_key(tmp_path, content, key, found, refused, scenario):
    file = write(tmp_path, content)
    with refused(file, key, found):
        load_gait(file, scenario)


SPACES = {"thesis": {}, "turning": {}, "feedback": {"gait_bounds.independent_tau_b": True}}
"""Shipped scenarios, with changes."""


@pytest.mark.parametrize("name", SPACES)
def test_a_saved_gait_of_any_scenario_loads_back(tmp_path, name):
    shipped = load_scenario(name).with_changes(SPACES[name])
    gait = seeded_gait(shipped, 5)
    for name in shipped.cpg.feedback:
        assert gait.parameters[f"gain {name}"] != 0.0
    assert gait.turn == (1.0 if shipped.name == "turning" else 0.0)
    # A gait's own turn counts, whatever those are that the scenario evolves.
    gait = dataclasses.replace(gait, turn=0.25 * gait.turn)
    save_gait(gait, tmp_path / "gait.json", shipped)
    assert load_gait(tmp_path / "gait.json", shipped) == gait


def test_mirrored_weights_are_one_parameter_for_left_and_right():
    turning = load_scenario("turning")
    space = ParameterSpace.of(turning)
    free = ParameterSpace.of(turning.with_changes({"gait_bounds.mirrored": False}))
    # None of the 64 weights of `undulation` is its own mirror image.
    assert (len(space.names), len(free.names)) == (32 + 2, 64 + 2)
    assert space.names[0] == free.names[0] == "weight 2->1 extensor", "named by the first"
    vector = np.arange(34.0) + 1.0
    by_name = space.gait(vector, name="any").parameters
    # Oscillators 1, 3, 5, 7 are on the left, 2, 4, 6, 8 on the right of the same junctions.
    for name, image in (("2->1 extensor", "1->2 extensor"), ("5->4 flexor", "6->3 flexor")):
        assert by_name[f"weight {name}"] == by_name[f"weight {image}"]
    weights = [value for name, value in by_name.items() if name.startswith("weight")]
    assert sorted(weights) == sorted([*vector[:32], *vector[:32]])


def test_parameters_have_the_bounds_and_floors_of_the_thesis_and_gains_no_floor():
    space = ParameterSpace.of(load_scenario("feedback"))
    columns = zip(space.low, space.high, space.floors, strict=True)
    rows = dict(zip(space.names, columns, strict=True))
    assert space.names[24:] == ("gain length", "gain load", "gain pitch", "tau_A", "tau_B")
    # Table 5 and listing A.3; a gain may become negative by mutation.
    assert rows["weight 2->1 extensor"] == (1.0, 3.4, 0.0)
    assert rows["tau_A"] == (0.2, 0.5, 0.2)
    assert rows["tau_B"] == (0.4, 1.0, 0.4)
    assert rows["gain load"] == (-1.0, 1.0, -math.inf)
    gait = space.gait(np.arange(29.0), name="any")
    gains = {"gain length": 24.0, "gain load": 25.0, "gain pitch": 26.0}
    assert gait.parameters.items() >= (gains | {"tau_A": 27.0, "tau_B": 28.0}).items()


def test_random_gaits_are_uniform_within_the_bounds(scenario):
    generator, space = np.random.default_rng(5), ParameterSpace.of(scenario)
    vectors = np.array([space.random(generator) for _ in range(2000)])
    weights, taus = vectors[:, :-2], vectors[:, TAU_A]
    assert 1.0 <= weights.min() < 1.01 and 3.39 < weights.max() <= 3.4
    assert 0.2 <= taus.min() < 0.202 and 0.498 < taus.max() <= 0.5
    # Every weight for itself: mean 2.2, standard deviation 2.4 / sqrt(12) = 0.693, so that of
    # a mean of 2000 is 0.0155; 5 of them allow for 24 weights.
    assert np.abs(weights.mean(axis=0) - 2.2).max() < 5 * 0.0155
    assert np.abs(weights.std(axis=0) - 0.693).max() < 0.05
    np.testing.assert_array_equal(vectors[:, TAU_B], 2.0 * taus)
