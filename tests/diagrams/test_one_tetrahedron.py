"""A tetrahedron alone on the ground: settling_node.py and sliding_tetrahedron.py."""

import numpy as np
import pytest
from one_tetrahedron import BASE, LEADING, TRAILING
from sliding_tetrahedron import flights, slide, slips, travel

from tetra_drake.scenario.load import load_scenario
from tetra_drake.settings.units import INCH

STICKS = [1.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def sliding():
    return slide(load_scenario("thesis-reversal"))


def test_it_breaks_free_at_the_stiction_range_and_sticks_again(scenario, sliding):
    [(start, end)] = slips(sliding, LEADING)
    way = travel(sliding, LEADING)[sliding.times == start]
    np.testing.assert_allclose(way, scenario.friction.stiction_range, rtol=1e-3)
    assert 0.0 < start < end < 0.6 * sliding.times[-1]
    after = sliding.times > end
    assert sliding.v_WN[after, LEADING, 0][0] <= 0.0  # it has turned round
    assert (sliding.modes[after, LEADING] == STICKS).all()
    [(lifted, landed)] = flights(sliding, TRAILING)
    assert lifted < 1e-3 < landed < end
    slow = slide(load_scenario("thesis-reversal"), speed=3.0 * INCH, duration=0.03)
    assert all(slips(slow, node) == [] for node in BASE)
    assert 0.0 < travel(slow, LEADING)[-1] < scenario.friction.stiction_range
