"""Scenario files: the thesis's numbers, files based on files, dumping, and bad files."""

import functools
import itertools
from operator import attrgetter
from pathlib import Path

import pytest
from helpers.anchored import HUNG, scenario_of
from record import EXPERIMENTS

from tetra_drake.errors import InputError
from tetra_drake.robot.remarks import start_up_remark
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import dump_scenario, load_scenario
from tetra_drake.scenario.shipped import shipped_scenarios
from tetra_drake.settings.refusals import TAG

# Exact by definition
IN = 0.0254
LBF = 4.4482216152605

THESIS: list[tuple[str, str, tuple[float, ...]]] = [
    # Section 2.1, appendix C.1
    ("robot", "tetrahedra gravity density", (5, 9.80665, 2.7e-3 / 1e-6)),  # 2.7 g/cm^3
    ("robot", "strut_length strut_diameter node_diameter", (6 * IN, 0.125 * IN, 0.2 * IN)),
    # Table 1; damping by Eq. 2, 3/2 alpha k: the table's lb s/in does not balance Eq. 1
    ("ground", "stiffness damping", (25 * LBF / IN, 1.5 * 0.72 / IN * 25 * LBF / IN)),
    # Tables 2 and 3
    ("friction", "stiction_range stiction_damping", (0.004 * IN, 0.4 * LBF / IN)),
    ("friction", "stiction_switch proportional_stiction", (0.7, 0.3 * LBF / IN**2)),
    ("robot.cables", "outer_stiffness inner_stiffness", (0.2 * LBF / IN, 0.3 * LBF / IN)),
    ("robot.cables", "damping free_length", (0.05 * LBF / IN, 0.04 * IN)),
    # Table 4, sections 2.2 and 2.3, appendix B, which zeroes its first 2500 samples
    ("cpg", "self_inhibition_weight external_input", (2.5, 0.5)),
    ("cpg", "initial_state", (0.3, 0.1, 0.5)),
    ("cpg", "partner_weight gain start_up listing_step", (1.5, 2 * LBF, 2500 * 5e-4, 5e-4)),
    # Tables 5 and 6, section 2.3, appendix A
    ("gait_bounds", "weight_min weight_max tau_a_min tau_a_max", (1, 3.4, 0.2, 0.5)),
    ("simulation", "duration settling_time", (15, 3)),
    ("evolution", "trials evaluations", (10, 50 + 2 * 2000)),
    ("optimizer", "population tournament crossover_probability", (50, 5, 0.2)),
    ("optimizer", "mutation_probability weight_mutation tau_mutation_range", (0.7, 0.2, 0.05)),
    ("optimizer", "stop_rise stop_window stop_after", (0.03, 100, 200)),
]


def write(folder: Path, text: str, name: str = "mine.yaml") -> Path:
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize(("section", "names", "values"), THESIS)
def test_thesis_scenario_holds_the_numbers_of_the_thesis(scenario, section, names, values):
    held = attrgetter(*names.split())(attrgetter(section)(scenario))
    assert held == pytest.approx(values, rel=1e-12)


# Table 7, for lengths in inches; phi_3, of the lead, is 0
EQUATION_10 = {"steady_distance": 1.0 / IN, "twist": -10.0 / IN, "lateral_drift": -1.0 / IN}


def test_the_thesis_objective_is_equation_10(scenario):
    assert scenario.objective == pytest.approx(EQUATION_10, rel=1e-15)
    assert (scenario.require, scenario.disturbances) == ({}, None)


LEFT = ["outer bottom_left"]
LOAD = {"cpg.feedback": ["load"]}
MAP = "!QualityDiversity {measures: {lifted: [0, 1], tension: [4 N, 0 N]}}"
BAD_CHANGES: list[tuple[object, str, str]] = [
    ([("cpg.gain", "3 N")], "changes", "[('cpg.gain', '3 N')]"),
    ({f"engine.{TAG}": {"a": 1}}, "engine", "!Compiled"),
    ({"robot": {"slack": True}}, "robot.slack", "'cables.slack'"),
    ({"robot.actuation": [LEFT, LEFT]}, "robot.actuation", "'outer bottom_left' twice"),
    ({"robot.actuation": [LEFT], "gait_bounds.mirrored": True}, "gait_bounds.mirrored", "true"),
    (LOAD | {"cpg.signals": "listing"}, "cpg.signals", "'listing'"),
    (LOAD | {"robot.gravity": 0.0}, "robot.gravity", "0 m/s^2"),
    ({"friction.breaks_free": "both"}, "friction.breaks_free", "'range'"),
    ({"cpg.listing_step": "16 s"}, "cpg.listing_step", "16.0 s"),
    ({"gait_bounds.turn": 0.5}, "gait_bounds.turn", "0.5"),
    ({"gait_bounds.tau_a_min": "0.6 s"}, "gait_bounds.tau_a_min", "0.6"),
    ({"optimizer": MAP}, "optimizer.measures.tension", "4"),
    ({"cpg.listing_step": "1e-6 s", "simulation.duration": "100 s"}, "cpg.listing_step", "1e-06 s"),
]


