"""The Matsuoka network: Eq. 7 by hand, its fixed point, and the order of its two integrators.

Its agreement with the thesis's listing is tested in tests/robot/test_signals.py.
"""

import functools

import numpy as np
import pytest

from tetra_drake.kernels.packed import Packed
from tetra_drake.laws.matsuoka import Matsuoka, Network
from tetra_drake.laws.oscillator import (
    VALUE,
    Oscillators,
    correct_states,
    euler_step,
    make_states,
    write_outputs,
)

# While both neurons of this oscillator fire, Eq. 7 is linear, without kinks. Halving the step then
# divides the error of a method by 2^order.
NETWORK = Network.of([[0.0, 0.4], [0.4, 0.0]], tau_a=0.3, tau_b=0.6, self_inhibition_weight=2.5)


START = np.array([0.3, 0.25, 0.1, 0.12])
"""u of both neurons, then v."""
LINEAR = Oscillators(Matsuoka.own, NETWORK, START, gains=np.zeros(3))


def last_output(steps: int, *, listing: bool) -> np.ndarray:
    output = np.empty((steps if listing else steps + 1, 1))
    inputs = np.full((1, 2), 0.5)
    write_outputs(Packed((LINEAR, make_states(LINEAR))), inputs, 0.2 / steps, listing, output)
    return output[-1]


by_listing = functools.partial(last_output, listing=True)
by_runge_kutta = functools.partial(last_output, listing=False)


def by_heun(steps: int) -> np.ndarray:
    """Refuses each step once, and goes back to its start."""
    states, inputs = make_states(LINEAR), np.full(2, 0.5)
    for _ in range(steps):
        for accepted in (False, True):
            euler_step(LINEAR, inputs, 0.2 / steps, states)
            correct_states(LINEAR, inputs, 0.2 / steps, accepted, states)
    return states[:, VALUE]


@pytest.mark.parametrize(
    ("at_the_end", "steps", "order"), [(by_listing, 4, 1), (by_runge_kutta, 4, 4), (by_heun, 8, 2)]
)
def test_integrators_have_their_order(at_the_end, steps, order):
    exact = at_the_end(4096)
    coarse, fine = (np.abs(at_the_end(n) - exact).max() for n in (steps, 2 * steps))
    assert coarse / fine == pytest.approx(2.0**order, rel=0.15)
