"""Many gaits at a time on the compiled engine: each as if it were alone."""

import dataclasses
import threading
import time
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any

import pytest
import yaml
from helpers.actuations import SIDES
from helpers.anchored import HUNG, scenario_of
from helpers.brief import BRIEF
from helpers.outcomes import assert_same

from tetra_drake.engines.lanes.batch import LaneBatch, processor_lanes
from tetra_drake.engines.queue import SimulationQueue
from tetra_drake.engines.simulate import simulate, simulate_many
from tetra_drake.errors import (
    TimeBudgetExceeded,
)
from tetra_drake.laws.feedback import PATHWAYS
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.robot import Robot
from tetra_drake.robot.signals import DrivenRobot
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

BESIDE, APART = yaml.safe_load(
    Path(__file__).with_name("neighbours.yaml").read_text("utf-8")
).values()
"""Changes of scenarios, by groups with the ends of walks, and of robots that may need a batch of
their own."""


@pytest.fixture
def short(scenario: Scenario) -> Scenario:
    """One second on the compiled engine, driven from 0.2 s on."""
    times = {"simulation.duration": "1.0 s", "simulation.steady_from": "0.5 s"}
    return scenario.with_changes({"engine": "!Compiled", "cpg.start_up": "0.2 s", **times})


@pytest.mark.parametrize("name", BESIDE)
def test_a_gait_walks_alike_in_any_lane_in_any_order_beside_any_neighbours(short, name):
    changes, ends = zip(*BESIDE[name], strict=True)
    scenarios = [short.with_changes(changes[i % len(changes)]) for i in range(11)]
    gaits = [seeded_gait(scenario, seed) for seed, scenario in enumerate(scenarios)]
    walks = [*zip(scenarios, gaits, strict=True)]
    alone = [simulate_many([scenario], [gait], record=True)[0] for scenario, gait in walks]
    assert [type(each).__name__ for each in alone[: len(changes)]] == [*ends]
    assert len({repr(getattr(each, "metrics", each)) for each in alone}) == 11, "all of them differ"
    for step in (1, -1):
        found = simulate_many(scenarios[::step], gaits[::step], record=True, workers=1)
        for ours, theirs in zip(found, alone[::step], strict=True):
            assert_same(ours, theirs)


def scenarios_of_their_own(short: Scenario) -> list[Scenario]:
    """Rows of tetrahedra and structures, some of which walk side by side."""
    senses = SIDES | {"cpg.signals": "live", "cpg.feedback": list(PATHWAYS)}
    changes = [*APART, senses, senses | {"cpg.gain": "1 lbf"}]
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
