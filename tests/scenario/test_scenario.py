"""Scenario files: the thesis's numbers, files based on files, dumping, and bad files."""

from pathlib import Path

import numpy as np
import pytest

from tetra_drake.errors import InputError
from tetra_drake.scenario.fields import tree_of
from tetra_drake.scenario.load import (
    differences,
    dump_scenario,
    load_scenario,
    shipped_scenarios,
)

# Exact by definition.
IN = 0.0254
LBF = 4.4482216152605

THESIS = [
    # Section 2.1 and appendix C.1
    ("robot.tetrahedra", 5, 1),
    ("robot.strut_length", 6, IN),
    ("robot.strut_diameter", 0.125, IN),
    ("robot.node_diameter", 0.2, IN),
    ("robot.density", 2.7, 1e-3 / 1e-6),  # g/cm^3
    ("robot.gravity", 9.80665, 1),
    # Table 1
    ("ground.restitution", 0.9, 1),
    ("ground.velocity_correction", 0.72, 1 / IN),
    ("ground.stiffness", 25, LBF / IN),
    ("ground.damping", 27, LBF / IN**2),  # the table's lb s/in does not balance Eq. 1
    # Table 2
    ("friction.stiction_range", 0.004, IN),
    ("friction.stiction_damping", 0.4, LBF / IN),
    ("friction.stiction_switch", 0.7, 1),
    ("friction.proportional_stiction", 0.3, LBF / IN**2),
    # Table 3
    ("cables.outer_stiffness", 0.2, LBF / IN),
    ("cables.inner_stiffness", 0.3, LBF / IN),
    ("cables.damping", 0.05, LBF / IN),
    ("cables.free_length", 0.04, IN),
    # Table 4
    ("cpg.self_inhibition_weight", 2.5, 1),
    ("cpg.external_input", 0.5, 1),
    ("cpg.inner_state", 0.3, 1),
    ("cpg.extensor_self_inhibition", 0.1, 1),
    ("cpg.flexor_self_inhibition", 0.5, 1),
    # Sections 2.2 and 2.3, appendix B
    ("cpg.partner_weight", 1.5, 1),
    ("cpg.gain", 2, LBF),
    ("cpg.start_up", 2500 * 0.5e-3, 1),  # the listing zeroes its first 2500 samples
    ("cpg.listing_step", 0.5e-3, 1),
    # Table 5
    ("gait_bounds.weight_min", 1, 1),
    ("gait_bounds.weight_max", 3.4, 1),
    ("gait_bounds.tau_a_min", 0.2, 1),
    ("gait_bounds.tau_a_max", 0.5, 1),
    # Table 6
    ("simulation.duration", 15, 1),
    ("evolution.population", 50, 1),
    ("evolution.tournament", 5, 1),
    ("evolution.trials", 10, 1),
    ("evolution.max_iterations", 2000, 1),
    ("evolution.crossover_probability", 0.2, 1),
    ("evolution.mutation_probability", 0.7, 1),
    ("evolution.weight_mutation", 0.2, 1),
    ("evolution.tau_mutation_range", 0.05, 1),
    # Section 2.3
    ("simulation.steady_from", 3, 1),
    ("evolution.stop_rise", 0.03, 1),
    ("evolution.stop_window", 100, 1),
    ("evolution.stop_after", 200, 1),  # appendix A
    # Table 7
    ("fitness.distance", 1, 1),
    ("fitness.twist", -10, 1),
    ("fitness.direction", 0, 1),
    ("fitness.drift", -1, 1),
]


def write(folder: Path, text: str, name: str = "mine.yaml") -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize(("key", "number", "si"), THESIS, ids=[row[0] for row in THESIS])
def test_thesis_scenario_holds_the_number_of_the_thesis(scenario, key, number, si):
    section, name = key.split(".")
    assert tree_of(scenario)[section][name] == pytest.approx(number * si, rel=1e-12)


def test_thesis_ground_damping_is_three_halves_alpha_k(scenario):
    # Eq. 2: lambda = 3/2 alpha k = 1.5 * 0.72 s/in * 25 lbf/in = 27 lbf s/in^2.
    ground = scenario.ground
    expected = 1.5 * ground.velocity_correction * ground.stiffness
    assert ground.damping == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", shipped_scenarios())
def test_shipped_scenarios_load_and_keep_the_thesis_reference(name, scenario):
    loaded = load_scenario(name)
    assert loaded.name == name
    assert loaded.reference == scenario.reference
    assert loaded.reference.best_distance == pytest.approx(14.34 * IN, rel=1e-12)
    assert len(loaded.reference.two_best_weights) == 24


def test_thesis_is_the_default_and_each_load_gives_a_copy(scenario):
    load_scenario().robot.tetrahedra = 9
    assert load_scenario() == scenario


def test_there_is_an_oscillator_for_each_junction(scenario):
    assert scenario.oscillators == 4
    assert scenario.with_changes({"robot.tetrahedra": 2}).oscillators == 1


