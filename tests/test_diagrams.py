"""The example scripts in diagrams/: the physics they show, and the pictures they write."""

import dataclasses
import importlib.util
import math
import shutil
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tetra_drake import thesis
from tetra_drake.gait import seeded_gait
from tetra_drake.robot import BASE, BOTTOM_LEFT, TOP, tetrahedron_inertia
from tetra_drake.scenario import Scenario, load_scenario
from tetra_drake.simulation import simulate
from tetra_drake.units import INCH, POUND_FORCE

DIAGRAMS = Path(__file__).parent.parent / "diagrams"
IMPACT_SPEED = thesis.SETTLING_IMPACT_SPEED_IN_S * INCH


def load_script(name: str) -> ModuleType:
    """The script as a module; other scripts find it under its name, as when they are run."""
    spec = importlib.util.spec_from_file_location(name, DIAGRAMS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


single_oscillator = load_script("single_oscillator")
settling_node = load_script("settling_node")
sliding_tetrahedron = load_script("sliding_tetrahedron")
robot = load_script("robot")

QUICK = [single_oscillator, settling_node, sliding_tetrahedron]
"""The scripts that take about a second."""

needs_dot = pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")


def oscillate(scenario: Scenario, *, weight: float = 1.5, tau_a: float = 0.3, factor: float = 2.0):
    return single_oscillator.simulate(
        scenario, partner_weight=weight, tau_a=tau_a, tau_b=factor * tau_a
    )


def mass(scenario: Scenario) -> float:
    return tetrahedron_inertia(settling_node.MakeTetrahedron(scenario)).get_mass()


def weight(scenario: Scenario) -> float:
    return mass(scenario) * scenario.robot.gravity


def integral(values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Of values (samples, ...) over time, by the trapezoidal rule."""
    return np.tensordot(np.diff(times), (values[:-1] + values[1:]) / 2.0, axes=1)


@pytest.fixture(scope="module")
def motion():
    """The slide of the script."""
    scenario = load_scenario("thesis")
    return sliding_tetrahedron.slide(scenario, speed=sliding_tetrahedron.INITIAL_SPEED)


@pytest.fixture(scope="module")
def walk():
    """Scenario, gait and result of two seconds of walking."""
    scenario = load_scenario("thesis")
    scenario.simulation = dataclasses.replace(scenario.simulation, duration=2.0, steady_from=1.0)
    gait = dataclasses.replace(seeded_gait(scenario), name="short walk")
    return scenario, gait, simulate(scenario=scenario, gait=gait, record=True)


class TestSingleOscillator:
    # With d = u1 - u2 and e = v1 - v2 while both neurons fire, Eq. 7 is
    #   tau_A d' = (w - 1) d - beta e,   tau_B e' = d - e,
    # whose characteristic equation is
    #   tau_A tau_B s² + (tau_A - (w - 1) tau_B) s + beta + 1 - w = 0.
    # w = 1.5 and tau_B = 2 tau_A cancel the damping; with beta = 2.5 that leaves omega = 1 / tau_A.

    @pytest.mark.parametrize("tau_a", [0.2, 0.3, 0.5])
    def test_frequency_is_that_of_the_linear_equations(
        self, scenario: Scenario, tau_a: float
    ) -> None:
        measured = single_oscillator.frequency(oscillate(scenario, tau_a=tau_a))
        assert measured == pytest.approx(1.0 / (2.0 * math.pi * tau_a), rel=2e-3)
        linear = single_oscillator.linear_frequency(
            scenario, partner_weight=1.5, tau_a=tau_a, tau_b=2.0 * tau_a
        )
        assert measured == pytest.approx(linear, rel=2e-3)

    def test_the_thesis_frequency_lies_within_its_bounds(self, scenario: Scenario) -> None:
        # "approximately 0.7 Hertz" is not tau_A = 0.3 s (0.53 Hz), but a tau_A of Table 5.
        tau_a = 1.0 / (2.0 * math.pi * thesis.OSCILLATOR_FREQUENCY_HZ)
        assert scenario.gait_bounds.tau_a_min < tau_a < scenario.gait_bounds.tau_a_max
        measured = single_oscillator.frequency(oscillate(scenario, tau_a=tau_a))
        assert measured == pytest.approx(thesis.OSCILLATOR_FREQUENCY_HZ, rel=2e-3)

    def test_a_greater_weight_makes_it_slower_and_larger(self, scenario: Scenario) -> None:
        light, heavy = oscillate(scenario, weight=1.5), oscillate(scenario, weight=2.0)
        ratio = single_oscillator.frequency(heavy) / single_oscillator.frequency(light)
        assert ratio == pytest.approx(0.83, abs=0.02)
        assert single_oscillator.peak_to_peak(heavy) > 1.2 * single_oscillator.peak_to_peak(light)

    def test_only_a_time_constant_factor_below_two_dies_out(self, scenario: Scenario) -> None:
        pounds = {
            factor: single_oscillator.peak_to_peak(oscillate(scenario, factor=factor)) / POUND_FORCE
            for factor in single_oscillator.FACTORS
        }
        assert pounds[1.5] < 0.1
        assert 0.7 < pounds[2.0] < pounds[3.0] < 1.0

    def test_no_crossings_no_frequency(self) -> None:
        times = np.linspace(0.0, 15.0, 100)
        silent = single_oscillator.Oscillation(times=times, signal=np.zeros(100))
        assert math.isnan(single_oscillator.frequency(silent))


class TestSettlingNode:
    def test_rests_on_its_weight(self, scenario: Scenario) -> None:
        motion = settling_node.settle(scenario, impact_speed=IMPACT_SPEED)
        assert motion.normal_forces[-1].sum() == pytest.approx(weight(scenario), rel=1e-2)
        depth = weight(scenario) / (len(BASE) * scenario.ground.stiffness)
        np.testing.assert_allclose(motion.p_WN[-1, list(BASE), 2], -depth, rtol=1e-2)
        assert np.abs(motion.v_WN[-1]).max() < 1e-3 * IMPACT_SPEED

    def test_meets_the_ground_at_the_speed_asked_for_and_stays(self, scenario: Scenario) -> None:
        motion = settling_node.settle(scenario, impact_speed=IMPACT_SPEED)
        impact, rebound = settling_node.first_contact(motion)
        assert impact == pytest.approx(IMPACT_SPEED, rel=1e-2)
        assert math.isnan(rebound)

    @pytest.mark.parametrize("inches_a_second", [0.03, 0.12, 0.3])
    def test_restitution_is_that_of_the_law(
        self, scenario: Scenario, inches_a_second: float
    ) -> None:
        # Eq. 1 without weight, m dv/dt = -k x (1 + d v) with d = lambda / k = 3/2 alpha and
        # v = dx/dt, separates: v dv / (1 + d v) = -k/m x dx. The right-hand side gives
        # the same on the way in (v from v_i to 0) and out (0 to -v_o), so
        #   d v_i - ln(1 + d v_i) = -d v_o - ln(1 - d v_o),
        # whatever m and k are. Expanded for small v that is v_o / v_i = 1 - 2/3 d v_i + ...
        # = 1 - alpha v_i (Eq. 2), whose next term is of second order: 2 % below 0.2 in/s.
        speed = inches_a_second * INCH
        motion = settling_node.bounce(scenario, impact_speed=speed)
        impact, rebound = settling_node.first_contact(motion)
        assert impact == pytest.approx(speed, rel=1e-6)
        d = scenario.ground.damping / scenario.ground.stiffness
        assert -d * rebound - math.log1p(-d * rebound) == pytest.approx(
            d * impact - math.log1p(d * impact), rel=5e-3
        )
        if inches_a_second < 0.2:
            linear = 1.0 - scenario.ground.velocity_correction * impact
            assert rebound / impact == pytest.approx(linear, rel=2e-2)

    def test_normal_forces_turn_the_momentum_around(self, scenario: Scenario) -> None:
        motion = settling_node.bounce(scenario, impact_speed=IMPACT_SPEED)
        impact, rebound = settling_node.first_contact(motion)
        impulse = integral(motion.normal_forces.sum(axis=1), motion.times)
        assert impulse == pytest.approx(mass(scenario) * (impact + rebound), rel=5e-3)

    def test_nothing_meets_the_ground_before_it_fell(self, scenario: Scenario) -> None:
        motion = settling_node.bounce(scenario, impact_speed=IMPACT_SPEED, duration=1e-4)
        assert all(math.isnan(speed) for speed in settling_node.first_contact(motion))


class TestSlidingTetrahedron:
    def test_breaks_free_at_the_stiction_range_and_sticks_again(
        self, scenario: Scenario, motion
    ) -> None:
        [(start, end)] = sliding_tetrahedron.slips(motion, TOP)
        travel = sliding_tetrahedron.travel(motion, TOP)[motion.times == start]
        np.testing.assert_allclose(travel, scenario.friction.stiction_range, rtol=1e-3)
        assert 0.0 < start < end < 0.6 * motion.times[-1]
        after = motion.times > end
        # It sticks again because it turned round.
        assert motion.v_WN[after, TOP, 0][0] <= 0.0
        assert (motion.modes[after, TOP] == [1.0, 0.0, 0.0]).all()

    def test_trailing_nodes_lift_off_and_land(self, motion) -> None:
        [(start, end)] = sliding_tetrahedron.flights(motion, BOTTOM_LEFT)
        [(_, stuck)] = sliding_tetrahedron.slips(motion, TOP)
        assert start < 1e-3 < end < stuck

    def test_ends_at_rest_with_all_nodes_sticking(self, scenario: Scenario, motion) -> None:
        assert np.abs(motion.v_WN[-1]).max() < 1e-3 * INCH
        np.testing.assert_array_equal(motion.modes[-1], [[1.0, 0.0, 0.0]] * 3)
        assert motion.normal_forces[-1].sum() == pytest.approx(weight(scenario), rel=1e-2)
        np.testing.assert_allclose(motion.friction_forces[-1], 0.0, atol=1e-3 * weight(scenario))

    def test_friction_takes_all_the_momentum(self, scenario: Scenario, motion) -> None:
        impulse = integral(motion.friction_forces.sum(axis=1), motion.times)
        start = mass(scenario) * sliding_tetrahedron.INITIAL_SPEED
        np.testing.assert_allclose(impulse, [-start, 0.0], rtol=1e-2, atol=1e-6 * start)

    def test_goes_straight(self, motion) -> None:
        np.testing.assert_allclose(motion.p_WN[:, TOP, 1], 0.0, atol=1e-9)

    def test_a_slow_one_never_breaks_free(self, scenario: Scenario) -> None:
        motion = sliding_tetrahedron.slide(scenario, speed=3.0 * INCH, duration=0.03)
        assert all(sliding_tetrahedron.slips(motion, node) == [] for node in BASE)
        travel = sliding_tetrahedron.travel(motion, TOP)[-1]
        assert 0.0 < travel < scenario.friction.stiction_range


class TestRobot:
    def test_distances_start_at_the_spacing(self, walk) -> None:
        scenario, _, result = walk
        distances = robot.relative_distances(result.trajectory)
        assert distances.dims == ("time", "tetrahedron")
        spacing = scenario.robot.spacing
        np.testing.assert_allclose(distances[0], spacing * np.arange(5), atol=1e-12)
        assert not distances.sel(tetrahedron="T1").any()
        assert np.ptp(distances.sel(tetrahedron="T2").values) > 0.1 * INCH

    def test_actuated_cables_feel_their_signal(self, walk) -> None:
        scenario, _, result = walk
        trajectory = result.trajectory
        before = trajectory.time < scenario.cpg.start_up
        for junction in trajectory.junction.values:
            signal = trajectory.signal.sel(junction=junction)
            assert not signal[before].any()
            assert signal[~before].any()
            cable = robot.actuated_cable(junction)
            passive = cable.replace("bottom_left", "top")
            swing = [np.ptp(trajectory.tension.sel(cable=c).values) for c in (cable, passive)]
            assert swing[0] > swing[1]

    def test_figure_and_report(self, walk) -> None:
        _, gait, result = walk
        figure = robot.draw(result.trajectory)
        assert len(figure.axes) == 1 + len(result.trajectory.junction)
        assert len(figure.axes[0].lines) == len(result.trajectory.tetrahedron)
        report = robot.report(gait, result)
        assert "short walk" in report
        assert str(thesis.BEST_INITIAL_DISTANCE_IN) in report

    def test_a_missing_gait_file_ends_with_one_line(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with pytest.raises(SystemExit) as ended:
            robot.main(["--gait", str(tmp_path / "none.json"), "--out", str(tmp_path)])
        assert ended.value.code == 2
        assert capsys.readouterr().err.endswith("none.json: no such gait file\n")
        assert list(tmp_path.iterdir()) == []


@needs_dot
@pytest.mark.parametrize("script", QUICK)
def test_script_writes_its_pictures_and_prints_the_thesis_numbers(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = script.__name__
    assert script.main(["--out", str(tmp_path)]) == 0
    written = {path.name: path.stat().st_size for path in tmp_path.iterdir()}
    assert set(written) == {f"{name}.svg", f"{name}.png"}
    assert all(1_000 < size < 150_000 for size in written.values())
    assert "thesis" in capsys.readouterr().out


@needs_dot
@pytest.mark.parametrize("script", QUICK)
def test_script_refuses_a_file_for_a_folder(
    script: ModuleType, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(SystemExit) as ended:
        script.main(["--out", str(file)])
    assert ended.value.code == 2
    assert "cannot be written" in capsys.readouterr().err
