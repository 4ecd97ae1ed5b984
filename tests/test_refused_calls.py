"""Arguments of Python functions that are refused, with their names and what was found.

A refused call leaves no file.
"""

import functools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers.anchored import HUNG, scenario_of
from helpers.converged import shortly

import tetra_drake as td
from tetra_drake.figures.style import Look
from tetra_drake.gym import TensegrityEnv, TensegrityVectorEnv
from tetra_drake.lab.fit.fit import fit
from tetra_drake.lab.fit.measurements import Rest
from tetra_drake.lab.linearization.linearization import linearize
from tetra_drake.lab.planner import Planner
from tetra_drake.lab.study.sweep import sweep
from tetra_drake.laws.contact import MODE_COLUMNS
from tetra_drake.robot.command import Command
from tetra_drake.robot.robot import Robot
from tetra_drake.systems.diagram import MakeTensegrityDiagram

ROWS = yaml.safe_load(Path(__file__).with_name("refused_calls.yaml").read_text("utf-8"))


@functools.cache
def prism():
    return linearize("prism")


@functools.cache
def hung(**changes):
    return scenario_of(HUNG | changes)


def tolerant():
    return scenario_of(HUNG | {"tolerances": {"masses": "2 % each"}})


def planner(cost: Any = (("p_WN", [0.0, 0.0, -1.0]),), scenario=None, **options):
    """A planner of a lifted mass."""
    lifted = scenario or scenario_of(HUNG | {"actuated": {"lift": ["line top a"]}}, 0.1)
    small = {"samples": 32, "horizon": 0.1, "knots": 4, "control_period": 0.01, "workers": 1}
    given = dict(cost) if isinstance(cost, tuple) else cost
    return Planner(lifted, given, **small | {"limits": [[-1.0], [1.0]]} | options)


def fitted(parameters=None, **changes):
    given = parameters or {"robot.cables.line.stiffness": (100.0, 400.0)}
    case = {"measurements": [Rest(positions={"a z": 0.5})]}
    fit(hung(), (case | changes)["measurements"], given, out=Path("fit"), source="fit.yaml")


def diagram(scenario, **options):
    MakeTensegrityDiagram(Robot.of(scenario), **options)


def swept(changes):
    short = shortly(td.load_scenario("thesis"), 0.4, engine="!Compiled")
    sweep(short, td.seeded_gait(short), changes)


@functools.cache
def one():
    env = TensegrityEnv("walk", grouped=True)
    env.reset(seed=0)
    return env


@functools.cache
def many():
    envs = TensegrityVectorEnv(2, "walk")
    envs.reset(seed=0)
    return envs


NAMES = {each.__name__: each for each in (prism, hung, tolerant, planner, fitted, swept, one, many)}
NAMES |= {"td": td, "np": np, "math": math, "linearize": linearize, "Rest": Rest, "sweep": sweep}
NAMES |= {each.__name__: each for each in (TensegrityEnv, TensegrityVectorEnv, Look, Command)}
NAMES |= {"MODE_COLUMNS": MODE_COLUMNS, "MakeTensegrityDiagram": diagram}


@pytest.mark.parametrize(("call", "source", "key", "words"), [(*row[:3], row[3:]) for row in ROWS])
def test_of_a_call(call, source, key, words, tmp_path, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    with refused(source, key, *words):
        eval(call, dict(NAMES))
    assert not list(tmp_path.iterdir())
