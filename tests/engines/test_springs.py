"""Springs and strings as laboratories have them: masses on each, thrown up so that they fall in."""

import numpy as np
import pytest
from helpers.anchored import TREES, scenario_of
from scipy.integrate import solve_ivp

from tetra_drake.engines.simulate import simulate
from tetra_drake.lab.study.equilibrium import study_equilibrium
from tetra_drake.laws.cable import CableLaw, elastic_energy, elastic_stretch, elastic_tension
from tetra_drake.report.summary import result_text
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.robot_structure import StructureFile
from tetra_drake.scenario.scenario import Scenario

G, MASS, FREE = 9.80665, 0.5, 0.1
SPRINGS = {
    "coil": {"stiffness": 200.0, "initial_tension": 3.0, "max_tension": 10.0},
    "hardening": {"stiffness": 100.0, "quadratic": 2e3, "cubic": 4e5},
    "table": {"max_stretch": 0.1, "curve": {"stretch": [0.01, 0.03], "force": [1.0, 7.0]}},
    "string": {"string": True, "stiffness": 2e4},
}


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
    loose = {"damping": 0.0, "free_length": FREE}
    ends = {name: (f"h-{name}", f"m-{name}") for name in SPRINGS}
    tree = {"nodes": {}, "cables": {}, "anchors": {}, "masses": {}}
    for i, (name, (hook, mass)) in enumerate(ends.items()):
        tree["nodes"] |= {hook: [0.2 * i, 0.0, 1.0], mass: [0.2 * i, 0.0, 0.9]}
        tree["cables"][name] = loose | SPRINGS[name] | {"pairs": [[hook, mass]]}
        tree["anchors"][hook], tree["masses"][mass] = "xyz", MASS
    changes = {"simulation.sample_period": "5 ms", "friction.stiffness": "0 N/m"}
    resting = scenario_of(tree, duration=0.3, engine=engine, **changes)
    lengths = Robot.of(resting).structure.initial_lengths
    offsets = [["0 m", "0 m", f"{x - FREE + 0.02!r} m"] for x in lengths.tolist()]
    return resting.with_changes({"robot.offsets": offsets})


@pytest.mark.parametrize("engine", ["!Compiled", "!Drake", "!Mujoco"])
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
        law = CableLaw(**Robot.of(scenario).structure.cable_laws[number])
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
    for name, x in zip(SPRINGS, stretch, strict=True):
        assert pull(name, x) == pytest.approx(MASS * G, abs=2e-5)  # x is rounded to 1 nm
    slopes = [200.0, 100.0 + 4e3 * stretch[1] + 12e5 * stretch[1] ** 2, 300.0, 2e4]
    bounces, swings = np.sqrt(np.divide(slopes, MASS)), np.sqrt(G / (FREE + stretch))
    expected = np.sort([*bounces, *swings, *swings]) / (2.0 * np.pi)
    np.testing.assert_allclose(study.frequencies, expected, rtol=1e-6)


@pytest.mark.parametrize("name", SPRINGS)
def test_energy_and_stretch_of_a_spring_fit_its_tension(name):
    law = CableLaw(**Robot.of(hung("!Compiled")).structure.cable_laws[[*SPRINGS].index(name)])
    x = np.linspace(0.0, 0.05, 5001)[1:]
    tension = np.array([pull(name, each) for each in x])
    np.testing.assert_allclose(elastic_tension(x, law), tension, rtol=1e-12)
    np.testing.assert_allclose(elastic_stretch(tension, law), x, rtol=1e-9)
    work = np.cumsum(0.5 * (tension + np.append(0.0, tension[:-1]))) * 1e-5
    np.testing.assert_allclose(elastic_energy(x, law), work, rtol=1e-4, atol=2e-5)


def test_a_string_without_stiffness_gets_that_of_anchors():
    tree = StructureFile.model_validate(TREES["strung"])
    law = tree.blueprint().cable_laws[0]
    assert law["stiffness"] == pytest.approx(2.0 * G / (1e-5 * 0.4))  # sags by 1e-5 of its length
    assert law["damping"] == 1e-3 * law["stiffness"]
