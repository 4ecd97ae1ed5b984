"""Scenario files: the thesis's numbers, files based on files, and what a bad file is told."""

import math
from pathlib import Path

import numpy as np
import pytest

from tetra_drake.errors import InputError
from tetra_drake.scenario.load import dump_scenario, load_scenario, shipped_scenarios
from tetra_drake.scenario.schema import Scenario

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


def value_at(scenario: Scenario, key: str):
    node = scenario
    for name in key.split("."):
        node = getattr(node, name)
    return node


def write(folder: Path, text: str, name: str = "mine.yaml") -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


# The thesis scenario


@pytest.mark.parametrize(("key", "number", "si"), THESIS, ids=[row[0] for row in THESIS])
def test_thesis_scenario_holds_the_number_of_the_thesis(scenario, key, number, si):
    assert value_at(scenario, key) == pytest.approx(number * si, rel=1e-12)


def test_thesis_crossover_is_uniform(scenario):
    assert scenario.evolution.crossover == "uniform"


def test_thesis_ground_damping_is_three_halves_alpha_k(scenario):
    # Eq. 2: lambda = 3/2 alpha k = 1.5 * 0.72 s/in * 25 lbf/in = 27 lbf s/in^2.
    ground = scenario.ground
    expected = 1.5 * ground.velocity_correction * ground.stiffness
    assert ground.damping == pytest.approx(expected, rel=1e-12)


def test_thesis_spacing_balances_outer_and_inner_cables(scenario):
    # Between two neighbours with base triangles s apart: 3 outer cables of length s pull them
    # together. 3 inner ones run from the rear one's tip, at height h on the axis, to the base
    # nodes of the other, at s and R off the axis: l = sqrt((h - s)^2 + R^2). As s < h, they
    # push apart with the axial share (h - s) / l of their tension.
    cables = scenario.cables
    h = math.sqrt(2 / 3) * scenario.robot.strut_length
    R = scenario.robot.strut_length / math.sqrt(3)

    def pull_together(s: float) -> float:
        length = math.hypot(h - s, R)
        outer = 3 * cables.outer_stiffness * (s - cables.free_length)
        inner = 3 * cables.inner_stiffness * (length - cables.free_length)
        return outer - inner * (h - s) / length

    near, far = 0.0, h
    for _ in range(60):
        middle = (near + far) / 2
        near, far = (near, middle) if pull_together(middle) > 0 else (middle, far)
    assert scenario.robot.spacing == pytest.approx(near, abs=0.01 * IN)


def test_thesis_start_up_is_over_before_the_steady_stretch(scenario):
    assert scenario.cpg.start_up < scenario.simulation.steady_from < scenario.simulation.duration


def test_thesis_is_the_default_and_its_own_name(scenario):
    assert load_scenario() == scenario
    assert scenario.name == "thesis"


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario_loads(name):
    assert isinstance(load_scenario(name), Scenario)


def test_there_is_an_oscillator_for_each_junction(scenario):
    assert scenario.oscillators == 4
    scenario.robot.tetrahedra = 2
    assert scenario.oscillators == 1


# Files based on files


def test_a_file_changes_only_what_it_gives(tmp_path, scenario):
    file = write(
        tmp_path,
        """\
        base: thesis
        name: stiff
        cables:
          outer_stiffness: 1 lbf/in
          slack: true
        simulation: {duration: 500 ms, steady_from: 0 s}
        """,
    )
    expected = scenario.with_changes(
        {
            "name": "stiff",
            "cables.outer_stiffness": LBF / IN,
            "cables.slack": True,
            "simulation.duration": 0.5,
            "simulation.steady_from": 0.0,
        }
    )
    loaded = load_scenario(file)
    assert loaded.cables.outer_stiffness == pytest.approx(LBF / IN, rel=1e-12)
    loaded.cables.outer_stiffness = expected.cables.outer_stiffness
    assert loaded == expected


def test_a_file_with_nothing_but_a_base_is_that_base(tmp_path, scenario):
    assert load_scenario(write(tmp_path, "base: thesis\n")) == scenario


