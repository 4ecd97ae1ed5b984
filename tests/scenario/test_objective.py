"""The objective, requirements and disturbances of a scenario, as files give them."""

import numpy as np
import pytest
from pytest import approx

from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.settings.section import value_at

DAMPING, RANGE, OTHER = "robot.cables.damping", "friction.stiction_range", "robot.density"
ROUGH = {"terrain": "!Rough {amplitude: 0.1 in, wavelength: 2 in}"}


def among(scenario, spreads, *, start=0.1, **changes):
    """The scenario with disturbances."""
    disturbances = {"draws": 4, "start": start, "spreads": spreads}
    return scenario.with_changes(changes | {"disturbances": disturbances})


def test_a_draw_changes_what_it_names_within_its_spread(scenario):
    spreads = {DAMPING: 0.1, f"{RANGE}, friction.stiction_damping": 0.05}
    spreads |= {"events[0].push.impulse[2]": 0.5, "robot.start.velocity[2]": 0.2}
    push = {"at": "0.1 s", "push": {"impulse": ["0 N*s", "0 N*s", "0.02 N*s"], "on": "T1"}}
    moving = {"robot.start": {"velocity": ["0 m/s", "0 m/s", "2 m/s"]}, "events": [push]}
    scenario = among(scenario, spreads, start=0.02, **moving)
    draws = [draw_disturbances(scenario, (7, k)) for k in range(200)]
    for key, spread in spreads.items():
        factors = np.array([draw.factors[key] for draw in draws])
        assert np.abs(factors - 1.0).max() <= spread
        # Uniform: the extremes of 200 miss the ends by 1 % of the width on average.
        assert np.ptp(factors) > 1.9 * spread
    drawn = np.array([[*draw.factors.values(), *draw.moves[0, :2]] for draw in draws])
    # Each is drawn alone: the bound is 4 standard deviations of independent numbers.
    assert np.abs(np.corrcoef(drawn.T) - np.eye(6)).max() < 0.28
    draw, changed = draws[0], disturbed(scenario, draws[0])
    factors = {key: x for names, x in draw.factors.items() for key in names.split(", ")}
    before, after = (each.model_dump() for each in (scenario, changed))
    for key in {*scenario.numbers(), *factors}:
        expected = value_at(before, key) * factors.get(key, 1.0)
        assert value_at(after, key) == approx(expected, rel=1e-15)
    moves = np.array([draw.moves for draw in draws]) / scenario.robot.spacing
    assert moves.shape == (200, 5, 3)
    assert 0.0195 < np.abs(moves).max() <= 0.02
    assert moves[..., :2].min() < -0.0195
    assert moves[..., 2].min() >= 0.0
    assert np.allclose(changed.robot.offsets, draw.moves)
    assert changed.disturbances is None


OTHERS = {OTHER: 0.1, DAMPING: 0.2, RANGE: 0.1}, {f"{OTHER}, {RANGE}": 0.1, DAMPING: 0.2}


@pytest.mark.parametrize("spreads", OTHERS)
def test_what_else_is_disturbed_changes_no_number_of_a_draw(scenario, spreads):
    first, other = (among(scenario, each, **ROUGH) for each in ({DAMPING: 0.2}, spreads))
    for k in range(5):
        expected, draw = (draw_disturbances(each, (3, 0, 1, k)) for each in (first, other))
        assert draw.factors[DAMPING] == expected.factors[DAMPING]
        assert draw.terrain_seed == expected.terrain_seed
        assert np.array_equal(draw.moves, expected.moves)


def test_joined_keys_have_one_factor_in_any_order(scenario):
    def factor(joined: str) -> float:
        return draw_disturbances(among(scenario, {joined: 0.2}), (3, 1)).factors[joined]

    assert factor(f"{DAMPING}, {RANGE}") == factor(f"{RANGE},{DAMPING}") != factor(DAMPING)
