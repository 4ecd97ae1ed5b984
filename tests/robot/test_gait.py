"""Gait files: what is read and written, what is refused, and how random gaits are drawn."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tetra_drake.errors import InputError
from tetra_drake.robot.gait import (
    Gait,
    gait_from_json,
    load_gait,
    random_gait,
    save_gait,
    weight_count,
)

WEIGHTS = [1.0 + 0.1 * i for i in range(24)]


def write(folder: Path, content: object) -> Path:
    """A gait file; content that is not text is written as JSON (NaN and Infinity literally)."""
    file = folder / "mine.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return file


def gait_file(**changes: object) -> dict[str, object]:
    return {"schema": 1, "name": "mine", "weights": WEIGHTS, "tau_a_s": 0.3} | changes


def without(key: str) -> dict[str, object]:
    return {k: v for k, v in gait_file().items() if k != key}


def weights_with(value: object) -> dict[str, object]:
    return gait_file(weights=[*WEIGHTS[:7], value, *WEIGHTS[8:]])


@pytest.mark.parametrize(
    ("oscillators", "weights"),
    [(1, 0), (2, 4), (3, 12), (4, 24), (5, 40), (6, 60), (7, 84), (8, 112)],
)
def test_every_neuron_has_a_weight_from_its_like_in_each_other_oscillator(oscillators, weights):
    # Two neurons an oscillator, each inhibited by its like in n - 1 others.
    assert weight_count(oscillators) == weights


# Reading


def test_a_gait_file_gives_weights_and_time_constants(tmp_path):
    gait = load_gait(write(tmp_path, gait_file()), oscillators=4)
    assert gait == Gait(name="mine", weights=tuple(WEIGHTS), tau_a=0.3, tau_b=0.6)


def test_tau_b_is_twice_tau_a_unless_given(tmp_path):
    assert load_gait(write(tmp_path, gait_file(tau_a_s=0.25)), oscillators=4).tau_b == 0.5
    assert load_gait(write(tmp_path, gait_file(tau_b_s=0.45)), oscillators=4).tau_b == 0.45


def test_a_gait_without_a_name_is_called_like_its_file(tmp_path):
    assert load_gait(write(tmp_path, without("name")), oscillators=4).name == "mine"


def test_weights_of_zero_are_legal(tmp_path, data):
    zero = load_gait(write(tmp_path, gait_file(weights=[0] * 24)), oscillators=4)
    assert zero.weights == (0.0,) * 24
    assert load_gait(data / "single_oscillators.json", oscillators=4).weights == (0.0,) * 24


def test_integers_are_numbers(tmp_path):
    gait = load_gait(write(tmp_path, gait_file(weights=[2] * 24, tau_a_s=1)), oscillators=4)
    assert all(type(number) is float for number in (*gait.weights, gait.tau_a, gait.tau_b))


@pytest.mark.parametrize("oscillators", [1, 2, 3, 8])
def test_a_gait_has_the_weights_of_its_robot(tmp_path, oscillators, refused):
    count = 2 * oscillators * (oscillators - 1)
    file = write(tmp_path, gait_file(weights=[1.5] * count))
    assert load_gait(file, oscillators=oscillators).weights == (1.5,) * count
    with refused(file, "weights", f"found {count} numbers"):
        load_gait(file, oscillators=oscillators + 1)


@pytest.mark.parametrize("name", [f"gait_{letter}" for letter in "abcdefgh"])
def test_the_reference_gaits_load(data, name):
    gait = load_gait(data / f"{name}.json", oscillators=4)
    assert gait.name == name
    assert gait.tau_b == 2 * gait.tau_a


# Writing


@pytest.mark.parametrize("tau_b", [2 * 0.1 / 3, 0.45], ids=["default", "own"])
def test_a_saved_gait_loads_back_to_the_last_bit(tmp_path, tau_b):
    weights = tuple(np.random.default_rng(1).uniform(0, 5, 24).tolist())
    gait = Gait(name="λ „quoted“", weights=weights, tau_a=0.1 / 3, tau_b=tau_b)
    save_gait(gait, tmp_path / "gait.json")
    assert load_gait(tmp_path / "gait.json", oscillators=4) == gait


def test_a_saved_gait_has_the_keys_of_a_gait_file(tmp_path):
    gait = Gait(name="mine", weights=tuple(WEIGHTS), tau_a=0.3, tau_b=0.6)
    save_gait(gait, tmp_path / "gait.json")
    assert json.loads((tmp_path / "gait.json").read_text()) == gait_file()


def test_tau_b_is_written_only_where_it_is_not_the_default():
    own = Gait(name="mine", weights=tuple(WEIGHTS), tau_a=0.3, tau_b=0.5)
    assert own.to_json() == gait_file(tau_b_s=0.5)
    default = Gait(name="mine", weights=tuple(WEIGHTS), tau_a=0.3, tau_b=0.6)
    assert "tau_b_s" not in default.to_json()


def test_a_gait_survives_json_in_memory():
    gait = Gait(name="mine", weights=tuple(WEIGHTS), tau_a=0.3, tau_b=0.5)
    assert gait_from_json(gait.to_json(), source="result.json", oscillators=4) == gait


# Refusing: one line that names file and key, and what was expected


BAD = {
    "23 weights": (gait_file(weights=WEIGHTS[:23]), "weights", "found 23 numbers, expected 24"),
    "25 weights": (gait_file(weights=[*WEIGHTS, 1]), "weights", "found 25 numbers, expected 24"),
    "no list of weights": (gait_file(weights=1.5), "weights", "expected 24 numbers"),
    "weights by name": (gait_file(weights={"w1": 1}), "weights", "expected 24 numbers"),
    "weights null": (gait_file(weights=None), "weights", "expected 24 numbers"),
    "weight NaN": (weights_with(math.nan), "weights[7]", "found nan, expected a finite number"),
    "weight Infinity": (weights_with(math.inf), "weights[7]", "found inf, expected a finite"),
    "weight -Infinity": (weights_with(-math.inf), "weights[7]", "found -inf, expected a finite"),
    "weight negative": (weights_with(-0.1), "weights[7]", "found -0.1, expected at least 0"),
    "weight a string": (weights_with("1.5"), "weights[7]", 'found "1.5", expected a number'),
    "weight a boolean": (weights_with(True), "weights[7]", "expected a number"),
    "weight null": (weights_with(None), "weights[7]", "expected a number"),
    "weight a list": (weights_with([1.5]), "weights[7]", "expected a number"),
    "tau_a negative": (gait_file(tau_a_s=-0.3), "tau_a_s", "found -0.3, expected more than 0"),
    "tau_a zero": (gait_file(tau_a_s=0), "tau_a_s", "found 0, expected more than 0"),
    "tau_a NaN": (gait_file(tau_a_s=math.nan), "tau_a_s", "found nan, expected a finite"),
    "tau_a Infinity": (gait_file(tau_a_s=math.inf), "tau_a_s", "found inf, expected a finite"),
    "tau_a a string": (gait_file(tau_a_s="0.3"), "tau_a_s", 'found "0.3", expected a number'),
    "tau_a a boolean": (gait_file(tau_a_s=True), "tau_a_s", "expected a number"),
    "tau_b negative": (gait_file(tau_b_s=-0.6), "tau_b_s", "found -0.6, expected more than 0"),
    "tau_b zero": (gait_file(tau_b_s=0.0), "tau_b_s", "expected more than 0"),
    "tau_b NaN": (gait_file(tau_b_s=math.nan), "tau_b_s", "found nan, expected a finite"),
    "tau_b a string": (gait_file(tau_b_s="0.6"), "tau_b_s", "expected a number"),
    "name a number": (gait_file(name=5), "name", "found 5, expected text"),
    "no schema": (without("schema"), "schema", "is missing"),
    "no weights": (without("weights"), "weights", "is missing"),
    "no tau_a": (without("tau_a_s"), "tau_a_s", "is missing"),
    "unknown key": (gait_file(tau_c_s=1), "tau_c_s", "unknown key, expected one of name, schema"),
    "unit left out of a key": (gait_file(tau_a=0.3), "tau_a", "unknown key"),
    "newer schema": (gait_file(schema=2), "schema", "found 2, expected 1"),
    "schema a string": (gait_file(schema="1"), "schema", 'found "1", expected 1'),
    "a list": ([1, 2], "", "expected a JSON object"),
    "a number": (5, "", "expected a JSON object"),
    "null": (None, "", "expected a JSON object"),
    "not JSON": ("weights: [1, 2]", "", "is not JSON"),
    "half a file": (json.dumps(gait_file())[:100], "", "is not JSON"),
    "an empty file": ("", "", "is not JSON"),
    "brackets without end": ("[" * 100_000, "", "is not JSON"),
}


@pytest.mark.parametrize(("content", "key", "problem"), BAD.values(), ids=BAD.keys())
def test_a_bad_gait_is_told_the_file_the_key_and_what_was_expected(
    tmp_path, content, key, problem, refused
):
    file = write(tmp_path, content)
    with refused(file, key, problem):
        load_gait(file, oscillators=4)


def test_a_missing_file_is_named(tmp_path, refused):
    with refused(tmp_path / "missing.json", "", "no such gait file"):
        load_gait(tmp_path / "missing.json", oscillators=4)


def test_a_directory_is_not_a_gait_file(tmp_path, refused):
    with refused(tmp_path, "", "is a directory, expected a gait file"):
        load_gait(tmp_path, oscillators=4)


def test_a_path_below_a_file_is_not_a_gait_file(tmp_path, refused):
    path = write(tmp_path, gait_file()) / "below.json"
    with refused(path, "", "cannot be read"):
        load_gait(path, oscillators=4)


def test_a_binary_file_is_not_a_gait_file(tmp_path, refused):
    (tmp_path / "mine.json").write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff")
    with refused(tmp_path / "mine.json", "", "cannot be read as a text file"):
        load_gait(tmp_path / "mine.json", oscillators=4)


# Random gaits


def draw(scenario, seed: int, count: int) -> list[Gait]:
    generator = np.random.default_rng(seed)
    return [random_gait(scenario, generator, name=f"draw {i}") for i in range(count)]


def assert_uniform(values: np.ndarray, low: float, high: float) -> None:
    """Kolmogorov and Smirnov's test: a uniform sample fails it one time in 1000."""
    ranks = np.sort((values - low) / (high - low))
    steps = np.arange(len(ranks) + 1) / len(ranks)
    distance = max(np.max(steps[1:] - ranks), np.max(ranks - steps[:-1]))
    assert distance < 1.95 / math.sqrt(len(ranks))


