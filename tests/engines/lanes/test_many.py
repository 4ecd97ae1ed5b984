"""Many gaits at a time on the compiled engine: each as if it were alone."""

import dataclasses
import threading
import time
from concurrent.futures import CancelledError
from typing import Any

import pytest
from helpers.actuations import SIDES
from helpers.anchored import HUNG, scenario_of
from helpers.brief import BRIEF
from helpers.outcomes import assert_same

from tetra_drake.engines.lanes.batch import LaneBatch, processor_lanes
from tetra_drake.engines.queue import SimulationQueue
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.errors import (
    Diverged,
    StepBudgetExceeded,
    TimeBudgetExceeded,
)
from tetra_drake.laws.actuator import TensionMotor, Winch
from tetra_drake.laws.capsules import HuntCrossley
from tetra_drake.laws.feedback import PATHWAYS
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.terrain import Rough
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

FAR_TOO_STRONG = {"cpg.gain": "4e9 N"}
"""A pull that throws the robot about at the first step."""

TOO_STRONG = {"cpg.gain": "300.0 N", "simulation.max_evaluations": 20_000}
"""One that winds it up until steps are tiny."""

ROUGH = {"robot.contacts": "all", "friction": Coulomb()}
ROUGH |= {"terrain": Rough(amplitude=2e-3, wavelength=0.1)}
FINER = ROUGH | {"terrain": Rough(amplitude=3e-3, wavelength=0.05, seed=1)}
FINER |= {"friction": Coulomb(static=0.6, kinetic=0.3, stiffness=900.0)}
TOUCHING = {"strut_contact": HuntCrossley(stiffness=1e4, dissipation=1.0)}
TOUCHING |= {"robot.strut_diameter": "13 mm", "cpg.gain": "10 lbf"}
SOFT = TOUCHING | {"strut_contact": HuntCrossley(stiffness=3e3, dissipation=0.0)}
THINNER = TOUCHING | {"robot.strut_diameter": "12 mm"}
LIMITS = [(70.0, 0.5, 0.02), (5.0, 0.1, 0.1), (4.0, 0.3, 0.5e-3)]
"""Force (N), speed (m/s) and time constant (s) of actuators."""

GOES, FAILS, ENDS = SimulationResult, Diverged, StepBudgetExceeded
NEIGHBOURS = {
    "strength": [({}, GOES), (FAR_TOO_STRONG, FAILS), ({}, GOES), (TOO_STRONG, ENDS)],
    # They touch, each by a law of its own.
    "struts": [(THINNER, GOES), (TOUCHING, GOES), (SOFT, GOES)],
    # Each lane has a grid of its own size, and constants of its own.
    "ground": [(FINER, GOES), (ROUGH, GOES), (ROUGH | FAR_TOO_STRONG, FAILS)],
}
for kind in (Winch, TensionMotor):
    actuators = (kind(max_force=f, max_speed=v, time_constant=tau) for f, v, tau in LIMITS)
    NEIGHBOURS[kind.__name__] = [({"actuation": each}, GOES) for each in actuators]
"""Changes of scenarios that walk side by side, and how they end."""


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """One second on the compiled engine, driven from 0.2 s on."""
    times = {"simulation.duration": "1.0 s", "simulation.steady_from": "0.5 s"}
    return scenario.with_changes({"engine": "!Compiled", "cpg.start_up": "0.2 s", **times})


@pytest.mark.parametrize("name", NEIGHBOURS)
def test_a_gait_walks_alike_in_any_lane_in_any_order_beside_any_neighbours(short, name):
    changes, kinds = zip(*NEIGHBOURS[name], strict=True)
    scenarios = [short.with_changes(changes[i % len(changes)]) for i in range(11)]
    gaits = [seeded_gait(scenario, seed) for seed, scenario in enumerate(scenarios)]
    walks = [*zip(scenarios, gaits, strict=True)]
    alone = [simulate_many([scenario], [gait], record=True)[0] for scenario, gait in walks]
    assert tuple(map(type, alone[: len(changes)])) == kinds
    assert len({repr(getattr(each, "metrics", each)) for each in alone}) == 11, "all of them differ"
    for step in (1, -1):
        found = simulate_many(scenarios[::step], gaits[::step], record=True, workers=1)
        for ours, theirs in zip(found, alone[::step], strict=True):
            assert_same(ours, theirs)


LOSSES = [{"at": "0.2 s", "cut": ["T1-T2 outer top"]}, {"at": "0.2 s", "lose": ["T2", "T5"]}]


