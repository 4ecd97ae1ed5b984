"""Springs and strings as laboratories have them: masses on each, thrown up so that they fall in."""

import numpy as np
import pytest
from helpers.anchored import TREES, scenario_of
from scipy.integrate import solve_ivp

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.laws.cable import elastic_energy, elastic_stretch
from tetra_drake.report.summary import result_text
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario

G, MASS, FREE = 9.80665, 0.5, 0.1
SPRINGS = TREES["springs"]["cables"]


def pull(name: str, x: float) -> float:
    """Tension (N) of a spring at a stretch (m), from its data sheet."""
    if x <= 0.0:
        return 0.0
    return {
        # Below 3 N the coils touch: 200 kN/m.
        "coil": min(2e5 * x, 3.0 + 200.0 * x),
        "hardening": 100.0 * x + 2e3 * x**2 + 4e5 * x**3,
        "table": 100.0 * x if x < 0.01 else 1.0 + 300.0 * (x - 0.01),
        "string": 2e4 * x,
    }[name]


def hung(engine: str) -> Scenario:
    """A mass on each spring, 20 mm above the end of the loose spring."""
    changes = {"simulation.sample_period": "5 ms", "friction.stiffness": "0 N/m"}
    resting = scenario_of(TREES["springs"], duration=0.3, engine=engine, **changes)
    lengths = Robot.of(resting).structure.initial_lengths
    offsets = [["0 m", "0 m", f"{x - FREE + 0.02!r} m"] for x in lengths.tolist()]
    return resting.with_changes({"robot.offsets": offsets})


def test_masses_fall_into_springs_and_are_thrown_back(engine):
    scenario = hung(engine)
    result = simulate(scenario, seeded_gait(scenario, 0), record=True)
    # It falls 20 mm and x: m g (0.02 m + x) = F0 x + k x² / 2, x = 42.25 mm.
    assert "h-coil m-coil reaches 11.44 N, its limit is 10 N." in result_text(result)  # in samples
    found = result.trajectory
    for number, name in enumerate(SPRINGS):
        length, tension = (found[which].values[:, number] for which in ("length", "tension"))

        def motion(time, y, name=name):
            return [y[1], G - pull(name, y[0] - FREE) / MASS]

        start = [FREE - 0.02, 0.0]
        exact = {"t_eval": found.time.values, "max_step": 5e-4, "rtol": 1e-8}
        expected = solve_ivp(motion, (0.0, 0.3), start, **exact).y[0]
        np.testing.assert_allclose(length, expected, atol=5e-5)  # found: 2.6e-5, by MuJoCo
        np.testing.assert_allclose(tension, [pull(name, x - FREE) for x in length], atol=1e-9)
        law = Robot.of(scenario).structure.cable_laws[number]
        stretch = np.maximum(length - FREE, 0.0)
        speed = found.v_WN.sel(node=f"m-{name}", axis="z").values
        energy = 0.5 * MASS * speed**2 - MASS * G * length + elastic_energy(stretch, law)
        np.testing.assert_allclose(energy, energy[0], atol=8e-4)


def test_masses_at_rest_stretch_springs_as_their_data_sheets_say():
    heavy = hung("!Compiled").with_changes({"robot.offsets": []})
    light = heavy.with_changes({"robot.masses.m-coil": "0.2 kg"})
    structure = Robot.of(light).structure
    closed = structure.initial_lengths[0] - FREE
    assert closed == pytest.approx(0.2 * G / 2e5, rel=1e-4)
    study = study_equilibrium(Robot.of(heavy, at_rest=True))
    stretch = study.cables["length"].to_numpy() - FREE
    assert stretch[0] == pytest.approx((MASS * G - 3.0) / 200.0, rel=1e-6)
    for name, x, law in zip(SPRINGS, stretch, structure.cable_laws, strict=True):
        assert pull(name, x) == pytest.approx(MASS * G, abs=2e-5)  # x is rounded to 1 nm
        assert elastic_stretch(MASS * G, law) == pytest.approx(x, abs=1e-9)
    slopes = [200.0, 100.0 + 4e3 * stretch[1] + 12e5 * stretch[1] ** 2, 300.0, 2e4]
    bounces, swings = np.sqrt(np.divide(slopes, MASS)), np.sqrt(G / (FREE + stretch))
    expected = np.sort([*bounces, *swings, *swings]) / (2.0 * np.pi)
    np.testing.assert_allclose(study.frequencies, expected, rtol=1e-6)