def test_a_base_file_is_found_beside_the_file_that_names_it(tmp_path, scenario):
    write(tmp_path, "base: thesis\nrobot: {spacing: 3 m, gravity: 1 m/s^2}\n", "common/low.yaml")
    write(tmp_path, "base: common/low.yaml\nrobot: {spacing: 2 m}\n", "middle.yaml")
    file = write(tmp_path, "base: ../middle.yaml\nname: top\n", "mine/top.yaml")
    scenario.name = "top"
    scenario.robot.spacing = 2.0
    scenario.robot.gravity = 1.0
    assert load_scenario(file) == scenario


def test_a_path_may_be_given_as_text(tmp_path, scenario):
    assert load_scenario(str(write(tmp_path, "base: thesis\n"))) == scenario


def test_a_change_of_one_loaded_scenario_does_not_reach_the_next():
    load_scenario().robot.tetrahedra = 9
    assert load_scenario().robot.tetrahedra == 5


def test_an_integer_is_a_number(tmp_path):
    weight = load_scenario(write(tmp_path, "base: thesis\ngait_bounds: {weight_max: 4}\n"))
    assert weight.gait_bounds.weight_max == 4.0
    assert isinstance(weight.gait_bounds.weight_max, float)


def test_limits_that_are_allowed_can_be_reached(tmp_path):
    loaded = load_scenario(
        write(
            tmp_path,
            """\
            base: thesis
            robot: {tetrahedra: 2, gravity: 0 m/s^2}
            cables: {damping: 0 N*s/m}
            gait_bounds: {tau_a_min: 0.5 s, weight_min: 0, weight_max: 0}
            evolution: {mutation_probability: 1}
            """,
        )
    )
    assert loaded.robot.gravity == 0.0
    assert loaded.gait_bounds.tau_a_min == loaded.gait_bounds.tau_a_max


# Dumping


def test_a_dumped_scenario_loads_back_without_a_base(tmp_path, scenario):
    text = dump_scenario(scenario)
    assert "base" not in text.split()
    assert load_scenario(write(tmp_path, text)) == scenario


def test_a_dumped_scenario_keeps_every_bit(tmp_path, scenario):
    generator = np.random.default_rng(3)
    for section in vars(scenario).values():
        for name, value in list(getattr(section, "__dict__", {}).items()):
            if isinstance(value, float):
                setattr(section, name, value * float(generator.uniform(0.9, 1.1)))
    scenario.friction.stiction_range = 1e-5 / 3  # dumped with an exponent
    scenario.name = "a: 'name' that needs # quoting"
    assert load_scenario(write(tmp_path, dump_scenario(scenario))) == scenario


def test_a_dumped_scenario_shows_units(scenario):
    assert "gravity: 9.80665 m/s^2" in dump_scenario(scenario)


# Bad files: one line that names file and key, and what was expected


