"""What holds for every law of a sort, and that none is missing in the examples."""

import typing

import numpy as np
import pytest
from helpers.actuations import ACTUATIONS
from helpers.laws import EXAMPLES

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
from tetra_drake.laws.height_field import HeightField
from tetra_drake.scenario.scenario import Scenario

CABLE = CableLaw(stiffness=100.0, damping=5.0, free_length=0.2)
WITH_DRIVE = {name: kind for name, kind in ACTUATIONS.items() if not kind.lacking}


@pytest.mark.parametrize("key", EXAMPLES)
def test_every_kind_has_an_example(key):
    kinds = {*typing.get_args(Scenario.model_fields[key].annotation)} - {HeightField}  # has a file
    assert {type(example) for example in EXAMPLES[key].values()} == kinds


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
