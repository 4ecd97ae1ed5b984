"""Networks of any grouping, steering and feedback: symmetries and agreement of the engines."""

import dataclasses
import re

import numpy as np
import pytest
import xarray
from helpers.actuations import SIDES
from helpers.converged import CONVERGED, shortly
from helpers.gaits import with_values

from tetra_drake.engines.simulate import simulate
from tetra_drake.laws.feedback import PATHWAYS
from tetra_drake.laws.friction import Coulomb
from tetra_drake.laws.matsuoka import connections, weight_names
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.scenario.engine_kinds import Compiled
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario

BOTH = pytest.mark.parametrize("engine", ["!Drake", "!Compiled"])


def walk(scenario: Scenario, gait: Gait, engine: str | Compiled) -> xarray.Dataset:
    return simulate(scenario.with_changes({"engine": engine}), gait, record=True).trajectory


def mirrored(trajectory: xarray.Dataset) -> np.ndarray:
    """p_WN of the walk's image in the plane y = 0: left nodes are right ones."""
    p_WN = trajectory.p_WN.values
    bodies = p_WN.reshape(len(p_WN), -1, 4, 3)[:, :, [1, 0, 2, 3]]
    return bodies.reshape(p_WN.shape) * [1.0, -1.0, 1.0]


def image(gait: Gait, scenario: Scenario) -> Gait:
    """The gait whose oscillators have changed sides."""
    blueprint = scenario.blueprint()
    pairs = connections(blueprint, scenario.cpg.reach)
    names = weight_names(pairs, range(blueprint.signals)), weight_names(pairs, blueprint.images)
    exchanged = {name: gait.parameters[other] for name, other in zip(*names, strict=True)}
    return with_values(gait, turn=-gait.turn, **exchanged)


@BOTH
def test_two_alike_oscillators_per_junction_walk_as_the_thesis_s_one(scenario, engine):
    # Each of the pair is inhibited by both of another junction, so each by half of the weight,
    # and not by the other of its own: then both sum to what the thesis's oscillator gets.
    thesis = shortly(scenario, 0.5, robot__tetrahedra=2, cpg__signals="listing")
    pairs = thesis.with_changes(SIDES)
    gait = seeded_gait(thesis)
    halves = {}
    for name in pairs.parameters:
        if name.startswith("weight"):
            source, onto = (1 + (int(k) - 1) // 2 for k in re.findall(r"\d+", name))
            of_link = f"weight {source}->{onto} {name.rpartition(' ')[2]}"
            halves[name] = 0.5 * gait.parameters.get(of_link, 0.0)
    taus = {name: gait.parameters[name] for name in ("tau_A", "tau_B")}
    split = dataclasses.replace(gait, parameters=halves | taus)
    one, two = walk(thesis, gait, engine), walk(pairs, split, engine)
    np.testing.assert_allclose(two.signal.values, np.repeat(one.signal.values, 2, 1), atol=1e-12)
    np.testing.assert_allclose(two.p_WN.values, one.p_WN.values, atol=1e-9)
    assert np.ptp(one.signal.values) > 1.0, "it is driven"


@BOTH
@pytest.mark.parametrize("signals", ["listing", "live"])
def test_mirrored_gaits_and_opposite_turns_give_mirrored_walks(engine, signals):
    every = list(PATHWAYS) if signals == "live" else []
    changes = {"cpg__signals": signals, "cpg__feedback": every}
    # A bristle's reset falls into one step or the next by rounding.
    changes |= {"friction__stiffness": "0 N/m", "robot__tetrahedra": 3}
    scenario = shortly(load_scenario("undulation"), 0.3, **changes)
    gait = dataclasses.replace(seeded_gait(scenario, 3), turn=0.4)
    # By default the compiled engine's two walks soon step differently, by rounding.
    engine = CONVERGED["compiled"] if engine == "!Compiled" else engine
    one, other = walk(scenario, gait, engine), walk(scenario, image(gait, scenario), engine)
    np.testing.assert_allclose(mirrored(other), one.p_WN.values, atol=1e-8)
    assert np.abs(one.p_WB.sel(axis="y")).max() > 1e-4, "it goes to a side"


def test_each_feedback_changes_the_signals_and_gains_of_zero_do_not(scenario):
    live = {"cpg__signals": "live", "friction": Coulomb()}
    blind = shortly(scenario, 0.3, **live)
    senses, gait = blind.with_changes({"cpg.feedback": list(PATHWAYS)}), seeded_gait(blind)
    without = walk(blind, gait, "!Compiled").signal.values
    gait = with_values(gait, **{f"gain {pathway}": 0.0 for pathway in PATHWAYS})
    np.testing.assert_array_equal(walk(senses, gait, "!Compiled").signal, without)
    for pathway in PATHWAYS:
        felt = walk(senses, with_values(gait, **{f"gain {pathway}": 1.0}), "!Compiled").signal
        assert np.abs(felt - without).max() > 1e-3, "more than engines may differ by"


def test_a_constant_number_steers_as_the_gaits_turn_does():
    short = shortly(load_scenario("turning"), 0.4, engine="!Compiled")
    gait = dataclasses.replace(seeded_gait(short), turn=0.0)
    turned = simulate(scenario=short, gait=dataclasses.replace(gait, turn=0.5))
    for turn in (0.5, np.float64(0.5)):
        assert simulate(scenario=short, gait=gait, steering=turn).metrics == turned.metrics