BAD = {
    "unknown key with a suggestion": (
        "base: thesis\nrobot: {tetrahedron: 4}",
        "robot.tetrahedron",
        "did you mean 'tetrahedra'?",
    ),
    "unknown section with a suggestion": (
        "base: thesis\ngait_bound: {}",
        "gait_bound",
        "did you mean 'gait_bounds'?",
    ),
    "unknown key unlike any": (
        "base: thesis\nfitness: {qqq: 1}",
        "fitness.qqq",
        "expected one of distance, twist, direction, drift",
    ),
    "key that is a number": ("base: thesis\n1: 2", "1", "unknown key"),
    "number for a section": ("base: thesis\nrobot: 5", "robot", "expected a mapping"),
    "nothing for a section": ("base: thesis\nrobot:", "robot", "expected a mapping"),
    "list for a section": ("base: thesis\nrobot: [5]", "robot", "expected a mapping"),
    "section for a quantity": (
        "base: thesis\nrobot: {spacing: {a: 1}}",
        "robot.spacing",
        "expected a quantity that converts to m",
    ),
    "text for an integer": (
        "base: thesis\nrobot: {tetrahedra: five}",
        "robot.tetrahedra",
        "found 'five', expected an integer",
    ),
    "fraction for an integer": (
        "base: thesis\nrobot: {tetrahedra: 4.5}",
        "robot.tetrahedra",
        "found 4.5, expected an integer",
    ),
    "boolean for an integer": (
        "base: thesis\nrobot: {tetrahedra: true}",
        "robot.tetrahedra",
        "found true, expected an integer",
    ),
    "boolean for a number": (
        "base: thesis\nfitness: {drift: false}",
        "fitness.drift",
        "found false, expected a number",
    ),
    "text for a number": (
        "base: thesis\nfitness: {drift: little}",
        "fitness.drift",
        "found 'little', expected a number",
    ),
    "list for a number": ("base: thesis\nfitness: {drift: [1]}", "fitness.drift", "a number"),
    "number for a boolean": (
        "base: thesis\ncables: {slack: 1}",
        "cables.slack",
        "expected true or false",
    ),
    "number for text": ("base: thesis\nname: 5", "name", "found 5, expected text"),
    "unknown choice": (
        "base: thesis\ncpg: {signals: recording}",
        "cpg.signals",
        "found 'recording', expected one of listing, recorded, live",
    ),
    "number without a unit": (
        "base: thesis\nrobot: {spacing: 3}",
        "robot.spacing",
        "found 3 without a unit, expected a quantity that converts to m",
    ),
    "number in text without a unit": (
        "base: thesis\nrobot: {spacing: '3'}",
        "robot.spacing",
        "found '3'",
    ),
    "wrong unit": (
        "base: thesis\ncables: {outer_stiffness: 25 lbf}",
        "cables.outer_stiffness",
        "found '25 lbf', expected a quantity that converts to N/m",
    ),
    "unknown unit": (
        "base: thesis\nrobot: {spacing: 3 inchies}",
        "robot.spacing",
        "found '3 inchies', whose unit is unknown",
    ),
    "NaN for a quantity": ("base: thesis\nrobot: {spacing: nan in}", "robot.spacing", "nan in"),
    "NaN without a unit": ("base: thesis\nrobot: {spacing: .nan}", "robot.spacing", "nan"),
    "NaN for a number": (
        "base: thesis\nfitness: {drift: .nan}",
        "fitness.drift",
        "found nan, expected a finite number",
    ),
    "infinite number": (
        "base: thesis\nfitness: {drift: -.inf}",
        "fitness.drift",
        "found -inf, expected a finite number",
    ),
    "infinite quantity": (
        "base: thesis\nsimulation: {duration: 1e999 s}",
        "simulation.duration",
        "finite",
    ),
    "negative stiffness": (
        "base: thesis\ncables: {outer_stiffness: -0.2 lbf/in}",
        "cables.outer_stiffness",
        "found '-0.2 lbf/in', expected more than 0",
    ),
    "stiffness of zero": (
        "base: thesis\nground: {stiffness: 0 lbf/in}",
        "ground.stiffness",
        "expected more than 0",
    ),
    "negative damping": (
        "base: thesis\nground: {damping: -1 N*s/m^2}",
        "ground.damping",
        "expected at least 0",
    ),
    "probability above 1": (
        "base: thesis\nevolution: {crossover_probability: 20}",
        "evolution.crossover_probability",
        "found 20, expected at most 1",
    ),
    "one tetrahedron": (
        "base: thesis\nrobot: {tetrahedra: 1}",
        "robot.tetrahedra",
        "found 1, expected at least 2",
    ),
    "least tau_a above greatest": (
        "base: thesis\ngait_bounds: {tau_a_min: 0.6 s}",
        "gait_bounds.tau_a_min",
        "expected at most tau_a_max",
    ),
    "least weight above greatest": (
        "base: thesis\ngait_bounds: {weight_max: 0.5}",
        "gait_bounds.weight_min",
        "expected at most weight_max",
    ),
    "steady stretch from the end on": (
        "base: thesis\nsimulation: {steady_from: 15 s}",
        "simulation.steady_from",
        "expected less than the duration",
    ),
    "duration before the steady stretch": (
        "base: thesis\nsimulation: {duration: 2 s}",
        "simulation.steady_from",
        "found 3.0 s, expected less than the duration, 2.0 s",
    ),
    "section missing without a base": ("name: mine", "robot", "is missing"),
    "key missing without a base": (
        "name: mine\nrobot: {tetrahedra: 4}",
        "robot.strut_length",
        "begin the file with `base: thesis`",
    ),
    "unknown base": ("base: theses", "base", "no such scenario file 'theses'"),
    "base that is not a name": ("base: 5", "base", "found 5, expected the name of a scenario"),
    "based on itself": ("base: mine.yaml", "base", "the scenario is based on itself"),
    "nothing in the file": ("", "", "found nothing, expected a mapping"),
    "list in the file": ("- 1", "", "found a list, expected a mapping"),
    "text in the file": ("thesis", "", "found 'thesis', expected a mapping"),
    "not YAML": ("robot: [1\n", "", "is not YAML"),
    "not YAML over several lines": ("base: thesis\nrobot: {\n  spacing: 3 in\n", "", "is not YAML"),
    "YAML that runs code": ("!!python/object/apply:os.getcwd []", "", "is not YAML"),
}


