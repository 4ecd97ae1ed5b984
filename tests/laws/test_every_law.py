"""What holds for every law of a sort, and that none is missing in the examples."""

import itertools
import typing

import numpy as np
import pytest
from helpers.actuations import ACTUATIONS
from helpers.laws import EXAMPLES, FRICTIONS

from tetra_drake.laws import friction
from tetra_drake.laws.actuator import (
    BESIDE,
    DRIVE,
    DRIVE_COLUMNS,
    LIMITED,
    DrivenCables,
    actuator_force,
    exertion,
)
from tetra_drake.laws.cable import CableLaw
from tetra_drake.laws.friction import Slide, TangentSlide
from tetra_drake.laws.height_field import HeightField
from tetra_drake.scenario.scenario import Scenario

CABLE = CableLaw(stiffness=100.0, damping=5.0, free_length=0.2)
WITH_DRIVE = {name: kind for name, kind in ACTUATIONS.items() if not kind.lacking}


@pytest.mark.parametrize("key", EXAMPLES)
def test_every_kind_has_an_example(key):
    kinds = {*typing.get_args(Scenario.model_fields[key].annotation)} - {HeightField}  # has a file
    assert {type(example) for example in EXAMPLES[key].values()} == kinds


def slides() -> list[Slide]:
    """Motions in stick and slip, to and fro, as NumPy's numbers: they may be divided by zero."""
    numbers = itertools.product((-0.02, 1e-3), (0.0, 5e-5), (0.0, 1.0), (0.5, 3.0))
    found = []
    for velocity, deflection, mode, load in numbers:
        t1 = TangentSlide(*np.array([velocity, deflection, mode]))
        t2 = TangentSlide(*np.array([0.3 * velocity, -deflection, 0.0]))
        found.append(Slide(t1, t2, (1.0, 0.0), np.float64(load)))
    return found


@pytest.mark.parametrize("law", [kind.law() for kind in FRICTIONS.values()], ids=FRICTIONS)
def test_friction_takes_energy_where_no_bristle_gives_it_and_its_modes_follow(law):
    for slide in slides():
        velocity = np.array([slide.t1.velocity, slide.t2.velocity])
        if slide.t1.deflection == 0.0 and velocity[0] * slide.t1.mode >= 0.0:
            assert np.array(friction.friction_force(law, slide)) @ velocity <= 0.0
        a, b, c = friction.friction_damping(law, slide, 1e-3)
        assert np.linalg.eigvalsh([[a, b], [b, c]]).min() >= -1e-12
        with np.errstate(invalid="ignore"):
            after = friction.next_mode(law, slide)
        assert np.abs(after.mode).max() <= 1.0
        assert 0.0 < friction.time_to_friction_change(law, slide, (1.0, 0.5), 10.0, 0.1) <= 0.1


@pytest.mark.parametrize("kind", WITH_DRIVE.values(), ids=WITH_DRIVE)
def test_actuators_bear_what_the_cable_does_not_and_follow_their_commands(kind):
    law, actuator = CableLaw(*np.array([[x] for x in CABLE[:-1]])), kind.actuator()
    for length in (0.15, 0.25):
        cables = DrivenCables.at_rest(law, np.array([length]), np.zeros(1))
        drive = float(kind.drives(cables)[0])
        still, pulls = (
            actuator_force(actuator, drive, length, 0.0, signal, CABLE) for signal in (0.0, 8.0)
        )
        assert still.tension == pytest.approx(cables.tension[0]) and still.rate == 0.0
        assert pulls.rate != 0.0 and 0.0 <= pulls.beside <= pulls.tension
        drives = np.zeros((1, DRIVE_COLUMNS))
        drives[0, [DRIVE, LIMITED, BESIDE]] = drive, pulls.limited, pulls.beside
        own = exertion(actuator, drives, 0, pulls.tension, length, 8.0)
        assert own.load == own.pull == pulls.tension - pulls.beside