def scenarios_of_their_own(short: Scenario) -> list[Scenario]:
    """Rows of tetrahedra and structures, some of which walk side by side."""
    senses = SIDES | {"cpg.signals": "live", "cpg.feedback": list(PATHWAYS)}
    changes = [
        {},
        {"robot.cables.outer_stiffness": "0.21 lbf/in"},
        {"robot.offsets": [[f"{i} mm", 0.0, "1 mm"] for i in range(5)]},
        {"simulation.duration": "0.8 s", "engine.tolerance": "5e-5 m/s"},
        {"robot.tetrahedra": 3},
        senses,
        senses | {"cpg.gain": "1 lbf"},
        {"robot.cables.slack": True, "cpg.listing_step": "0.1 ms"},
        {"robot.gravity": "1.6 m/s^2", "ground.stiffness": "20 lbf/in"},
        {"engine": "!Drake", "robot.tetrahedra": 2},
        *({"events": events, "robot.payload": ["9 g"] * 5} for events in ([], LOSSES)),
    ]
    scenarios = [short.with_changes(each) for each in changes]
    hung = scenario_of(HUNG | {"loads": {"b": [0.1, 0.0, 0.0]}}, duration=1.0)
    for force, x in ((0.1, 0.0), (0.2, 0.001)):
        places = {"robot.loads.b[0]": f"{force} N", "robot.nodes.top[0]": f"{x} m"}
        scenarios += [hung.with_changes(places)]
    linear = load_scenario("prism").with_changes(BRIEF | {"policy": "!Linear"})
    scenarios += [linear, linear.with_numbers({"cpg.gain": 0.5 * linear.cpg.gain})]
    for name in ("mast", "pair"):
        scenario = load_scenario(name).with_changes({"simulation.duration": "2 s"})
        spreads = {f"robot.cables.{group}.stiffness": 0.2 for group in scenario.robot.cables}
        settings = Disturbances(draws=1, start=0.05, spreads=spreads)
        scenario = scenario.with_sections(disturbances=settings)
        scenarios += [disturbed(scenario, draw) for draw in fresh_draws(scenario, 1, 2)]
    return scenarios


def test_every_gait_may_have_a_scenario_of_its_own(short):
    scenarios = scenarios_of_their_own(short)
    gaits = [seeded_gait(each, i) for i, each in enumerate(scenarios)]
    alone = [simulate(s, g, record=True) for s, g in zip(scenarios, gaits, strict=True)]
    assert len({each.metrics.distance for each in alone}) == len(alone), "all of them differ"
    for workers in (1, 3):
        found = simulate_many(scenario=scenarios, gaits=gaits, record=True, workers=workers)
        for ours, theirs in zip(found, alone, strict=True):
            assert_same(ours, theirs)


def test_robots_that_differ_in_numbers_alone_share_a_batch(short):
    """Else disturbed robots would walk one after another. Where tables are indexed otherwise, a
    robot needs a batch of its own."""

    def walk(changes: dict[str, Any]) -> DrivenRobot:
        scenario = short.with_changes(changes)
        return DrivenRobot.of(Robot.of(scenario), seeded_gait(scenario))

    batch = LaneBatch(walk({}), places=processor_lanes())
    stiff = {"robot.cables.outer_stiffness": "0.21 lbf/in", "robot.cables.damping": "0.04 lbf*s/in"}
    wide = {"robot.spacing": "3 in", "ground.stiffness": "20 lbf/in"}
    moved = {"robot.offsets": [[f"{i} mm", 0.0, "1 mm"] for i in range(5)]}
    for change in (stiff, wide, moved):
        assert batch.begin(1, walk(change)), change
    others = {"robot.tetrahedra": 3, "robot.cables.slack": True, "robot.contacts": "all"} | SIDES
    for key, value in others.items():
        assert not batch.begin(1, walk({key: value})), key


def test_a_gait_that_is_refused_leaves_the_lanes_as_they_are(short):
    gait = seeded_gait(short)
    with SimulationQueue(1) as queue:
        fit, misfit = (short, gait), (short, dataclasses.replace(gait, parameters={"tau_A": 1.0}))
        futures = queue.submit([fit, misfit, fit, misfit, misfit, fit])
        assert [future.exception() is None for future in futures] == [1, 0, 1, 0, 0, 1]
    assert simulate_many(scenario=short, gaits=[]) == []


def test_a_gait_that_takes_too_long_leaves_its_lane_to_others(short):
    gait, endless = seeded_gait(short), short.with_changes({"simulation.duration": "1 h"})
    with SimulationQueue(1) as queue:
        with pytest.raises(TimeBudgetExceeded):
            queue.submit([(endless, gait)], time_budget=0.05)[0].result()
        found = queue.submit([(short, gait)])[0].result()
    assert found.metrics == simulate(scenario=short, gait=gait).metrics


def test_an_error_of_the_engine_reaches_those_who_wait(short, monkeypatch):
    def fail(self, **options):
        raise MemoryError

    gait = seeded_gait(short)
    with SimulationQueue(1) as queue:
        with monkeypatch.context() as patch:
            patch.setattr(LaneBatch, "advance", fail)
            futures = queue.submit([(short, gait)] * 12)
            assert all(isinstance(future.exception(), MemoryError) for future in futures)
        (future,) = queue.submit([(short, gait)])
        assert future.result().metrics.distance != 0.0


def test_the_end_of_a_queue_cancels_what_is_under_way(short):
    endless = short.with_changes({"simulation.duration": "1 h"})
    before = threading.active_count()
    with SimulationQueue(2) as queue:
        futures = queue.submit([(endless, seeded_gait(endless))] * 40)
        time.sleep(0.1)  # some are under way, some wait
    assert threading.active_count() == before
    assert all(isinstance(future.exception(), CancelledError) for future in futures)
