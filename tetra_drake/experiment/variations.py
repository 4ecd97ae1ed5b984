"""What is changed to learn how far a gait's distance can be trusted."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tetra_drake.engines.compiled.engine import simulate_compiled
from tetra_drake.errors import SimulationFailure
from tetra_drake.evolution.evaluation import GaitEvaluation
from tetra_drake.evolution.optimizers.base import Evaluate, Evaluation, Genome
from tetra_drake.robot.gait import ParameterSpace
from tetra_drake.robot.structure import MakeStructure, Structure
from tetra_drake.scenario.schema import Scenario

DEFAULT = "default"
"""The setting that the others are compared with."""

NOTHING = "nothing"
"""What is changed in the simulation that the variations are compared with."""

PERCENTS = (2.0, 5.0)
DRAWS = 5
"""How many poses are drawn at random for each percentage."""

SCALED = {
    "initial spacing": ("robot.spacing",),
    "stiction range p₀": ("friction.stiction_range",),
    "stiction damping σ₁": ("friction.stiction_damping",),
    "stiction switch a_c": ("friction.stiction_switch",),
    "proportional stiction σ₀": ("friction.proportional_stiction",),
    "outer cables' stiffness": ("cables.outer_stiffness",),
    "inner cables' stiffness": ("cables.inner_stiffness",),
    "all cables' stiffness": ("cables.outer_stiffness", "cables.inner_stiffness"),
    "ground stiffness k": ("ground.stiffness",),
    "ground damping λ": ("ground.damping",),
}
"""What is scaled by 1 + percent / 100, and the keys of the scenario that this takes."""

POSE = "initial place of each tetrahedron"


@dataclass(frozen=True)
class Variation:
    """A change of the robot or its surroundings."""

    what: str
    """A key of SCALED, POSE or NOTHING."""
    percent: float
    """By how much; of POSE, at most by how much of the spacing."""
    evaluate: Evaluate
    """Simulates a gait under the change, on the compiled engine."""


@dataclass(frozen=True)
class DisplacedStart:
    """Evaluates gaits of a robot that starts with every tetrahedron a little out of place.

    Each is moved forward or back, sideways, and up, each by up to `percent` of the spacing,
    drawn at random with `seed`.
    """

    scenario: Scenario
    percent: float
    seed: int

    def structure(self) -> Structure:
        """The robot as it starts."""
        structure = MakeStructure(self.scenario.robot, self.scenario.cables)
        reach = self.percent / 100.0 * self.scenario.robot.spacing
        moves = np.random.default_rng(self.seed).uniform(-reach, reach, structure.p_WB.shape)
        moves[:, 2] = np.abs(moves[:, 2])  # not into the ground
        return dataclasses.replace(structure, p_WB=structure.p_WB + moves)

    def __call__(self, genome: Genome) -> Evaluation:
        """Fitness and metrics of one genome, or why it has none."""
        gait = ParameterSpace.of(self.scenario).gait(genome, name="candidate")
        try:
            result = simulate_compiled(
                scenario=self.scenario, gait=gait, record=False, structure=self.structure()
            )
        except SimulationFailure as failure:
            return Evaluation.failed(f"ended at {failure.time:g} s", engine="compiled")
        return Evaluation(
            fitness=result.fitness,
            metrics=dataclasses.asdict(result.metrics),
            engine="compiled",
        )


def resimulations(scenario: Scenario) -> dict[str, Scenario]:
    """The scenario on the Drake diagram, integrated in other ways, by their names."""
    scenario = scenario.with_changes({"simulation.engine": "drake"})
    accuracy = scenario.simulation.accuracy
    explicit = {"scheme": "runge_kutta3", "accuracy": 1e-3, "max_step": 2e-3}
    changes: dict[str, dict[str, Any]] = {
        DEFAULT: {},
        "accuracy × 10": {"accuracy": accuracy / 10.0},
        "accuracy × 100": {"accuracy": accuracy / 100.0},
        "witness, steps ≤ 2 ms": {"mode_changes": "witness", "max_step": 2e-3},
        "runge_kutta3": explicit,
        "runge_kutta3, witness": explicit | {"mode_changes": "witness"},
    }
    return {
        name: scenario.with_changes({f"simulation.{key}": value for key, value in change.items()})
        for name, change in changes.items()
    }


def variations(scenario: Scenario) -> Iterator[Variation]:
    """All changes, beginning with none at all."""
    scenario = scenario.with_changes({"simulation.engine": "compiled"})
    yield Variation(NOTHING, 0.0, GaitEvaluation(scenario))
    signed = [sign * percent for percent in PERCENTS for sign in (-1.0, 1.0)]
    for what, keys in SCALED.items():
        for percent in signed:
            yield Variation(what, percent, GaitEvaluation(_scaled(scenario, keys, percent)))
    for percent in PERCENTS:
        for seed in range(DRAWS):
            yield Variation(POSE, percent, DisplacedStart(scenario, percent, seed))


def _scaled(scenario: Scenario, keys: tuple[str, ...], percent: float) -> Scenario:
    changed = copy.deepcopy(scenario)
    for key in keys:
        section, name = key.split(".")
        part = getattr(changed, section)
        setattr(part, name, getattr(part, name) * (1.0 + percent / 100.0))
    return changed