def test_random_gaits_are_uniform_within_the_bounds(scenario):
    scenario.gait_bounds.weight_min, scenario.gait_bounds.weight_max = 1.0, 3.4
    scenario.gait_bounds.tau_a_min, scenario.gait_bounds.tau_a_max = 0.2, 0.5
    gaits = draw(scenario, seed=5, count=2000)
    weights = np.array([gait.weights for gait in gaits])
    taus = np.array([gait.tau_a for gait in gaits])
    assert weights.shape == (2000, 24)
    assert weights.min() >= 1.0 and weights.max() <= 3.4
    assert taus.min() >= 0.2 and taus.max() <= 0.5
    assert_uniform(weights.ravel(), 1.0, 3.4)
    assert_uniform(taus, 0.2, 0.5)
    # Every weight for itself: mean 2.2, standard deviation 2.4 / sqrt(12) = 0.693, so that of
    # a mean of 2000 is 0.0155; 5 of them allow for 24 weights.
    assert np.abs(weights.mean(axis=0) - 2.2).max() < 5 * 0.0155
    assert np.abs(weights.std(axis=0) - 0.693).max() < 0.05


def test_random_gaits_follow_other_bounds(scenario):
    scenario.gait_bounds.weight_min, scenario.gait_bounds.weight_max = 7.0, 8.0
    scenario.gait_bounds.tau_a_min = scenario.gait_bounds.tau_a_max = 0.35
    for gait in draw(scenario, seed=0, count=20):
        assert min(gait.weights) >= 7.0 and max(gait.weights) <= 8.0
        assert gait.tau_a == 0.35


