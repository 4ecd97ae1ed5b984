"""Random wrong inputs: each is used, or refused in one line.

`INPUTS=3000 SEED=1 python -m pytest -m slow -s tests/test_random_inputs.py` prints a table.
"""

import contextlib
import copy
import functools
import io
import json
import math
import os
import random
import re
import time
import traceback
from collections import Counter
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.brief import BRIEF
from helpers.files import DATA
from helpers.policies import Given
from pydrake.common import RandomGenerator

import tetra_drake as td
from tetra_drake.cli import main
from tetra_drake.engines.drake import MakeDisturbedSimulator, MakeSimulator
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.lab.bridges.conversion import converted
from tetra_drake.lab.gym.environments import TensegrityVectorEnv
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.systems.diagram import MakeTensegrityDiagram

INPUTS, SEED, LONGEST = int(os.environ.get("INPUTS", "600")), int(os.environ.get("SEED", "0")), 20.0
PRISM = td.load_scenario("prism").with_changes(BRIEF | {"engine": "!Compiled"})
TREE = yaml.safe_load((Path(td.__file__).parent / "scenario/structures/prism.yaml").read_text())
GIVEN = yaml.safe_load(Path(__file__).with_name("random_inputs.yaml").read_text("utf-8"))
SPREAD = GIVEN["sections"]["disturbances"]
PLAIN = [None, True, -1, 0, 2, 3.5, math.nan, math.inf, 1e300]
PLAIN += ["", "x", "1 m", "-3 N", [], {}, [1, 2]]
ODD = [*PLAIN, b"x", object(), np.zeros(3), np.full((6, 6), np.nan), {"a": 1}, [[math.nan] * 6]]
ODD += [lambda *_: None, Path("/dev/zero"), 10**400, (1, "a"), Exception, PRISM]
ODD += ["--", "<x/>", "\x1b"]


class Answers(ThreadPoolExecutor):
    answer = None

    def submit(self, *_, **__):
        (future := Future()).set_result(self.answer)
        return future if self.answer is not None else None


@functools.cache
def made():
    """A simulation with its readings and states, and other objects that take arguments."""
    simulation, robot = td.Simulation(PRISM, count=2), Robot.of(PRISM)
    readings = simulation.step(np.repeat(simulation.rest[:1], 2, axis=0)).rows(0)
    planner = td.Planner(PRISM, {"p_WN": 1.0}, samples=4, horizon=0.2)
    diagram = MakeTensegrityDiagram(robot, parameters=True)
    return simulation, readings, planner, diagram, td.linearize(PRISM), td.seeded_gait(PRISM, 1)


def mild(rng, value):
    """A value of the same kind: another digit, or up to half as much again."""
    if isinstance(value, str):
        return re.sub(r"[1-9]", lambda _: rng.choice("123456789"), value)
    return value * rng.uniform(0.5, 1.5) if isinstance(value, (float, np.ndarray)) else value


def odd(rng, **given):
    """Arguments, one or two of which are something else, in half of the cases mildly."""
    near = rng.random() < 0.5
    for key in rng.sample([*given], min(len(given), rng.choice([1, 1, 2]))):
        given[key] = mild(rng, given[key]) if near else rng.choice(ODD)
    return given


def either(rng, value):
    """The value itself, or something else."""
    return rng.choice([value, rng.choice(ODD)])


def mutated(rng, tree):
    place, near = (tree := copy.deepcopy(tree)), rng.random() < 0.5
    while isinstance(place, (dict, list)) and place:
        key = rng.choice([*(place if isinstance(place, dict) else range(len(place)))])
        if not isinstance(place[key], (dict, list)) or (not near and rng.random() < 0.4):
            place[key] = mild(rng, place[key]) if near else rng.choice(PLAIN)
            break
        place = place[key]
    return tree


