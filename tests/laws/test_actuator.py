"""The laws of winches and tension motors: their limits, and what a cable is to integrators."""

import numpy as np
import pytest

from tetra_drake.laws.actuator import ActuatorForce, Limits, Winch, motor_force, winch_force
from tetra_drake.laws.cable import CableLaw

CABLE = CableLaw(stiffness=100.0, damping=5.0, free_length=0.2)
"""In N/m, N s/m and m."""

WINCH = Limits(max_force=20.0, max_speed=0.4, time_constant=0.05, least_length=0.05)

MOTOR = Limits(max_force=20.0, max_speed=0.4, time_constant=0.05, least_length=0.0)


def wind(
    drive: float, length: float, *, rate: float = 0.0, signal: float = 0.0, limits: Limits = WINCH
) -> ActuatorForce:
    return winch_force(drive, length, rate, signal, CABLE, limits)


def pull(drive: float, length: float, *, rate: float = 0.0, signal: float = 0.0) -> ActuatorForce:
    return motor_force(drive, length, rate, signal, CABLE, MOTOR)


def random_pulls(count: int = 2000) -> list[tuple[float, float, float, float]]:
    """Drive (m), length (m), rate (m/s) and signal (N)."""
    generator = np.random.default_rng(0)
    low, high = [0.04, 0.1, -1.0, -30.0], [0.3, 0.6, 1.0, 30.0]
    return [tuple(each) for each in generator.uniform(low, high, (count, 4)).tolist()]


def test_tension_and_winding_satisfy_both_of_their_equations():
    limits, seen = WINCH, set()
    for drive, length, rate, signal in random_pulls():
        found = wind(drive, length, rate=rate, signal=signal)
        elastic = max(0.0, 100.0 * (length - drive))
        damped = 100.0 * (length - drive) + 5.0 * (rate - found.rate)
        assert found.tension == pytest.approx(np.clip(damped, 0.0, 2.0 * elastic), abs=1e-12)
        fastest = -limits.max_speed * (1.0 - found.tension / limits.max_force)
        command = max(0.2 - signal / 100.0, limits.least_length)
        wanted = min((command - drive) / limits.time_constant, limits.max_speed)
        assert found.rate == pytest.approx(max(wanted, fastest), abs=1e-12)
        unlimited = (0.2 - signal / 100.0 - drive) / limits.time_constant
        assert found.limited == (abs(found.rate - unlimited) > 1e-12)
        seen.add((found.tension > 0.0, wanted > fastest, wanted == limits.max_speed, fastest > 0))
    assert len(seen) >= 6, "regimes"


def test_the_slope_is_the_derivative_of_the_tension_by_the_rate():
    step, slopes = 1e-6, set()
    for drive, length, rate, signal in random_pulls():
        for law, state in ((wind, drive), (pull, 60.0 * drive)):
            below, at, above = (
                law(state, length, rate=rate + shift, signal=signal) for shift in (-step, 0.0, step)
            )
            if below.tension_per_rate == above.tension_per_rate:  # else a regime ends here
                derivative = (above.tension - below.tension) / (2.0 * step)
                assert at.tension_per_rate == pytest.approx(derivative, abs=1e-6)
                slopes.add(at.tension_per_rate)
    # Slack or limited; a free winch; one on the line; a motor on its line: 20 N / (0.4 m/s).
    assert sorted(slopes) == pytest.approx([0.0, 5.0 / 1.1, 5.0, 50.0])


# Commanded: 100 (0.23 - 0.2) + 5 * 0.1 + 1.5 = 5 N; it has 4.5 N: 0.5 N / 50 ms.
BY_HAND = [(4.5, 0.23, 0.1, 1.5, 10.0, 0.0)]
# Commanded: 100 (0.1 - 0.2) = -10 N, so that it goes to 0: it never pushes.
BY_HAND += [(2.0, 0.1, 0.0, 0.0, -2.0 / 0.05, 0.0), (0.0, 0.1, 0.0, 0.0, 0.0, 0.0)]
# Commanded: 40 N, of which it pulls 20 N at most.
BY_HAND += [(19.0, 0.6, 0.0, 0.0, 1.0 / 0.05, 1.0), (20.0, 0.6, 0.3, 0.0, 0.0, 1.0)]


@pytest.mark.parametrize(("drive", "length", "rate", "signal", "winding", "limited"), BY_HAND)
def test_a_tension_motor_by_hand(drive, length, rate, signal, winding, limited):
    found = pull(drive, length, rate=rate, signal=signal)
    assert found == pytest.approx((drive, 0.0, winding, limited, 0.0))


@pytest.mark.parametrize(("rate", "most"), [(-0.1, 15.0), (-0.3, 5.0), (-0.4, 0.0), (-0.7, 0.0)])
def test_a_tension_motor_pulls_less_the_faster_it_winds(rate, most):
    assert pull(16.0, 0.4, rate=rate).tension == pytest.approx(most)
    assert pull(16.0, 0.4, rate=rate).limited == 1.0
    assert pull(0.5 * most, 0.3, rate=rate).tension == pytest.approx(0.5 * most)


def test_a_motor_gives_what_its_data_sheet_says():
    # 1.5 N m and 59 / min on a spool of 10 mm: 150 N, 2 pi 59 / 60 s * 10 mm = 61.8 mm/s.
    winch = Winch(motor="AX-12A", spool="10 mm")
    assert winch.max_force == pytest.approx(150.0)
    assert winch.max_speed == pytest.approx(0.0617847, rel=1e-5)
    assert Winch(**winch.model_dump()) == winch