@pytest.mark.parametrize(("changes", "key", "found"), BAD_CHANGES, ids=itertools.count())
def test_bad_changes_are_refused(scenario, refused, changes, key, found):
    with refused("scenario thesis", key, found):
        scenario.with_changes(changes)


load_once = functools.cache(load_scenario)
RUNS = Path(__file__).parents[2] / "runs"


@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if (RUNS / name).is_dir()])
def test_a_recorded_scenario_is_that_of_its_experiment(name):
    recorded = load_scenario(RUNS / name / "scenario.yaml")
    assert (recorded.name, recorded) == (name, EXPERIMENTS[name].scenario(name))


def test_a_base_file_is_found_beside_the_file_that_names_it(tmp_path, scenario):
    write(tmp_path, "base: thesis\nrobot: {spacing: 3 m, gravity: 1 m/s^2}\n", "common/low.yaml")
    write(tmp_path, "base: common/low.yaml\nrobot: {spacing: 2 m}\n", "middle.yaml")
    file = write(tmp_path, "base: ../middle.yaml\nname: top\n", "mine/top.yaml")
    changes = {"name": "top", "robot.spacing": "2.0 m", "robot.gravity": "1.0 m/s^2"}
    assert load_scenario(str(file)) == scenario.with_changes(changes)


@pytest.mark.parametrize("name", shipped_scenarios())
def test_a_written_scenario_loads_back_to_every_bit_without_its_base(tmp_path, name):
    shipped = load_once(name)
    odd = {key: 0.99973 * number for key, number in shipped.numbers().items()}
    odd["ground.damping"] = 1e-5 / 3  # written with an exponent
    other = shipped.with_numbers(odd).with_sections(name="a: 'name' that needs # quoting")
    for scenario in (shipped, other):
        for text in {dump_scenario(scenario), scenario.to_yaml()}:  # which may be one text
            assert load_scenario(write(tmp_path, text)) == scenario


@pytest.mark.parametrize("name", shipped_scenarios())
def test_a_duration_is_shortened_by_one_key(name):
    shipped = load_once(name)
    for duration in (0.5, 2.0, 15.0):
        changed = shipped.with_changes({"simulation.duration": f"{duration} s"})
        given = shipped.simulation.steady_from
        expected = min(3.0, duration / 4.0) if given is None else given
        assert changed.simulation.settling_time == expected
        is_idle = duration <= changed.cpg.start_up and changed.policy is None
        assert ("cpg.start_up" in start_up_remark(Robot.of(changed))) == is_idle


def test_differences_are_keys_and_readable_values(scenario):
    changes = {
        "robot.cables.slack": True,
        "cpg.signals": "listing",
        "optimizer.stop_rise": 0.1 + 0.2,
    }
    changes |= {"name": "other", "friction.stiction_damping": "0.3 lbf*s/in"}
    changed = scenario.with_changes(changes | {"robot.offsets": [["1 mm", 0, 0]] * 5})
    assert changed.differences(scenario) == [
        ("robot.cables.slack", "true"),
        ("robot.offsets", f"[{', '.join(['[1 mm, 0, 0]'] * 5)}]"),
        ("friction.stiction_damping", "0.3 lbf*s/in"),
        ("cpg.signals", "listing"),
        ("optimizer.stop_rise", "0.3"),
    ]
    other = scenario.with_changes({"objective.lead": "2 /in", "terrain": "!Incline {slope: 5 deg}"})
    steep, lead = ("terrain.slope", "5 deg"), ("objective.lead", "2 /in")
    assert other.differences(scenario) == [("terrain", "Incline"), steep, lead]
    assert scenario.differences(other) == [("terrain", "Flat"), ("objective.lead", "none")]