@pytest.mark.parametrize(("text", "key", "problem"), BAD.values(), ids=BAD.keys())
def test_a_bad_file_is_told_the_file_the_key_and_what_was_expected(
    tmp_path, text, key, problem, refused
):
    file = write(tmp_path, text)
    with refused(file, key, problem):
        load_scenario(file)


def test_scenarios_based_on_each_other_are_refused(tmp_path, refused):
    first = write(tmp_path, "base: second.yaml\n", "first.yaml")
    write(tmp_path, "base: first.yaml\n", "second.yaml")
    with refused(first, "base", "is based on itself"):
        load_scenario(first)


def test_a_base_named_by_a_detour_is_still_itself(tmp_path, refused):
    file = write(tmp_path, f"base: ../{tmp_path.name}/mine.yaml\n")
    with refused(f"{tmp_path}/../{tmp_path.name}/mine.yaml", "base", "is based on itself"):
        load_scenario(file)


def test_a_base_file_is_sought_beside_the_file_that_names_it_only(tmp_path, refused, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    write(tmp_path / "elsewhere", "base: thesis\n", "other.yaml")
    monkeypatch.chdir(tmp_path / "elsewhere")
    file = write(tmp_path, "base: other.yaml\n")
    with refused(file, "base", "no such scenario file 'other.yaml'"):
        load_scenario(file)


def test_a_key_given_twice_is_refused(tmp_path, refused):
    file = write(tmp_path, "base: thesis\nrobot: {spacing: 2 in, spacing: 3 in}\n")
    with refused(file, "", "found the key 'spacing' twice"):
        load_scenario(file)


def test_a_number_may_be_written_as_people_write_it(tmp_path):
    # YAML 1.1 takes 1e-3, without a point, for text.
    file = write(tmp_path, "base: thesis\nsimulation: {accuracy: 1e-3}\n")
    assert load_scenario(file).simulation.accuracy == 0.001


@pytest.mark.parametrize("text", ["[" * 5000, "fitness: {twist: 1" + "0" * 400 + "}\nbase: thesis"])
def test_absurd_files_are_refused_too(tmp_path, text):
    with pytest.raises(InputError):
        load_scenario(write(tmp_path, text))


def test_a_fault_in_a_base_file_names_the_base_file(tmp_path, refused):
    base = write(tmp_path, "base: thesis\nrobot: {spacing: 3 s}\n", "low.yaml")
    with refused(base, "robot.spacing", "found '3 s'"):
        load_scenario(write(tmp_path, "base: low.yaml\n"))


def test_values_of_file_and_base_are_checked_together(tmp_path, refused):
    write(tmp_path, "base: thesis\nsimulation: {duration: 4 s}\n", "low.yaml")
    file = write(tmp_path, "base: low.yaml\nsimulation: {steady_from: 5 s}\n")
    with refused(file, "simulation.steady_from", "4.0 s"):
        load_scenario(file)


def test_a_missing_file_is_named_together_with_the_shipped_scenarios(tmp_path, refused):
    file = tmp_path / "missing.yaml"
    known = ", ".join(shipped_scenarios())
    with refused(file, "", f"no such scenario file, and no shipped scenario ({known})"):
        load_scenario(file)


def test_a_directory_is_not_a_scenario_file(tmp_path, refused):
    with refused(tmp_path, "", "is a directory, expected a scenario file"):
        load_scenario(tmp_path)


def test_a_path_below_a_file_is_not_a_scenario_file(tmp_path, refused):
    path = write(tmp_path, "base: thesis\n") / "below.yaml"
    with refused(path, "", "cannot be read"):
        load_scenario(path)


def test_a_binary_file_is_not_a_scenario_file(tmp_path, refused):
    file = tmp_path / "mine.yaml"
    file.write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff")
    with refused(file, "", "cannot be read as text"):
        load_scenario(file)
