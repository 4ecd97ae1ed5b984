"""Bodies that evolve with their gaits: what is searched, refused, recorded, simulated again."""

import json
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers import quick_figures
from helpers.analytic import evaluated, optimise, tasks_of
from helpers.anchored import HUNG, scenario_of
from helpers.brief import BRIEF

from tetra_drake.engines.simulate import simulate
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.evaluators import in_lanes
from tetra_drake.evolution.trials import BEST_SCENARIO
from tetra_drake.experiment import evolve
from tetra_drake.lab.study.robustness import robustness
from tetra_drake.lab.study.sweep import sweep
from tetra_drake.optimizers import optimizer_of
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.gait_file import load_gait
from tetra_drake.robot.parameter_space import ParameterSpace, seeded_gait, with_body
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.optimizer_kinds import CmaEs, QualityDiversity, RandomSearch, SteadyState

SIDE, UPPER = "robot.cables.side.stiffness", "robot.nodes.n3[2], robot.nodes.n4[2]"
BODY = {SIDE: ["50 N/m", "0.4 kN/m"], "friction.kinetic": [0.4, 0.5], UPPER: ["15 cm", "17 cm"]}
DRAWN = {"disturbances": {"draws": 2, "spreads": {SIDE: 0.2}}}
LEARNING = [SteadyState(population=8), CmaEs(sample=8)]
ALL = [*LEARNING, RandomSearch(), QualityDiversity()]


@pytest.fixture(scope="module")
def prism():
    return load_scenario("prism").with_changes(BRIEF | {"cpg.start_up": 0, "evolve": BODY})


