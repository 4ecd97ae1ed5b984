"""Evolves a feedback policy that rolls the six-bar rover, and judges it on disturbed robots.

    python runs/rolling.py

Writes the page rolling/README.md, its pictures and rolling/policies.json. After an interruption
the script continues with the next trial.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import cma
import numpy as np
from matplotlib.figure import Figure
from record import FILM, PICTURE, VIEWER, take_pictures

from tetra_drake.engines.simulate import simulate
from tetra_drake.engines.simulation import Simulation
from tetra_drake.evolution.manifest import MANIFEST
from tetra_drake.experiment import evolve
from tetra_drake.figures.style import save_figure
from tetra_drake.files import write_whole
from tetra_drake.formatting import TextTable, fixed
from tetra_drake.laws.cable import CABLE
from tetra_drake.report.result_folder import REPLAY
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.readings import Readings
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.metrics import Metrics
from tetra_drake.scenario.optimizer_kinds import CmaEs
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.units import shown_in
from tetra_drake.study.robustness import DRAWS, default_disturbances
from tetra_drake.study.statistics import share_interval

ROLLING = "rolling"
HERE = Path(__file__).parent / ROLLING
POLICIES, LAPSE = "policies.json", "lapse"

TRIALS, GENERATIONS, POPULATION, ROBOTS = 10, 24, 16, 4
"""Numbers of trials, of generations of each, of policies in a generation, and of disturbed robots
that each policy drives."""
NETWORKS, SCRATCH = 600, Path("out/runs/rover")
"""Number of networks in a trial, and folder of their run."""
EVOLVED = "10 s"
"""Duration of the simulations of evolution, half of what is judged."""
SIGMA = 0.6
"""Initial standard deviation of the coefficients."""
SIZE, PERIOD = 8, 2.0
"""Number of the coefficients of a policy, and period (s) of its clock."""
MOST = 0.5
"""Largest change of a free length, as a share of the free length at rest."""
TURNS, STRAIGHT = 2.0, 0.2
"""A rover rolls if it makes at least TURNS turns and drifts by at most STRAIGHT of its way."""

ENGINES = {
    "compiled": {"engine": "!Compiled {}"},
    "diagram": {"engine": "!Drake {}"},
    "MuJoCo": {"engine": "!Mujoco {}", "friction.stiffness": "0 N/m"},
}
"""Changes of the scenario for each engine."""


@dataclass(frozen=True)
class RollingPolicy:
    """Feedback policy of a rover: the free length of each cable, from the position of the cable
    relative to the rover's centre.

    Each cable is shortened by a polynomial in x and z, the place of its middle in the world frame
    from the centre, in units of half a rod. All cables have the same polynomial, so the rover keeps
    its shape in the world frame while it rolls through it. A clock changes the polynomial a
    little, so that the rover does not come to rest.
    """

    cables: np.ndarray
    """Driven cables, records of laws.cable.CABLE."""
    rest: np.ndarray
    """Free lengths (cables,) in m at rest."""
    half: float
    """Half the length of a rod, in m."""
    coefficients: np.ndarray
    """Coefficients (..., SIZE) of 1, x, z, x², xz, z², sx and sz, where s is the sine of the clock;
    a row for each robot, if there are several."""

    @classmethod
    def of(cls, simulation: Simulation, coefficients: np.ndarray) -> Self:
        """The policy with these coefficients for the robots of a simulation."""
        robot = simulation.robot
        structure = robot.structure
        assert structure.cables.dtype == CABLE
        rod = structure.p_WN[structure.struts[0]]
        half = 0.5 * float(np.linalg.norm(rod[1] - rod[0]))
        return cls(structure.cables[robot.driven], simulation.rest[0], half, coefficients)

    def __call__(self, readings: Readings) -> np.ndarray:
        """Free lengths (..., cables) in m for readings of one robot or of several."""
        p_WN, phase = readings.p_WN, math.tau * np.asarray(readings.time) / PERIOD
        middles = 0.5 * (p_WN[..., self.cables["node_a"], :] + p_WN[..., self.cables["node_b"], :])
        places = (middles - p_WN.mean(axis=-2, keepdims=True)) / self.half
        x, z = places[..., 0], places[..., 2]
        clock = np.sin(phase)[..., np.newaxis]
        terms = np.stack(
            [np.ones_like(x), x, z, x * x, x * z, z * z, clock * x, clock * z], axis=-1
        )
        shortened = (terms * self.coefficients[..., np.newaxis, :]).sum(axis=-1)
        return np.asarray(self.rest * (1.0 - np.clip(shortened, -MOST, MOST)))


def undisturbed(changes: Mapping[str, Any]) -> Scenario:
    """The rover without disturbances, with changes. Its mean power is taken from 2 s on."""
    return load_scenario("rover").with_changes({"simulation.steady_from": "2 s", **changes})


def rover(**changes: str) -> Scenario:
    """The rover with the default disturbances, and with changes of its simulation."""
    scenario = undisturbed({f"simulation.{name}": text for name, text in changes.items()})
    return scenario.with_changes({"disturbances": default_disturbances(scenario)})


def roll(robots: Simulation, coefficients: np.ndarray, *, seed: int) -> list[Metrics | None]:
    """Metrics of disturbed robots, each driven by a policy with its row of coefficients (robots,
    SIZE); None for a robot that fails."""
    readings = robots.reset(seed=seed)
    policy = RollingPolicy.of(robots, coefficients)
    while not robots.ended.all():
        readings = robots.step(policy(readings))
    failed = [failure is not None for failure in robots.failures]
    places = range(robots.count)
    return [None if failed[i] else robots.result(i).metrics for i in places]


def fitness(metrics: Metrics | None, scenario: Scenario) -> float:
    """Fitness by the scenario's objective; 0 for a robot that fails."""
    if metrics is None:
        return 0.0
    return sum(weight * getattr(metrics, name) for name, weight in scenario.objective.items())