# Files written by earlier versions


RECORDED = sorted((Path(__file__).parents[2] / "runs").glob("*/scenario.yaml"))


@pytest.mark.parametrize("file", RECORDED, ids=lambda file: file.parent.name)
def test_recorded_scenarios_load(file):
    assert load_scenario(file).robot.tetrahedra == 5


def test_a_file_of_schema_1_means_what_it_meant(data, scenario):
    file = data / "scenario_schema_1.yaml"
    loaded = load_scenario(file)
    assert differences(loaded, scenario) == [("simulation.engine", "compiled")]
    assert loaded.reference is None
    assert loaded.robot.offsets == []
    assert dump_scenario(loaded) == file.read_text()


# Files based on files


def test_a_file_changes_only_what_it_gives(tmp_path, scenario):
    file = write(
        tmp_path,
        """\
        base: thesis
        name: damped
        cables: {damping: 1 N*s/m, slack: true}
        simulation: {duration: 500 ms, steady_from: 0 s}
        """,
    )
    assert load_scenario(file) == scenario.with_changes(
        {
            "name": "damped",
            "cables.damping": 1.0,
            "cables.slack": True,
            "simulation.duration": 0.5,
            "simulation.steady_from": 0,
        }
    )


def test_a_base_file_is_found_beside_the_file_that_names_it(tmp_path, scenario):
    write(tmp_path, "base: thesis\nrobot: {spacing: 3 m, gravity: 1 m/s^2}\n", "common/low.yaml")
    write(tmp_path, "base: common/low.yaml\nrobot: {spacing: 2 m}\n", "middle.yaml")
    file = write(tmp_path, "base: ../middle.yaml\nname: top\n", "mine/top.yaml")
    changes = {"name": "top", "robot.spacing": 2.0, "robot.gravity": 1.0}
    assert load_scenario(str(file)) == scenario.with_changes(changes)


@pytest.mark.parametrize(
    ("key", "written", "value"),
    [
        ("gait_bounds.weight_max", "4", 4.0),
        ("simulation.accuracy", "1e-3", 1e-3),  # text in YAML 1.1
        ("robot.tetrahedra", "2", 2),
        ("robot.gravity", "0 m/s^2", 0.0),
        ("gait_bounds.tau_a_min", "0.5 s", 0.5),
        ("evolution.mutation_probability", "1", 1.0),
    ],
)
def test_numbers_may_be_integers_and_reach_their_limits(tmp_path, key, written, value):
    section, name = key.split(".")
    file = write(tmp_path, f"base: thesis\n{section}: {{{name}: {written}}}\n")
    loaded = tree_of(load_scenario(file))[section][name]
    assert loaded == value
    assert type(loaded) is type(value)


# Dumping and comparing


def test_a_dumped_scenario_keeps_every_bit_and_needs_no_base(tmp_path, scenario):
    generator = np.random.default_rng(3)
    for section in vars(scenario).values():
        for name, value in list(getattr(section, "__dict__", {}).items()):
            if isinstance(value, float):
                setattr(section, name, value * float(generator.uniform(0.9, 1.1)))
    scenario.friction.stiction_range = 1e-5 / 3  # dumped with an exponent
    scenario.robot.offsets = [[0.1 / 3, 0.0, 1e-9]] * 5
    scenario.name = "a: 'name' that needs # quoting"
    text = dump_scenario(scenario)
    assert "gravity: " in text
    assert "base" not in text.split()
    assert load_scenario(write(tmp_path, text)) == scenario


def test_differences_are_keys_and_readable_values(scenario):
    changed = scenario.with_changes(
        {
            "name": "other",
            "friction.stiction_damping": "0.3 lbf*s/in",
            "robot.offsets": [[0.001, 0, 0]] * 5,
            "cables.slack": True,
            "cpg.signals": "live",
            "evolution.stop_rise": 0.1 + 0.2,
        }
    )
    assert differences(changed, scenario) == [
        ("robot.offsets", f"[{', '.join(['[0.001 m, 0 m, 0 m]'] * 5)}]"),
        ("friction.stiction_damping", "52.5381 N*s/m"),
        ("cables.slack", "true"),
        ("cpg.signals", "live"),
        ("evolution.stop_rise", "0.3"),
    ]


# Bad files: the key at fault, and what was found there or is suggested