@pytest.fixture(scope="module")
def run(prism, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tetra_drake.report.run_page.draw_pictures", quick_figures.draw_none)
        patch.setattr("tetra_drake.evolution.reevaluation.BEST_GAITS", 2)
        patch.setattr("tetra_drake.lab.spread.record_spread", lambda *_, **__: None)
        out = tmp_path_factory.mktemp("run") / "it"
        return evolve(prism, out, executor=ThreadPoolExecutor, workers=1)


@pytest.mark.parametrize("kind", LEARNING)
def test_a_stiffness_is_found_whose_best_is_known(tmp_path, kind):
    """A bar hangs its weight over the stiffness below the free length of its cable."""
    changes = {"cpg.start_up": "1 s", "simulation.steady_from": "0.01 s", "optimizer": kind}
    changes |= {"evolve": {"robot.cables.line.stiffness": ["50 N/m", "400 N/m"]}}
    changes |= {"evolution.trials": 1, "evolution.evaluations": 50, "engine": "!Compiled"}
    scenario = scenario_of(HUNG | {"actuated": {"one": ["line top a"]}}, 0.02)
    at_rest = simulate(scenario, seeded_gait(scenario)).path.centre[-1, 2]
    height = at_rest + Robot.of(scenario).weight * (1.0 / 200.0 - 1.0 / 137.0)

    def nearness(result):
        return -abs(result.path.centre[-1, 2] - height)

    options = {"objective": nearness, "reevaluate": False, "report": False}
    ((_, found),) = evolve(scenario.with_changes(changes), tmp_path, **options).best_gait().body
    assert float(found.removesuffix(" N/m")) == pytest.approx(137.0, rel=0.03)


@pytest.mark.parametrize("kind", ALL)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_vectors_stay_within_the_bounds_of_a_body_and_come_near_them(prism, kind, sign):
    space = ParameterSpace.of(prism)
    body = space.body
    assert space.names[body] == tuple(BODY)

    def share(vector):
        return float(((vector - space.low) / (space.high - space.low))[body].mean())

    def judged(vector):
        return Evaluation(2.0 + sign * share(vector), {"travelling_index": 0.5, "lifted": 0.5})

    optimizer = optimizer_of(kind)(space, prism.evolution, np.random.default_rng(4))
    vectors = np.concatenate(optimise(optimizer, judged, 400)[0])
    assert ((space.low <= vectors) & (vectors <= space.high))[:, body].all()
    best = max(vectors, key=lambda vector: sign * share(vector))
    assert abs(share(best) - 0.5 - 0.5 * sign) < (0.25 if kind == RandomSearch() else 0.1)
    assert np.array_equal(space.vector(space.gait(best, name="best")), best)


def test_a_gait_has_its_body_wherever_it_is_simulated(prism, run):
    gait, folder = run.best_gait(), run.directory / "trial_00"
    own, bare = with_body(prism, gait)
    assert own == load_scenario(folder / BEST_SCENARIO) and (own.evolve, bare.body) == ({}, ())
    assert gait == load_gait(folder / "best_gait.json", prism) != bare
    fitness = simulate(own, bare).fitness
    assert fitness == simulate(run, gait).fitness == run.fittest()["fitness"]
    assert run.reevaluations["fitness"].max() == pytest.approx(fitness, abs=0.01)
    changes = {"robot.cables.top.stiffness": ["150 N/m"]}
    swept = sweep(prism, [seeded_gait(own), gait], changes).fitness.to_numpy()[0]
    assert swept[1] == sweep(own, bare, changes).fitness.item() != swept[0]
    pairs = (prism.with_changes(DRAWN), gait), (own.with_changes(DRAWN), bare)
    judged = [robustness(s, {0: g}, draws=2, alone=False).draws for s, g in pairs]
    assert judged[0].equals(judged[1])
    assert f'href="trial_00/{BEST_SCENARIO}"' in (run.directory / "report.html").read_text()


def test_disturbances_change_the_evolved_body(prism):
    drawn = prism.with_changes(DRAWN)
    space = ParameterSpace.of(drawn)
    vector = space.random(np.random.default_rng(2))
    own, _ = with_body(drawn, space.gait(vector, name="it"))
    expected = GaitEvaluation(own)(*tasks_of([np.delete(vector, space.body)], (1, 2, 3)))
    with in_lanes(pickle.loads(pickle.dumps(GaitEvaluation(drawn))), 1) as submit:
        found = evaluated(submit, tasks_of([vector], (1, 2, 3)))[0]
    assert found.draws == expected.draws and len({*found.draws["fitness"]}) == 2


IMPOSSIBLE = yaml.safe_load(Path(__file__).with_name("bodies.yaml").read_text("utf-8"))


@pytest.mark.parametrize("seed", [None, (1, 2, 3)])
@pytest.mark.parametrize(("bounds", "reason"), IMPOSSIBLE)
def test_a_body_that_cannot_be_fails_with_a_reason(prism, bounds, reason, seed):
    bounds = {"evolve": {f"robot.{key}": pair for key, pair in bounds.items()}}
    loads = {"robot.loads": {"n3": ["0 N", "0 N", "0 N"]}}
    scenario = prism.with_changes({"disturbances": {"draws": 2}} | loads | bounds)
    space = ParameterSpace.of(scenario)
    vector = space.random(np.random.default_rng(2))
    vector[space.body] = space.high[space.body]
    failure = GaitEvaluation(scenario)(*tasks_of([vector], seed)).failure
    assert "no start" in failure and reason in failure, failure
    with in_lanes(GaitEvaluation(scenario), 1) as submit:
        assert evaluated(submit, tasks_of([vector], seed))[0].failure == failure


def test_a_gait_file_with_a_wrong_body_is_refused(tmp_path, prism, run, refused):
    content = json.loads((run.directory / "trial_00/best_gait.json").read_text())
    file = tmp_path / "gait.json"
    for key, value in ((SIDE, "-5 N/m"), (SIDE, "3 s"), ("robot.density", "3 kg/m^3")):
        file.write_text(json.dumps(content | {"body": {key: value}}))
        with refused(file, f"body.{key}", ""):
            load_gait(file, prism)