def garbled(rng, folder, suffix, text):
    if rng.random() < 0.4:
        at = rng.randrange(len(text))
        text = text[:at] + mild(rng, text[at : at + 9]) + text[at + 9 :]
    else:
        for _ in range(rng.randint(1, 4)):
            at, end = rng.randrange(len(text)), rng.randint(0, 12)
            piece = rng.choice(
                ["", "9" * 9, "-1", "nan", "<", "--", "\x1b", text[at : at + 30], "1e999"]
            )
            text = text[:at] + piece + text[at + end :]
    (folder / f"a{suffix}").write_text(text, "utf-8")
    return folder / f"a{suffix}"


def evolved(rng, folder):
    Answers.answer = rng.choice([*ODD, Evaluation(1.0, task="trial 9, evaluation 9")])
    given = odd(rng, seed=1, workers=1, overwrite=True, reevaluate=False, report=False)
    executor = rng.choice([Answers, Answers(1), lambda _: rng.choice(ODD), object()])
    return td.evolve(PRISM.on_engine("drake"), folder / "run", executor=executor, **given)


def restored(rng, folder):
    states = made()[0].save()
    states.tables[rng.choice([*states.tables])] = rng.choice([np.zeros(3), np.zeros((2, 2), int)])
    made()[0].restore(**odd(rng, states=states) if rng.random() < 0.5 else {"states": states})


def regulated(rng, folder):
    linear, costs = made()[4], {"state_cost": 10 ** rng.uniform(-8, 14) * np.eye(36)}
    costs["input_cost"] = np.eye(6)
    gain = linear.lqr(**costs if rng.random() < 0.5 else odd(rng, **costs))
    A, B, kept = linear.system.A(), linear.system.B(), linear.resisted
    assert np.linalg.eigvals(kept.T @ (A - B @ gain) @ kept).real.max() < 0.0


def planned(rng, folder):
    field, readings = rng.choice(["p_WN", "q_WB", "time", "v_WN"]), made()[1]
    spoilt = readings._replace(**{field: rng.choice([np.nan * getattr(readings, field), *ODD])})
    return made()[2](**odd(rng, now=0.3) | {"readings": spoilt})


def commanded(rng, folder):
    text = yaml.safe_dump({"base": "prism", rng.choice([*PRISM.model_dump()]): rng.choice(PLAIN)})
    file = garbled(rng, folder, ".yaml", text)
    words = [file, "--out", folder / "x.html", "--units", "mm", "--scenario", "prism", "\x1b"]
    command = rng.choice(GIVEN["commands"])
    try:
        status = main([command, *map(str, rng.sample(words, rng.randint(0, 4)))])
    except SystemExit as ended:  # of the parser
        status = ended.code
    if status == 2:
        raise InputError(command, "", "refused")


def plugged(rng, folder):
    Given.answer = rng.choice([*ODD, np.zeros((1, 6))])
    Given.bounds = rng.choice([*ODD, (0.0, 1.0)])
    scenario = PRISM.with_sections(policy=Given())
    td.simulate(scenario, td.seeded_gait(scenario, 1))


def stepped(rng, folder):
    given = odd(rng, count=2, control_period=0.1, record=False, workers=1)
    simulation = td.Simulation(either(rng, PRISM), **given)
    simulation.step(either(rng, simulation.rest))
    simulation.reset(**odd(rng, seed=None, indices=[0]))


def played(rng, folder):
    options = {"control_period": 0.1, "grouped": False, "render_mode": None}
    options |= {"workers": 1, "max_episode_steps": 3, "autoreset_mode": "SameStep"}
    env = TensegrityVectorEnv(**odd(rng, num_envs=2, scenario=PRISM, **options))
    env.reset(**odd(rng, seed=1, options=None))
    env.step(either(rng, env.action_space.sample()))


def sprung(rng, folder):
    cables = TREE["cables"] | mutated(rng, GIVEN["springs"])
    text = yaml.dump(TREE | {"cables": cables})
    (folder / "a.yaml").write_text(text, "utf-8")
    file = garbled(rng, folder, ".yaml", text) if rng.random() < 0.3 else folder / "a.yaml"
    return Robot.of(PRISM.with_sections(robot=read_structure(file))).equilibrium