def test_a_string_without_stiffness_gets_that_of_anchors():
    tree = StructureFile.model_validate(TREES["strung"])
    law = tree.blueprint().cable_laws[0]
    assert law.stiffness == pytest.approx(2.0 * G / (1e-5 * 0.4))  # sags by 1e-5 of its length
    assert law.damping == 1e-3 * law.stiffness


LINE = {"string": True, "stiffness": 2e4, "damping": 20.0}
COIL = {"stiffness": 200.0, "damping": 0.5, "free_length": FREE}


def ended(groups, nodes, fixed, masses, *, moves=None, gravity=G):
    """Lengths and tensions of cables, and velocities of nodes along x, y and z, after 0.6 s."""
    tree = {"nodes": nodes, "cables": groups, "masses": masses, "gravity": gravity}
    tree |= {"anchors": dict.fromkeys(fixed, "xyz")}
    if moves is not None:
        bodies = {name: {"velocity": v} for name, v in moves.items()}
        tree |= {"start": {"rest": False, "bodies": bodies}}
    scenario = scenario_of(tree, 0.6, engine="!Compiled {tolerance: 1e-6 m/s}")
    end = simulate(scenario, seeded_gait(scenario, 0), record=True).trajectory.isel(time=-1)
    return end.length.values, end.tension.values, end.v_WN.sel(node=[*masses]).values


def test_a_weight_on_a_string_goes_round_as_a_conical_pendulum():
    cone, pull = {"h": [0.0, 0.0, 1.0], "m": [0.24, 0.0, 0.68]}, 0.5 * G / 0.8
    speed, line = np.sqrt(G * 0.24**2 / 0.32), LINE | {"free_length": 0.4 - pull / 2e4}
    moves = {"m": [0.0, speed, 0.0]}
    groups = {"l": line | {"pairs": [["h", "m"]]}}
    _, tension, v = ended(groups, cone, "h", {"m": 0.5}, moves=moves)
    assert tension[0] == pytest.approx(pull, rel=1e-3)
    assert np.linalg.norm(v) == pytest.approx(speed, rel=1e-3)


def test_masses_that_a_damped_string_stops_from_parting_go_on_together():
    pair, line = {"a": [-0.1, 0.0, 1.0], "b": [0.1, 0.0, 1.0]}, {"damping": 2e4, "free_length": 0.4}
    groups, moves = {"l": LINE | line | {"pairs": [["a", "b"]]}}, {"b": [1.0, 0.0, 0.0]}
    _, _, v = ended(groups, pair, "", {"a": 0.3, "b": 0.1}, moves=moves, gravity=0.0)
    np.testing.assert_allclose(v[:, 0], 0.25, atol=5e-3)


def test_a_coil_that_bears_less_than_its_initial_tension_swings_as_a_rod():
    groups = {"coil": COIL | {"initial_tension": 9.0, "damping": 0.0, "pairs": [["h", "m"]]}}
    aside = {"h": [0.0, 0.0, 1.0], "m": [FREE * np.sin(0.5), 0.0, 1.0 - FREE * np.cos(0.5)]}
    length, _, v = ended(groups, aside, "h", {"m": 0.2}, moves={})
    phase = solve_ivp(
        lambda _, y: [y[1], -G / FREE * np.sin(y[0])], (0.0, 0.6), [0.5, 0.0], rtol=1e-9
    ).y[:, -1]
    assert length[0] == pytest.approx(FREE, abs=4e-5)
    np.testing.assert_allclose(v[0, 0], FREE * phase[1] * np.cos(phase[0]), atol=5e-3)