CHANGES: list[tuple[str, dict[str, object]]] = [
    ("thesis", {"name": "other"}),
    ("thesis", {"disturbances": {"draws": 4}}),
    ("thesis", {"objective": {name: f"{x} /m" for name, x in reversed(EQUATION_10.items())}}),
    ("thesis", {"engine": "!Compiled"}),
    ("thesis", {"friction": "!Coulomb"}),
    ("thesis", {"robot.offsets": [["1 mm", 0, 0]] * 5}),
    ("thesis", {"ground.stiffness": "4378.170881161912 N/m"}),  # the last digit
    ("prism", {"robot.actuated": dict(reversed(load_scenario("prism").robot.actuated.items()))}),
    ("prism", {"robot.contacts": [*load_scenario("prism").robot.nodes]}),
]


def test_there_are_no_differences_exactly_between_equal_scenarios():
    seen = set()
    for name, changes in CHANGES:
        one = load_scenario(name)
        other = one.with_changes(changes)
        records = [dump_scenario(each.with_sections(name="")) for each in (one, other)]
        same = records[0] == records[1]
        assert (one == other, hash(one) == hash(other)) == (same, same), changes
        assert (one.differences(other) == [], other.differences(one) == []) == (same, same), changes
        seen.add(same)
    assert seen == {True, False}


# Bad files: the key at fault, and what was found there or is suggested

BAD = [
    ("friction: !Coulomb {static: 0.4}", "friction.kinetic", "0.5"),
    ("policy: Rolling", "policy", "did you mean '!Rolling'?"),
    ("robot: {cables: {free_length: 1 km}}", "robot.spacing", "balance"),
    ("robot: {spacing: &own [*own]}", "", "recursive"),
    ("terrain: !Rough {amplitude: 1 in, wavelength: 1 um}", "terrain.wavelength", "5e-07 m"),
]
BAD_FILES = [
    ("name: mine", "robot", "missing"),
    ("unit: cm\nnodes: {a: [0, 0, 0]}", "", "is a structure, expected a scenario"),
    ("base: theses", "base", "'thesis'"),
    ("robot: [1\n", "", "YAML, line 2, column 1"),
    ("base: thesis\nrobot: {spacing: 2 in, spacing: 3 in}", "", "'spacing'"),
    ("!!python/object/apply:os.getcwd []", "", "YAML"),
    ("[" * 1000, "", "YAML"),
    ("base: thesis\nrobot: &any {}\ncpg: {<<: *any}", "", "line 3, column 7"),
]
BAD_FILES += [(f"base: thesis\n{text}", key, found) for text, key, found in BAD]


@pytest.mark.parametrize(("text", "key", "found"), BAD_FILES, ids=itertools.count())
def test_a_bad_file_is_refused(tmp_path, text, key, found, refused):
    file = write(tmp_path, text)
    with refused(file, key, found):
        load_scenario(file)


ASTRAY = [("robot.cables.dampin", 0.1, "'robot.cables.damping'")]
ASTRAY += [("friction.kinetic", 0.1, "at most static")]


@pytest.mark.parametrize(("key", "spread", "found"), ASTRAY)
def test_a_spread_that_leads_astray_is_refused(key, spread, found, refused):
    with refused("scenario coulomb", f"disturbances.spreads.{key}", found):
        load_scenario("coulomb").with_changes(
            {"disturbances": {"draws": 2, "spreads": {key: spread}}}
        )


CUT = {"at": "1 s", "cut": ["T1-T2 outer top"]}
BAD_EVENTS: list[tuple[object, str, str]] = [
    ([{"at": "1 s"}], "[0]", "changes nothing"),
    ([CUT | {"at": "20 s"}], "[0].at", "found 20 s, expected less than the duration, 15 s"),
    ([CUT | {"cut": ["T1-T2 outer topp"]}], "[0].cut[0]", "did you mean 'T1-T2 outer top'?"),
    ([CUT, CUT], "[1].cut[0]", "which events[0].cut[0] takes away; expected it once"),
    ([{"at": "1 s", "lose": ["T3", "T1"]}], "[0].lose[1]", "unknown point mass 'T1'"),
    ([{"at": "1 s", "lose": "T3"}], "[0].lose", "found 'T3', expected a list, [T3]"),
    ([{"at": "1 s", "change": {"friction": 0.2}}], "[0].change", "'friction' is no number of"),
    ([{"at": "1 s", "change": {"friction.static": 0.2}}], "[0].change.friction.kinetic", "as well"),
    ([{"at": "1 s", "change": {"robot.density": 2}}], "[0].change", "no number of ground or"),
    ([{"at": "1 s", "change": {"ground.stiffness": 2}}], "[0].change.ground.stiffness", "unit"),
    ([{"at": "1 s", "change": {"friction.kinetic": 0.9}}], "[0].change.friction.kinetic", "0.9"),
    ([{"at": "1 s", "change": {"friction.kinetic": [1]}}], "[0].change.friction.kinetic", "list"),
    ([{"at": "1 s", "change": {"friction.kinetic": "low"}}], "[0].change.friction.kinetic", "low"),
]


