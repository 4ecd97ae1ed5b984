"""The objective, requirements and disturbances of a scenario, as files give them."""

import numpy as np
import pytest
from pytest import approx

from tetra_drake.scenario.disturbances import disturbed, draw_disturbances
from tetra_drake.scenario.load import dump_scenario, load_scenario

IN = 0.0254


@pytest.mark.parametrize(
    ("text", "objective", "require"),
    [
        ("objective: {speed: 2 s/in, twist: -1 1/in}", {"speed": 2 / IN, "twist": -1 / IN}, {}),
        (
            "objective: {lead: 1 /m}\nrequire: {twist: 0.5 in, speed: -1 mm/s}",
            {"lead": 1.0},
            {"twist": 0.5 * IN, "speed": -1e-3},
        ),
    ],
)
def test_objective_and_requirements_have_units_and_replace_the_base(
    load_text, tmp_path, text, objective, require
):
    scenario = load_text(text)
    assert scenario.objective == approx(objective, rel=1e-14)
    assert scenario.require == approx(require, rel=1e-14)
    (tmp_path / "full.yaml").write_text(dump_scenario(scenario))
    assert load_scenario(tmp_path / "full.yaml") == scenario


SPREADS = """
disturbances:
  draws: 4
  spreads: {robot.cables.damping: 0.1, "friction.stiction_range, friction.stiction_damping": 0.05}
  start: 0.02
"""


def test_a_draw_changes_what_it_names_within_its_spread(load_text):
    scenario = load_text(SPREADS)
    draws = [draw_disturbances(scenario, (7, k)) for k in range(200)]
    joined = "friction.stiction_range, friction.stiction_damping"
    for key, spread in (("robot.cables.damping", 0.1), (joined, 0.05)):
        factors = np.array([draw.factors[key] for draw in draws])
        assert np.abs(factors - 1.0).max() <= spread
        # Uniform: the extremes of 200 miss the ends by 1 % of the width on average.
        assert np.ptp(factors) > 1.9 * spread
    draw, changed = draws[0], disturbed(scenario, draws[0])
    ours, theirs = changed.friction, scenario.friction
    damping = draw.factors["robot.cables.damping"] * scenario.robot.cables.damping
    assert changed.robot.cables.damping == damping
    ratio = draw.factors[joined]
    assert ours.stiction_range == approx(ratio * theirs.stiction_range, rel=1e-15)
    assert ours.stiction_damping == approx(ratio * theirs.stiction_damping, rel=1e-15)
    assert ours.stiction_switch == theirs.stiction_switch
    moves = np.array([draw.moves for draw in draws]) / scenario.robot.spacing
    assert moves.shape == (200, 5, 3)
    assert 0.0195 < np.abs(moves).max() <= 0.02
    assert moves[..., :2].min() < -0.0195
    assert moves[..., 2].min() >= 0.0
    assert np.allclose(changed.robot.offsets, draw.moves)
    assert changed.disturbances is None


def test_every_draw_has_another_terrain(load_text):
    text = "terrain: !Rough {amplitude: 0.1 in, wavelength: 2 in}\ndisturbances: {draws: 2}"
    scenario = load_text(text)
    seeds = {disturbed(scenario, draw_disturbances(scenario, (k,))).terrain.seed for k in range(9)}
    assert len(seeds) == 9
    assert scenario.terrain.seed == 0