def sectioned(tree, rng, folder):
    scenario = PRISM.with_file(mutated(rng, tree), "a")
    td.simulate(scenario, td.seeded_gait(scenario, 1))
    td.Simulation(scenario).step(np.zeros((1, 6)))


def read(rng, folder):
    (file := folder / "gait.json").write_text(json.dumps(mutated(rng, made()[5].to_json(PRISM))))
    td.simulate(PRISM, td.load_gait(file, PRISM))


SURFACES = {
    "gait files": read,
    "structures": lambda r, f: read_structure(garbled(r, f, ".yaml", yaml.dump(mutated(r, TREE)))),
    "MJCF": lambda r, f: converted(garbled(r, f, ".xml", (DATA / "mjcf/others.xml").read_text())),
    "NTRT": lambda r, f: converted(
        garbled(r, f, ".yaml", (DATA / "ntrt/prism.yaml").read_text()), unit="dm"
    ),
    "states": restored,
    "Planner": lambda r, f: td.Planner(
        PRISM, {"p_WN": 1.0}, **odd(r, samples=3, horizon=0.2, knots=2, noise=0.3, limits=None)
    ),
    "plans": planned,
    "predict": lambda r, f: td.predict(
        **odd(r, scenario="prism", quantities=["n3 z"], draws=2, workers=1, seed=0, gait=None)
    ),
    "linearize": lambda r, f: td.linearize(**odd(r, given=PRISM, state=None, modes=None)),
    "lqr": regulated,
    "form_find": lambda r, f: td.form_find(**odd(r, scenario="prism", prestress={"side": "9 N"})),
    "spread": lambda r, f: td.spread(*odd(r, a=PRISM, b=made()[5]).values()),
    "vector": lambda r, f: td.ParameterSpace.of(PRISM).vector(**odd(r, gait=made()[5])),
    "gait": lambda r, f: td.ParameterSpace.of(PRISM).gait(
        **odd(r, vector=td.ParameterSpace.of(PRISM).vector(made()[5]), name="a")
    ),
    "executors": evolved,
    "diagram": lambda r, f: MakeTensegrityDiagram(**odd(r, robot=Robot.of(PRISM), gait=made()[5])),
    "MakeSimulator": lambda r, f: MakeSimulator(
        **odd(r, diagram=made()[3], robot=Robot.of(PRISM), settings=Drake())
    ),
    "MakeDisturbedSimulator": lambda r, f: MakeDisturbedSimulator(
        **odd(r, scenario=PRISM.with_changes(SPREAD), gait=made()[5], generator=RandomGenerator(1))
    ),
    "commands": commanded,
    "plug-ins": plugged,
    "Simulation": stepped,
    "gym": played,
    "springs": sprung,
} | {name: functools.partial(sectioned, tree) for name, tree in GIVEN["sections"].items()}


@pytest.mark.slow
def test_random_inputs_are_used_or_refused_in_one_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rng, count, faults = random.Random(SEED), Counter(), []
    made()
    for number in range(INPUTS):
        name, began, outcome = [*SURFACES][number % len(SURFACES)], time.process_time(), "used"
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            try:
                SURFACES[name](rng, tmp_path)
            except (InputError, SimulationFailure) as error:
                outcome = "lines" if "\n" in str(error) else "refused"
            except Exception:
                outcome = "traceback"
                faults.append(f"{name}: {traceback.format_exc(limit=-3)}")
        count[name, "slow" if time.process_time() - began > LONGEST else outcome] += 1
    for name in SURFACES:
        print(f"{name}: { ({how: n for (one, how), n in count.items() if one == name}) }")
    assert not faults and {how for _, how in count} <= {"used", "refused"}, "\n".join(faults)
