"""Gait files, random gaits, and the parameter space that evolution searches."""

import dataclasses
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest

from tetra_drake.robot.gait import (
    TAU_A,
    TAU_B,
    Gains,
    Gait,
    ParameterSpace,
    load_gait,
    save_gait,
    seeded_gait,
)
from tetra_drake.scenario.load import load_scenario

NAMES = [
    f"{source}->{onto} {kind}"
    for onto in range(1, 5)
    for kind in ("extensor", "flexor")
    for source in range(1, 5)
    if source != onto
]
"""B.2: w1, w2, w3 act on neuron 1 from 3, 5, 7; w4 on neuron 2 from 4; w24 on 8 from 6."""
WEIGHTS = {name: 1.0 + 0.1 * i for i, name in enumerate(NAMES)}


def write(folder: Path, content: object) -> Path:
    """A gait file; content that is not text is written as JSON (NaN and Infinity literally)."""
    file = folder / "mine.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return file


def gait_file(**changes: object) -> dict[str, object]:
    return {"schema": 2, "name": "mine", "weights": WEIGHTS, "tau_a_s": 0.3} | changes


def test_a_gait_file_gives_weights_and_time_constants(tmp_path, scenario):
    shuffled = dict(reversed(WEIGHTS.items()))
    gait = load_gait(write(tmp_path, gait_file(weights=shuffled)), scenario)
    assert gait == Gait(name="mine", weights=tuple(WEIGHTS.values()), tau_a=0.3, tau_b=0.6)
    assert gait.weight_names == tuple(NAMES)
    # Of a first schema: a list in the order of the listing.
    file = write(tmp_path, gait_file(schema=1, weights=list(WEIGHTS.values()), tau_b_s=0.45))
    assert load_gait(file, scenario) == dataclasses.replace(gait, tau_b=0.45)


@pytest.mark.parametrize("tetrahedra", [2, 4])
def test_a_gait_has_the_weights_of_its_robot(tmp_path, scenario, tetrahedra, refused):
    scenario = scenario.with_changes({"robot.tetrahedra": tetrahedra})
    # Two neurons per oscillator, each inhibited by its like in every other oscillator.
    gait = seeded_gait(scenario)
    assert len(gait.weights) == 2 * (tetrahedra - 1) * (tetrahedra - 2)
    save_gait(gait, tmp_path / "mine.json", scenario)
    with refused(tmp_path / "mine.json", "weights", "lacks"):
        load_gait(tmp_path / "mine.json", scenario.with_changes({"robot.tetrahedra": 5}))


BAD: list[tuple[object, str, str]] = [
    (gait_file(weights=WEIGHTS | {"1->2 flexor": math.nan}), "weights.1->2 flexor", "nan"),
    (gait_file(weights=WEIGHTS | {"5->1 flexor": 1.0}), "weights", "'5->1 flexor'"),
    (gait_file(weights=[1.0] * 23), "weights", "23"),
    (gait_file(weights=[1.0] * 23 + [-0.1]), "weights[23]", "-0.1"),
    (gait_file(tau_a_s=0), "tau_a_s", "0"),
    (gait_file(schema=3), "schema", "3"),
    (gait_file(gains={"lenght": 0.1}), "gains.lenght", "'length'"),
    (gait_file(gains={"load": 0.5}), "gains.load", "0.5"),  # the thesis has no feedback
    (gait_file(turn=0.5), "turn", "0.5"),  # its cables are driven in pairs, left and right
    ('{"schema": 2, "schema": 2, "weights": {}, "tau_a_s": 0.3}', "", "twice"),
    ('{"tau_a_s": 1' + "0" * 5000 + "}", "", "JSON"),  # beyond Python's limit of digits
    ("[" * 100_000, "", "JSON"),
]


@pytest.mark.parametrize(("content", "key", "found"), BAD, ids=itertools.count())
def test_a_bad_file_is_refused_with_file_and_key(tmp_path, content, key, found, refused, scenario):
    file = write(tmp_path, content)
    with refused(file, key, found):
        load_gait(file, scenario)


SPACES = {"thesis": {}, "turning": {}, "feedback": {"gait_bounds.independent_tau_b": True}}
"""Shipped scenarios, with changes."""


@pytest.fixture(params=SPACES)
def shipped(request):
    return load_scenario(request.param).with_changes(SPACES[request.param])


def test_a_saved_gait_of_any_scenario_loads_back(tmp_path, shipped):
    gait = seeded_gait(shipped, 5)
    for name in shipped.cpg.feedback:
        assert getattr(gait.gains, name) != 0.0
    assert gait.turn == (1.0 if shipped.name == "turning" else 0.0)
    # A gait's own turn counts, whatever those are that the scenario evolves.
    gait = dataclasses.replace(gait, turn=0.25 * gait.turn)
    save_gait(gait, tmp_path / "gait.json", shipped)
    assert load_gait(tmp_path / "gait.json", shipped) == gait


def test_a_vector_is_a_gait_in_every_scenario_and_back(shipped):
    space = ParameterSpace.of(shipped)
    assert len(space.names) == len(set(space.names))
    assert not any("turn" in name for name in space.names)
    for limits in (space.low, space.high, space.floors):
        assert limits.shape == (len(space.names),)
    for seed in range(3):
        vector = space.random(np.random.default_rng(seed))
        assert space.gait(vector, name=f"random gait {seed}") == seeded_gait(shipped, seed)
        gait = space.gait(vector, name="any")
        np.testing.assert_array_equal(space.vector(gait), vector)
        assert space.gait(space.vector(gait), name="any") == gait
        assert gait.turn == shipped.gait_bounds.turn


def test_mirrored_weights_are_one_parameter_for_left_and_right():
    turning = load_scenario("turning")
    space = ParameterSpace.of(turning)
    free = ParameterSpace.of(turning.with_changes({"gait_bounds.mirrored": False}))
    # None of the 64 weights of `undulation` is its own mirror image.
    assert (len(space.names), len(free.names)) == (32 + 2, 64 + 2)
    assert space.names[0] == free.names[0] == "weight 2->1 extensor", "named by the first"
    vector = np.arange(34.0) + 1.0
    weights = space.gait(vector, name="any").weights
    by_name = dict(zip(free.names, weights, strict=False))
    # Oscillators 1, 3, 5, 7 are on the left, 2, 4, 6, 8 on the right of the same junctions.
    for name, image in (("2->1 extensor", "1->2 extensor"), ("5->4 flexor", "6->3 flexor")):
        assert by_name[f"weight {name}"] == by_name[f"weight {image}"]
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
    assert gait.gains == Gains(length=24.0, load=25.0, pitch=26.0)
    assert (gait.tau_a, gait.tau_b) == (27.0, 28.0)


def test_repair_couples_tau_b_unless_it_is_independent(scenario):
    vector = np.linspace(1.0, 2.0, 26)
    space = ParameterSpace.of(scenario)
    repaired = space.repair(vector)
    assert repaired[TAU_B] == 2.0 * vector[TAU_A]
    np.testing.assert_array_equal(repaired[:TAU_B], vector[:TAU_B])
    assert vector[TAU_B] == 2.0
    scenario = scenario.with_changes({"gait_bounds.independent_tau_b": True})
    np.testing.assert_array_equal(ParameterSpace.of(scenario).repair(vector), vector)


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