def evolve_policy(robots: Simulation, trial: int) -> np.ndarray:
    """Coefficients (SIZE,) of the policy that a trial of CMA-ES finds: the best of the last
    generation. The fitness of a policy is the mean of the worse half of its robots."""
    options = {"popsize": POPULATION, "seed": trial + 1, "verbose": -9}
    search = cma.CMAEvolutionStrategy(np.zeros(SIZE), SIGMA, options)
    drawn = fitnesses = np.empty(0)
    for generation in range(GENERATIONS):
        drawn = np.array(search.ask())
        seed = 1000 * (trial + 1) + generation
        rolled = roll(robots, np.repeat(drawn, ROBOTS, axis=0), seed=seed)
        of_robots = np.array([fitness(metrics, robots.scenario) for metrics in rolled])
        worse = np.sort(of_robots.reshape(POPULATION, ROBOTS), axis=1)[:, : ROBOTS // 2]
        fitnesses = worse.mean(axis=1)
        search.tell(drawn, (-fitnesses).tolist())
        print(f"trial {trial}, generation {generation}: {fitnesses.max():.1f}", flush=True)
    return np.asarray(drawn[fitnesses.argmax()])


def drive(coefficients: Sequence[float], engine: str, *, record: bool = False) -> SimulationResult:
    """The undisturbed rover, driven by a policy on an engine."""
    rolling = RollingPolicy.of(Simulation(undisturbed({})), np.array(coefficients))

    def policy(time: float, readings: Readings) -> np.ndarray:
        return rolling(readings)

    return simulate(undisturbed(ENGINES[engine]), controller=policy, record=record)


def rolls(metrics: Metrics | None) -> bool:
    """True if a rover makes TURNS turns and is STRAIGHT."""
    if metrics is None:
        return False
    enough = metrics.rolled >= math.tau * TURNS
    return enough and metrics.lateral_drift <= STRAIGHT * metrics.distance


def judged(coefficients: np.ndarray) -> dict[str, Any]:
    """A policy's turns, way (m) and drift (m) on each engine, and the number of DRAWS disturbed
    robots that it rolls."""
    engines = {}
    for engine in ENGINES:
        metrics = drive(coefficients.tolist(), engine).metrics
        engines[engine] = {
            "turns": metrics.rolled / math.tau,
            "way_m": metrics.distance,
            "drift_m": metrics.lateral_drift,
            "power_w": metrics.mean_actuator_power,
        }
    robots = Simulation(rover(), count=DRAWS)
    # No trial evolves on draws with this seed.
    disturbed = roll(robots, np.tile(coefficients, (DRAWS, 1)), seed=0)
    return {"engines": engines, "rolls": sum(map(rolls, disturbed)), "draws": DRAWS}


def load_policies() -> list[dict[str, Any]]:
    """The evolved policies with their judgement, by trial."""
    file = HERE / POLICIES
    if not file.exists():
        return []
    policies: list[dict[str, Any]] = json.loads(file.read_text(encoding="utf-8"))
    return policies


def best_of(policies: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The policy that rolls the most disturbed robots; of equal ones that with the most turns in
    MuJoCo."""
    return max(policies, key=lambda each: (each["rolls"], each["engines"]["MuJoCo"]["turns"]))


def policy_table(policies: Sequence[dict[str, Any]]) -> TextTable:
    """A row for each policy."""
    rows = []
    for trial, policy in enumerate(policies):
        cells = [str(trial)]
        for engine in ENGINES:
            on_engine = policy["engines"][engine]
            drift = on_engine["drift_m"] / on_engine["way_m"]
            cells += [fixed(on_engine["turns"], 2), fixed(on_engine["way_m"], 2)]
            cells += [share(drift)]
        low, high = share_interval(policy["rolls"], policy["draws"])
        kept = policy["rolls"] / policy["draws"]
        cells += [f"{kept:.0%} ({100 * low:.0f} to {100 * high:.0f})"]
        rows.append(cells)
    headings = ["trial"]
    for engine in ENGINES:
        headings += [f"{engine}: turns", "way, m", "drift"]
    return TextTable([*headings, "rolls"], rows)


def lapse_figure(result: SimulationResult) -> Figure:
    """The rover from the side at six times of its first turn, and the way of its centre over the
    whole time."""
    figure = Figure(figsize=(8.0, 3.2), layout="constrained")
    lapse, path = figure.subplots(2, 1, height_ratios=(3.0, 1.0))
    trajectory, structure = result.trajectory, result.robot.structure
    assert trajectory is not None
    nodes = trajectory.p_WN.values
    centre = structure.node_shares @ nodes
    for number, time in enumerate(np.linspace(2.0, 7.0, 6)):
        sample = int(np.abs(trajectory.time.values - time).argmin())
        for strut, ends in enumerate(structure.struts):
            x, _, z = nodes[sample][ends].T
            marked = strut == 0
            style = {"color": "C1" if marked else "0.45", "linewidth": 2.5 if marked else 1.2}
            lapse.plot(x + 0.35 * number, z, **style)
        lapse.text(centre[sample, 0] + 0.35 * number, -0.12, f"{time:g} s", ha="center")
    lapse.set_aspect("equal")
    lapse.axhline(0.0, color="black", linewidth=0.8)
    lapse.set_axis_off()
    path.plot(centre[:, 0], centre[:, 1])
    path.plot(centre[::100, 0], centre[::100, 1], "C0.")
    path.set(xlabel="x, forward (m); a dot every second", ylabel="y, left (m)")
    path.set_aspect("equal")
    return figure


def evolve_networks() -> list[dict[str, float]]:
    """Turns, way (m) and drift (m) of the fittest gait of each of TRIALS trials.

    CMA-ES evolves networks of oscillators, open loops, on the undisturbed rover.
    """
    changes = {"optimizer": CmaEs(), "evolution.trials": TRIALS}
    scenario = undisturbed(changes | {"evolution.evaluations": NETWORKS})
    resume = (SCRATCH / MANIFEST).exists()
    run = evolve(scenario, SCRATCH, resume=resume, reevaluate=False, report=False)
    fittest = run.evaluations.loc[run.evaluations.groupby("trial")["fitness"].idxmax()]
    rows = fittest[["rolled", "distance", "lateral_drift"]].to_numpy(dtype=float)
    return [
        {"turns": rolled / math.tau, "way_m": way, "drift_m": drift}
        for rolled, way, drift in rows.tolist()
    ]


def network_table(networks: Sequence[dict[str, float]]) -> TextTable:
    """A row for the fittest network of each trial."""
    rows = [
        [
            str(trial),
            fixed(each["turns"], 2),
            fixed(each["way_m"], 2),
            share(each["drift_m"] / each["way_m"]),
        ]
        for trial, each in enumerate(networks)
    ]
    return TextTable(["trial", "turns", "way, m", "drift"], rows)


def share(value: float) -> str:
    """A share as text, in percent."""
    return f"{100.0 * value:.0f} %"


PAGE = """\
# A rover that rolls

<img src="walking.gif" width="100%" alt="the rover rolls">

Scenario [`rover`](../../tetra_drake/scenario/rover.yaml): a six-bar with rods of 0.66 m and 0.25 kg
and winches on all 24 cables. Sizes, cables and the winches' speed, 0.2 m/s, are those of the model
with which UC Berkeley plans its rover; the greatest force, 100 N, is chosen. Rods touch.
`python runs/rolling.py` writes this page. [The motion in 3D](replay.html)

To simulate the best policy yourself, in the folder `runs`:

```python
from rolling import best_of, drive, load_policies

result = drive(best_of(load_policies())["coefficients"], "compiled", record=True)
print(result.metrics)
```

**In 20 s the best policy rolls {turns} turns and {way} m forward ({drift} sideways). It rolls
{diagram} turns on the Drake diagram and {mujoco} in MuJoCo. {kept} of {draws} disturbed robots make
two turns and drift by at most 20 % of their way.**

![the rover from the side, and its path](lapse.svg)

## The policy

Each winch shortens its cable by a polynomial in x and z, the place of the cable's middle around the
rover's centre, as seen from the ground. All 24 cables have the same polynomial of second degree,
so it has eight coefficients, two of them with a clock of 2 s. The rover keeps its shape in the
world while it rolls through it, whatever face it stands on. It can know the places from the
orientations of its rods and the lengths of its cables. It does not steer.

CMA-ES evolves the coefficients: 24 generations of 16 policies, each on four disturbed robots for
10 s; the fitness is the mean of the worse two. The draws of this table were not used in evolution.

{policies}

*rolls*: share of 200 disturbed robots with at least two turns, straight within 20 %, with the
interval of 95 %. The same motion on two engines parts after some impacts, so turns differ.

## Open loops

A network of eight oscillators, one for each face, is evolved for the same objective, 600 gaits in
each trial. It knows nothing of the ground.

{networks}

Networks that make a turn in 20 s: {turning} of {trials}. The best makes {most}. In single trials of
another length and objective, smaller signals (`cpg.gain` of 100 and 200 N) did not tip the rover at
all, 600 N gave 0.94 turns, and 200 N with feedback of length, load and pitch to the oscillators
0.83 turns.

## What disappointed

- Evolution depends on luck: {lucky} of {trials} trials found a policy that rolls 90 % of the
  disturbed robots.
- Without the clock, rovers come to rest: the best policies of two trials rolled 44 to 97 % of 32
  disturbed robots.
- A limit of the winches binds for {limited} of the time.
"""


def page(
    policies: Sequence[dict[str, Any]], networks: Sequence[dict[str, float]], *, limited: float
) -> str:
    """The page about policies and networks. `limited` is the share of time at a limit of a winch
    with the best policy."""
    best = best_of(policies)
    on = best["engines"]
    rolling = [each for each in policies if each["rolls"] >= 0.9 * each["draws"]]
    return PAGE.format(
        turns=fixed(on["compiled"]["turns"], 1),
        way=fixed(on["compiled"]["way_m"], 1),
        drift=share(on["compiled"]["drift_m"] / on["compiled"]["way_m"]),
        diagram=fixed(on["diagram"]["turns"], 1),
        mujoco=fixed(on["MuJoCo"]["turns"], 1),
        kept=best["rolls"],
        draws=best["draws"],
        policies=policy_table(policies).markdown(),
        networks=network_table(networks).markdown(),
        turning=sum(each["turns"] >= 1.0 for each in networks),
        most=fixed(max(each["turns"] for each in networks), 1),
        lucky=len(rolling),
        limited=share(limited),
        trials=len(policies),
    )


def main() -> None:
    """Evolves the policies that are missing, and writes the page and its pictures."""
    HERE.mkdir(exist_ok=True)
    policies = load_policies()
    robots = Simulation(rover(duration=EVOLVED), count=POPULATION * ROBOTS)
    for trial in range(len(policies), TRIALS):
        coefficients = evolve_policy(robots, trial)
        policies.append({"coefficients": coefficients.tolist()} | judged(coefficients))
        write_whole(HERE / POLICIES, json.dumps(policies, indent=1) + "\n")
        print(policy_table(policies).text(), flush=True)
    best = best_of(policies)
    result = drive(best["coefficients"], "compiled", record=True)
    save_figure(lapse_figure(result), HERE, LAPSE, kinds=["svg"])
    with shown_in("SI"):
        result.save_replay(HERE / REPLAY, viewer=HERE.parent / VIEWER)
    take_pictures(HERE / REPLAY, HERE / FILM, HERE / PICTURE)
    limited = result.metrics.actuator_limited
    write_whole(HERE / "README.md", page(policies, evolve_networks(), limited=limited))
    print(HERE / "README.md")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    main()
