"""Random wrong inputs: each is used, or refused in one line. `INPUTS=3000` and `SEED` set how many.

A table of the outcomes is printed with `-s`. A file of random XML may not be read for long: the
test has a limit of CPU time for each input.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import io
import math
import os
import random
import time
import traceback
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers.brief import BRIEF
from helpers.files import DATA
from pydrake.common import RandomGenerator

import tetra_drake as td
from tetra_drake.cli import main
from tetra_drake.engines.drake import MakeDisturbedSimulator, MakeSimulator
from tetra_drake.engines.states import States
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.lab.bridges.conversion import converted
from tetra_drake.lab.planner import Planner
from tetra_drake.optimizers.base import Evaluation
from tetra_drake.robot.parameter_space import ParameterSpace
from tetra_drake.robot.robot import Robot
from tetra_drake.scenario.engine_kinds import Drake
from tetra_drake.scenario.structure_files import read_structure
from tetra_drake.systems.diagram import MakeTensegrityDiagram

INPUTS, SEED, LONGEST = int(os.environ.get("INPUTS", "600")), int(os.environ.get("SEED", "0")), 20.0
PRISM = td.load_scenario("prism").with_changes(BRIEF | {"engine": "!Compiled"})
TREE = yaml.safe_load((Path(td.__file__).parent / "scenario/structures/prism.yaml").read_text())
ODD = [None, True, -1, 0, 2, 3.5, math.nan, math.inf, 1e300, "", "x", "1 m", "-3 N", b"x", [], {}]
ODD += [
    [1, 2],
    [[math.nan] * 6],
    {"a": 1},
    object(),
    np.zeros(3),
    np.full((6, 6), np.nan),
    "n0\x1b",
]
ODD += [
    lambda *_: None,
    Path("/dev/zero"),
    "../x",
    10**400,
    (1, "a"),
    Exception,
    PRISM,
    "--",
    "<x/>",
]


@functools.cache
def made() -> dict[str, Any]:
    simulation, linear = td.Simulation(PRISM, count=2), td.linearize(PRISM)
    readings = simulation.step(np.repeat(simulation.rest[:1], 2, axis=0))
    diagram = MakeTensegrityDiagram(Robot.of(PRISM), parameters=True)
    return {
        "simulation": simulation,
        "states": simulation.save(),
        "linear": linear,
        "readings": readings.rows(0),
        "planner": Planner(PRISM, {"p_WN": 1.0}, samples=4, horizon=0.2),
        "diagram": diagram,
        "context": diagram.CreateDefaultContext(),
        "gait": td.seeded_gait(PRISM, 1),
        "space": ParameterSpace.of(PRISM),
    }


def odd(rng: random.Random, **given: Any) -> dict[str, Any]:
    """Arguments, one or two of which are something else."""
    for key in rng.sample([*given], min(len(given), rng.choice([1, 1, 2]))):
        given[key] = rng.choice(ODD)
    return given


def mutated(rng: random.Random, tree: Any) -> Any:
    tree = copy.deepcopy(tree)
    for _ in range(rng.randint(1, 3)):
        place = tree
        while isinstance(place, (dict, list)) and place:
            key = rng.choice([*(place if isinstance(place, dict) else range(len(place)))])
            if rng.random() < 0.4 or not isinstance(place[key], (dict, list)):
                place[key] = rng.choice([one for one in ODD[:18] if not isinstance(one, bytes)])
                break
            place = place[key]
    return tree


def garbled(rng: random.Random, text: str) -> str:
    for _ in range(rng.randint(1, 4)):
        at, to = sorted(rng.randrange(len(text)) for _ in range(2))
        piece = rng.choice(
            ["", "9" * 9, "-1", "nan", "<", "--", "\x1b", text[at : at + 30], "1e999"]
        )
        text = text[:at] + piece + text[min(to, at + rng.randint(0, 12)) :]
    return text


def file_of(folder: Path, text: str, suffix: str) -> Path:
    (folder / f"a{suffix}").write_text(text, "utf-8", errors="replace")
    return folder / f"a{suffix}"


class OddExecutor(ThreadPoolExecutor):
    answer: Any = None

    def submit(self, *args: Any, **more: Any) -> Any:
        future: Future[Any] = Future()
        future.set_result(self.answer)
        return self.answer if self.answer is None else future


def executed(rng: random.Random, folder: Path) -> object:
    OddExecutor.answer = rng.choice([*ODD, Evaluation(1.0, task="trial 9, evaluation 9")])
    make = rng.choice([OddExecutor, OddExecutor(1), lambda _: rng.choice(ODD), rng.choice(ODD)])
    given = odd(rng, seed=1, workers=1, overwrite=True, reevaluate=False, report=False)
    brief = PRISM.with_changes({"engine": "!Drake", "evolution.trials": 1})
    return td.evolve(brief, folder / "run", **given | {"executor": make or OddExecutor})


def set_law(rng: random.Random, _: Path) -> object:
    context = made()["diagram"].CreateDefaultContext()
    cables, ground = (made()["diagram"].GetSubsystemByName(name) for name in ("cables", "ground"))
    own, law = cables.GetMyMutableContextFromRoot(context), None
    law = cables.GetLaw(own)
    cables.SetLaw(
        own, rng.choice([law._replace(**{rng.choice(law._fields): rng.choice(ODD)}), *ODD])
    )
    other = Robot.of(PRISM).ground
    field = rng.choice(["friction", "normal"])
    return ground.SetGround(
        ground.GetMyMutableContextFromRoot(context), other._replace(**{field: rng.choice(ODD)})
    )


def restored(rng: random.Random, _: Path) -> object:
    states: States = made()["states"]
    tables = dict(states.tables)
    tables[rng.choice([*tables])] = rng.choice([np.zeros(3), np.zeros((2, 2), int), np.zeros(0)])
    simulation: td.Simulation = made()["simulation"]
    simulation.restore(
        **odd(rng, states=states)
        if rng.random() < 0.4
        else {"states": type(states)(**vars(states) | {"tables": tables})}
    )
    return simulation.step(simulation.rest)


def regulated(rng: random.Random, _: Path) -> object:
    linear, n, m = made()["linear"], 36, 6
    if rng.random() < 0.3:
        return td.linearize(**odd(rng, given=PRISM, state=None, modes=None, outputs=("p_WN",)))
    costs = {"state_cost": 10.0 ** rng.uniform(-8, 14) * np.eye(n), "input_cost": np.eye(m)}
    gain = linear.lqr(**costs if rng.random() < 0.5 else odd(rng, **costs))
    A, B, kept = linear.system.A(), linear.system.B(), linear.resisted
    assert np.linalg.eigvals(kept.T @ (A - B @ gain) @ kept).real.max() < 0.0, "silent"
    return linear.controller(gain)(0.0, rng.choice([made()["readings"], *ODD[:8]]))


def planned(rng: random.Random, _: Path) -> object:
    if rng.random() < 0.5:
        given = odd(rng, samples=3, horizon=0.2, knots=2, temperature=0.1, noise=0.3, limits=None)
        return Planner(PRISM, {"p_WN": 1.0}, **given)
    field = rng.choice(["p_WN", "q_WB", "time", "v_WN"])
    readings, spoilt = made()["readings"], rng.choice(ODD)
    readings = readings._replace(**{field: rng.choice([readings.p_WN * np.nan, spoilt])})
    return made()["planner"](**odd(rng, now=0.3, readings=readings))


def commanded(rng: random.Random, folder: Path) -> object:
    text = yaml.safe_dump(
        {"base": "prism"} | {rng.choice([*PRISM.model_dump()]): rng.choice(ODD[:13])}
    )
    file = file_of(folder, garbled(rng, text), ".yaml")
    words = [
        str(file),
        "--out",
        str(folder / "x.html"),
        "--units",
        "mm",
        "--scenario",
        "prism",
        "\x1b",
    ]
    command = rng.choice(
        ["structure", "replay", "figures", "cpg", "schema", "compare", "robustness"]
    )
    try:
        status = main([command, *rng.sample(words, rng.randint(0, 4))])
    except SystemExit as ended:
        status = ended.code
    if status == 2:
        raise InputError("command", "", "refused")
    return status


def kwargs_of(call: Callable[..., object], **given: Any) -> Callable[[random.Random, Path], object]:
    return lambda rng, _: call(**odd(rng, **given))


SURFACES: dict[str, Callable[[random.Random, Path], object]] = {
    "structures": lambda rng, folder: read_structure(
        file_of(folder, yaml.safe_dump(mutated(rng, TREE)), ".yaml")
    ),
    "scenarios": lambda rng, _: PRISM.with_file(
        mutated(rng, PRISM.model_dump(exclude={"robot"})), "a"
    ),
    "MJCF": lambda rng, folder: converted(
        file_of(folder, garbled(rng, (DATA / "mjcf/others.xml").read_text()), ".xml")
    ),
    "NTRT": lambda rng, folder: converted(
        file_of(folder, garbled(rng, (DATA / "ntrt/prism.yaml").read_text()), ".yaml"), unit="dm"
    ),
    "states": restored,
    "Planner": planned,
    "predict": kwargs_of(
        td.predict, scenario="prism", quantities=["n3 z"], draws=2, workers=1, seed=0
    ),
    "linearize, lqr": regulated,
    "form_find": kwargs_of(td.form_find, scenario="prism", prestress={"side": "9 N"}),
    "spread": lambda rng, _: td.spread(*odd(rng, a=PRISM, b=made()["gait"]).values()),
    "ParameterSpace": lambda rng, _: [
        made()["space"].vector(rng.choice([made()["gait"], *ODD])),
        made()["space"].gait(**odd(rng, vector=made()["space"].low, name="a")),
    ],
    "executors": executed,
    "diagram": lambda rng, _: MakeTensegrityDiagram(
        **odd(rng, robot=Robot.of(PRISM), gait=made()["gait"])
    ),
    "MakeSimulator": kwargs_of(
        lambda settings, robot: MakeSimulator(made()["diagram"], robot, settings),
        settings=Drake(),
        robot=Robot.of(PRISM),
    ),
    "SetLaw, SetGround": set_law,
    "MakeDisturbedSimulator": kwargs_of(
        MakeDisturbedSimulator, scenario=PRISM, gait=None, generator=RandomGenerator(1)
    ),
    "commands": commanded,
}


@pytest.mark.slow
def test_random_inputs_are_used_or_refused_in_one_line(tmp_path: Path) -> None:
    rng, count, faults = random.Random(SEED), Counter[tuple[str, str]](), list[str]()
    for number in range(INPUTS):
        name = [*SURFACES][number % len(SURFACES)]
        began, outcome = time.process_time(), "used"
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            try:
                SURFACES[name](rng, tmp_path)
            except (InputError, SimulationFailure) as error:
                outcome = "refused" if "\n" not in str(error) else "lines"
            except Exception as error:
                outcome = "traceback"
                faults.append(f"{name}: {error!r:.150} {traceback.format_exc(limit=-2)[-400:]}")
        if time.process_time() - began > LONGEST:
            outcome = "slow"
        count[name, outcome] += 1
    for name in SURFACES:
        print(f"{name}: { ({how: n for (one, how), n in count.items() if one == name}) }")
    assert not faults and {how for _, how in count} <= {"used", "refused"}, "\n".join(faults)