def test_random_gaits_keep_tau_b_twice_tau_a(scenario):
    assert all(gait.tau_b == 2 * gait.tau_a for gait in draw(scenario, seed=0, count=20))


def test_the_same_seed_gives_the_same_gait(scenario):
    assert draw(scenario, seed=8, count=3) == draw(scenario, seed=8, count=3)
    assert draw(scenario, seed=8, count=1) != draw(scenario, seed=9, count=1)


def test_one_generator_gives_gait_after_gait(scenario):
    first, second = draw(scenario, seed=8, count=2)
    assert first.weights != second.weights
    assert first.tau_a != second.tau_a


@pytest.mark.parametrize("tetrahedra", [2, 3, 8])
def test_a_random_gait_fits_its_robot_and_its_file(tmp_path, scenario, tetrahedra):
    scenario.robot.tetrahedra = tetrahedra
    gait = random_gait(scenario, np.random.default_rng(0), name="any")
    assert gait.name == "any"
    assert len(gait.weights) == weight_count(tetrahedra - 1)
    save_gait(gait, tmp_path / "gait.json")
    assert load_gait(tmp_path / "gait.json", oscillators=tetrahedra - 1) == gait


@pytest.mark.parametrize(
    "text",
    [
        '{"schema": 1, "schema": 1, "weights": [], "tau_a_s": 0.3}',
        '{"schema": true, "weights": [], "tau_a_s": 0.3}',
        '{"schema": 1, "weights": [], "tau_a_s": 1' + "0" * 400 + "}",
        '{"schema": 1, "weights": [], "tau_a_s": 1' + "0" * 5000 + "}",
    ],
    ids=["key twice", "schema true", "huge integer", "integer beyond Python's limit"],
)
def test_absurd_files_are_refused_too(tmp_path, text):
    file = tmp_path / "gait.json"
    file.write_text(text)
    with pytest.raises(InputError):
        load_gait(file, oscillators=1)