@pytest.mark.parametrize(("events", "key", "found"), BAD_EVENTS, ids=itertools.count())
def test_a_bad_event_is_refused(events, key, found, refused):
    payload = ["0 kg", "0 kg", "0.1 kg", "0 kg", "0 kg"]
    with refused("scenario coulomb", f"events{key}", found):
        load_scenario("coulomb").with_changes({"robot.payload": payload, "events": events})


def test_a_loss_leaves_every_body_some_mass(refused):
    tree, events = HUNG | {"masses": {"top2": 0.2}}, [{"at": "1 s", "lose": ["top2"]}]
    tree["nodes"] = HUNG["nodes"] | {"top2": [0.1, 0.0, 1.0]}
    tree["cables"] = {"line": HUNG["cables"]["line"] | {"pairs": [["top", "a"], ["a", "top2"]]}}
    with refused("scenario anchored", "events[0].lose", "top2", "mass"):
        scenario_of(tree).with_changes({"events": events})
    with refused("scenario prism", "events[0].lose[0]", "give it robot.masses"):
        load_scenario("prism").with_changes({"events": events})


def test_cables_are_drawn_among_those_that_are_whole(refused):
    cuts = {"draws": 1, "cuts": {"count": 24}}
    with refused("scenario coulomb", "disturbances.cuts.count", "found 24, expected at most 23"):
        load_scenario("coulomb").with_changes({"events": [CUT], "disturbances": cuts})


def test_a_scenario_based_on_itself_is_refused(tmp_path, refused):
    file = write(tmp_path, f"base: ../{tmp_path.name}/mine.yaml")
    with refused(f"{tmp_path}/../{tmp_path.name}/mine.yaml", "base", "itself"):
        load_scenario(file)


def test_a_fault_names_the_file_that_has_it(tmp_path, refused):
    base = write(tmp_path, "base: thesis\nsimulation: {duration: 3 kg}\n", "low.yaml")
    file = write(tmp_path, "base: low.yaml\nsimulation: {steady_from: 5 s}\n")
    with refused(base, "simulation.duration", "'3 kg'"):
        load_scenario(file)
    write(tmp_path, "base: thesis\nsimulation: {duration: 4 s}\n", "low.yaml")
    with refused(file, "simulation.steady_from", "4.0 s", "null"):  # of file and base together
        load_scenario(file)


def test_what_is_no_text_file_is_refused(tmp_path, refused):
    (tmp_path / "binary.yaml").write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff")
    (tmp_path / "large.yaml").write_text("#" * (2**20 + 1))
    for name in ("missing.yaml", "binary.yaml", "large.yaml", "/dev/zero", "nul\0", "a" * 300):
        with refused(tmp_path / name, "", ""):
            load_scenario(tmp_path / name)


PRIVATE = [
    "root:x:0:0:secret:/root:/bin/sh\ndaemon:x:1:1:secret:/:/bin/sh\n",  # YAML: a text
    "root:$6$secret:19000:0:99999:7:::\ndaemon:*:19000:0:99999:7:::\n",  # YAML: a mapping
    *("a: [1, 2\nsecret: {x: 1\n  secret\n", "*secret\n", "&secret 1\n&secret 2\n", "- secret\n"),
    *("!secret {a: 1}\n", "!$6$secret text\n", "!secret!name text\n", "name: !!int secret\n"),
    "root:$6$secret" + 120 * "x",  # longer than what NumPy quotes
    *("name: !!bool secret\n", "name: !!timestamp secret\n", "secret one: 1\nsecret one: 2\n"),
]


NAMING_IT = ["base: any", "base: thesis\nrobot: !Structure {file: any}"]
NAMING_IT += ["base: thesis\nterrain: !HeightField {file: any, cell: 1 m}"]


@pytest.mark.parametrize("content", PRIVATE)
@pytest.mark.parametrize("text", NAMING_IT)
def test_nothing_is_shown_of_a_file_that_is_something_else(tmp_path, content, text):
    (tmp_path / "any").write_text(content)
    with pytest.raises(InputError) as caught:
        load_scenario(write(tmp_path, text))
    assert "secret" not in str(caught.value)
    assert str(tmp_path / "any") in str(caught.value)