BAD = [
    ("robot: {tetrahedron: 4}", "robot.tetrahedron", "'tetrahedra'"),
    ("gait_bound: {}", "gait_bound", "'gait_bounds'"),
    ("fitness: {qqq: 1}", "fitness.qqq", "distance, twist, direction, drift"),
    ("1: 2", "1", "unknown key"),
    ("robot: 5", "robot", "5"),
    ("robot:", "robot", "nothing"),
    ("robot: !Robot {}", "robot", "!Robot"),
    ("robot: {tetrahedra: 4.5}", "robot.tetrahedra", "4.5"),
    ("robot: {tetrahedra: true}", "robot.tetrahedra", "true"),
    ("robot: {tetrahedra: 1}", "robot.tetrahedra", "1"),
    ("fitness: {drift: little}", "fitness.drift", "'little'"),
    ("fitness: {drift: .nan}", "fitness.drift", "nan"),
    ("cables: {slack: 1}", "cables.slack", "1"),
    ("name: 5", "name", "5"),
    ("cpg: {signals: recording}", "cpg.signals", "'recording'"),
    ("robot: {spacing: 3}", "robot.spacing", "3 without a unit"),
    ("robot: {spacing: 3 inchies}", "robot.spacing", "'3 inchies'"),
    ("robot: {spacing: .nan}", "robot.spacing", "nan"),
    ("robot: {offsets: [[1 m, 2 m]]}", "robot.offsets[0]", "2 items"),
    ("robot: {offsets: [[0 m, 0 m, 0 m]]}", "robot.offsets", "1 items"),
    ("cables: {outer_stiffness: -0.2 lbf/in}", "cables.outer_stiffness", "'-0.2 lbf/in'"),
    ("ground: {stiffness: 0 lbf/in}", "ground.stiffness", "'0 lbf/in'"),
    ("simulation: {duration: 1e999 s}", "simulation.duration", "'1e999 s'"),
    ("evolution: {crossover_probability: 20}", "evolution.crossover_probability", "20"),
    ("gait_bounds: {tau_a_min: 0.6 s}", "gait_bounds.tau_a_min", "0.6"),
    ("gait_bounds: {weight_max: 0.5}", "gait_bounds.weight_min", "1.0"),
    ("simulation: {steady_from: 15 s}", "simulation.steady_from", "15.0 s"),
    ("simulation: {duration: 2 s}", "simulation.steady_from", "3.0 s"),
    ("reference: {best_distance: 3}", "reference.best_distance", "3 without a unit"),
    ("cables: {free_length: 1 km}", "robot.spacing", "balance"),
]
BAD_FILES = [
    ("name: mine", "robot.tetrahedra", "missing"),
    ("name: mine\nrobot: {tetrahedra: 4}", "robot.strut_length", "missing"),
    ("base: theses", "base", "'theses'"),
    ("base: 5", "base", "5"),
    ("base: mine.yaml", "base", "itself"),
    ("", "", "nothing"),
    ("- 1", "", "a list"),
    ("robot: [1\n", "", "YAML"),
    ("base: thesis\nrobot: {\n  spacing: 3 in\n", "", "YAML"),
    ("base: thesis\nrobot: {spacing: 2 in, spacing: 3 in}", "", "'spacing'"),
    ("!!python/object/apply:os.getcwd []", "", "YAML"),
    ("[" * 5000, "", "YAML"),
    ("base: thesis\nfitness: {twist: 1" + "0" * 400 + "}", "fitness.twist", "1000"),
]


@pytest.mark.parametrize(
    ("text", "key", "found"),
    [(f"base: thesis\n{text}", key, found) for text, key, found in BAD] + BAD_FILES,
    ids=[row[0][:40] for row in BAD + BAD_FILES],
)
def test_a_bad_file_is_told_the_file_the_key_and_what_was_found(
    tmp_path, text, key, found, refused
):
    file = write(tmp_path, text)
    with refused(file, key, found):
        load_scenario(file)


def test_scenarios_based_on_each_other_are_refused(tmp_path, refused):
    first = write(tmp_path, "base: second.yaml\n", "first.yaml")
    write(tmp_path, f"base: ../{tmp_path.name}/first.yaml\n", "second.yaml")
    with refused(f"{tmp_path}/../{tmp_path.name}/first.yaml", "base", "itself"):
        load_scenario(first)


def test_a_base_file_is_sought_beside_the_file_that_names_it_only(tmp_path, refused, monkeypatch):
    write(tmp_path, "base: thesis\n", "elsewhere/other.yaml")
    monkeypatch.chdir(tmp_path / "elsewhere")
    file = write(tmp_path, "base: other.yaml\n")
    with refused(file, "base", "'other.yaml'"):
        load_scenario(file)


def test_a_fault_names_the_file_that_has_it(tmp_path, refused):
    base = write(tmp_path, "base: thesis\nsimulation: {duration: 3 kg}\n", "low.yaml")
    file = write(tmp_path, "base: low.yaml\nsimulation: {steady_from: 5 s}\n")
    with refused(base, "simulation.duration", "'3 kg'"):
        load_scenario(file)
    write(tmp_path, "base: thesis\nsimulation: {duration: 4 s}\n", "low.yaml")
    with refused(file, "simulation.steady_from", "4.0 s"):  # of file and base together
        load_scenario(file)


def test_what_is_no_text_file_is_refused(tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff")
    for name in (".", "missing.yaml", "binary.yaml", "binary.yaml/below.yaml"):
        path = tmp_path / name
        with pytest.raises(InputError) as caught:
            load_scenario(path)
        assert (caught.value.source, caught.value.key) == (str(path), "")
