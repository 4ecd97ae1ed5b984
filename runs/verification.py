"""Problems whose motion is known, on the three engines: one page.

    python runs/verification.py [films | PROBLEM ...]

Simulates the problems of verification/problems.yaml, or the given ones, at the defaults and at fine
settings of each engine, and writes the page README.md with its curves and results.json. `films`
makes the page's films; they need a browser.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import verification_references as references
import yaml
from page import rendered
from pydrake.multibody.tree import RotationalInertia
from script import script

from tetra_drake.engines.simulate import simulate
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import read_json, write_whole
from tetra_drake.laws.cable import CableLaw, elastic_energy
from tetra_drake.laws.kinematics import rigid_motions
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.parameter_space import seeded_gait
from tetra_drake.robot.structure import turned_back
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.refusals import TAG

HERE = Path(__file__).parent / "verification"
RESULTS = "results.json"
_TEXT = jinja2.Template((HERE / "problems.yaml").read_text("utf-8")).render(vars(math))
GIVEN: Any = yaml.safe_load(_TEXT)
PROBLEMS: dict[str, dict[str, Any]] = {
    name: {"name": name} | problem for name, problem in GIVEN["problems"].items()
}
ENGINES: dict[str, dict[str, str]] = GIVEN["engines"]
SAMPLES = 100
Array = np.ndarray


def scenario_of(problem: Mapping[str, Any], case: Mapping[str, Any]) -> Scenario:
    """The scenario of a case of a problem, on the compiled engine."""
    duration = float(problem["duration"])
    changes = GIVEN["world"] | {"terrain": "!Flat" if problem.get("ground") else "!Nothing"}
    changes["simulation.duration"] = f"{duration} s"
    changes["simulation.sample_period"] = f"{duration / SAMPLES} s"
    if "structure" in problem:
        changes["robot"] = {TAG: "Structure"} | dict(problem["structure"])
    changes |= problem.get("changes", {}) | problem.get("base", {})
    own = {key: value for key, value in case.items() if "." in key or key == "terrain"}
    scenario = load_scenario(problem.get("scenario", "prism")).with_changes(changes)
    return scenario.with_changes(own) if own else scenario


def energy_of(result: SimulationResult) -> tuple[Array, Array]:
    """Energy (times,) in J of bodies, cables and springs, and of its motion alone."""
    structure, model, seen = result.robot.structure, result.robot.model, result.trajectory
    p_WN, v_WN, p_WB = (seen[name].values for name in ("p_WN", "v_WN", "p_WB"))
    energy = structure.mass * result.scenario.robot.gravity @ p_WB[..., 2].T
    law: Any = CableLaw.of(structure.cables)
    stretch = np.maximum(seen.length.values - law.free_length, 0.0)
    energy += elastic_energy(stretch, law).sum(axis=1)
    anchors, joints = model.anchors, model.joints
    held = (p_WN[:, anchors.nodes] - anchors.places) ** 2 * anchors.stiffness
    apart = ((p_WN[:, joints.node_a] - p_WN[:, joints.node_b]) ** 2).sum(axis=2)
    energy += 0.5 * (held.sum(axis=(1, 2)) + apart @ joints.stiffness)
    motion = np.zeros(len(p_WN))
    for body, (first, end) in enumerate(itertools.pairwise(structure.first_node)):
        q = seen.q_WB.values[:, body]
        unit = RotationalInertia(*structure.unit_inertia[body]).CopyToFullMatrix3()
        rigid = rigid_motions(structure.p_BN[first:end]).reshape(-1, 6)
        own = turned_back(q[:, np.newaxis], v_WN[:, first:end]).reshape(len(q), -1)
        w, speed = np.split(np.linalg.lstsq(rigid, own.T, rcond=1e-9)[0], 2)
        motion += 0.5 * structure.mass[body] * (speed**2 + w * (unit @ w)).sum(axis=0)
    return energy + motion, motion


def followed(problem: Mapping[str, Any], result: SimulationResult) -> Array:
    """What a problem compares, at the samples."""
    seen, what = result.trajectory, problem["follow"]
    if what == "energy":
        energy, motion = energy_of(result)
        return 1.0 + (energy - energy[0]) / motion[0]
    if what == "centre":
        mass = result.robot.structure.mass
        return np.asarray(seen.p_WB.values[..., 2] @ mass / mass.sum())
    if what == "rebound":
        speeds = seen.v_WN.sel(node="a", axis="z").values
        return -speeds / speeds[0]
    node, axis = what
    return np.asarray(seen.p_WN.sel(node=node, axis=axis).values)


def run(problem: Mapping[str, Any], engine: str, *, drift: bool = False) -> dict[str, Any]:
    """What an engine finds: curves `x`, `found` and `expected`, their `size`, the greatest error as
    a share of it, drift of energy (J), and wall time `s` (s)."""
    parts, drifts, wall = [], [], 0.0
    cases = problem.get("cases", [{}])
    for number, case in enumerate(cases):
        bristles = "0 N/m" if engine.startswith("!Mujoco") else "30 kN/m"
        changes = {"engine": engine, "friction.stiffness": bristles}
        scenario = scenario_of(problem, case).with_changes(changes)
        result = simulate(scenario, seeded_gait(scenario), record=True)
        wall += result.wall_time
        times = result.trajectory.time.values
        values = followed(problem, result)
        own = {**problem, **case, "ground": scenario.ground, "robot": result.robot}
        own["start"] = scenario.robot.start
        if isinstance(problem["follow"], list):
            own["first"] = result.trajectory.p_WN.sel(node=problem["follow"][0]).values[0]
        right = getattr(references, problem.get("by", "formula"))(times, own)
        if drift:
            energy = energy_of(result)[0]
            drifts.append(float(np.abs(energy - energy[0]).max()))
        if len(cases) > 1:
            times, values, right = np.array([number]), values[-1:], right[-1:]
        parts.append([times, values, right])
    x, found, expected = (np.concatenate(part) for part in zip(*parts, strict=True))
    size = float(np.ptp(expected)) or 1.0
    error = float(np.abs(found - expected).max() / size)
    curves = {"x": x, "found": found, "expected": expected}
    return curves | {"size": size, "error": error, "drift": max(drifts, default=None), "s": wall}


def order_of(problem: Mapping[str, Any], name: str) -> float | None:
    """Order of convergence, from the differences of runs with a step, its half and its quarter."""
    if not (step := float(problem.get("order", {}).get(name, 0.0))):
        return None
    runs = [run(problem, ENGINES[name]["steps"] % (step / 2**k))["found"] for k in range(3)]
    coarse, fine = (np.abs(a - b).max() for a, b in itertools.pairwise(runs))
    return math.log2(coarse / fine)


def verified(name: str) -> dict[str, Any]:
    """Results of a problem: curves, and for each engine the greatest errors."""
    problem = PROBLEMS[name]
    if problem.get("follow") == "rest":
        x, found, expected = getattr(references, name)(problem.get("structure"))
        error = float(np.abs(np.subtract(found, expected)).max() / np.ptp(expected))
        own: dict[str, Any] = {"x": x, "expected": expected, "all": found}
        return own | {"engines": {"all": {"error": error}}}
    results: dict[str, Any] = {"engines": {}}
    is_smooth = problem.get("order") is not None
    for engine, usual in ENGINES.items():
        if engine in problem.get("lacks", {}):
            continue
        numbers: dict[str, Any] = {"order": order_of(problem, engine)}
        results["engines"][engine] = numbers
        fine = {} if problem.get("long") else {engine: usual["fine"]}
        fine |= problem.get("fine", {})
        for prefix, settings in (("", usual["default"]), ("fine_", fine.get(engine))):
            try:
                found = run(problem, settings, drift=is_smooth) if settings else None
            except (SimulationFailure, InputError) as failure:
                numbers[f"{prefix}failure"] = str(failure).splitlines()[0]
                continue
            if found:
                results |= {key: found[key] for key in ("x", "expected", "size")}
                results.setdefault(engine, found["found"])
                numbers |= {f"{prefix}{key}": found[key] for key in ("error", "drift", "s")}
    return results


COLOURS = {"compiled": "#0072b2", "all": "#0072b2", "drake": "#d55e00", "mujoco": "#009e73"}


def curves(result: Mapping[str, Any]) -> str:
    """A picture in SVG: the reference grey, the engines in their colours."""
    thin = slice(None, None, 2 if len(result["x"]) > 50 else 1)
    x, expected = np.array(result["x"], float)[thin], np.array(result["expected"], float)[thin]
    lines = {"#bbb": expected} | {c: result[e][thin] for e, c in COLOURS.items() if e in result}
    values = np.concatenate([*map(np.asarray, lines.values())])
    low, size = values.min(), np.ptp(values) or 1.0
    across = 4.0 + 152.0 * (x - x.min()) / (np.ptp(x) or 1.0)
    points = {}
    for colour, line in lines.items():
        up = 56.0 - 52.0 * (np.asarray(line) - low) / size
        points[colour] = [f"{a:.0f},{b:.1f}" for a, b in zip(across, up, strict=True)]
    return rendered("curves.svg", lines=points)


def write_page(results: Mapping[str, Any]) -> None:
    """Writes the page from the results by problem."""
    engines = [each for result in results.values() for each in result["engines"].values()]
    seconds = sum(each.get("s", 0.0) + each.get("fine_s", 0.0) for each in engines)
    numbers = {"results": results, "engines": [*ENGINES], "minutes": seconds / 60.0}
    text = rendered("verification.md", problems=PROBLEMS, **numbers)
    write_whole(HERE / "README.md", text)


def save_film(name: str) -> None:
    """Films a problem, so many times as fast as its `film` says."""
    problem = PROBLEMS[name]
    scenario = scenario_of(problem, {}).with_changes({"engine": ENGINES["compiled"]["fine"]})
    result = simulate(scenario, seeded_gait(scenario), record=True)
    film = {"size": (240, 180), "fps": 6.0, "view": "side", "speed": problem["film"]}
    result.save_video(HERE / f"{name}.gif", **film)


@script
def main(names: Sequence[str]) -> None:
    """Runs problems, all without names, and writes the page."""
    if names == ["films"]:
        for name in (name for name, problem in PROBLEMS.items() if "film" in problem):
            save_film(name)
        return
    file, results = HERE / RESULTS, dict[str, Any]()
    for name in names or PROBLEMS:
        found = verified(name)
        if "x" in found:
            write_whole(HERE / f"{name}.svg", curves(found))
        results[name] = {"size": found.get("size", 1.0), "engines": found["engines"]}
        print(name, results[name], flush=True)
    if names and file.exists():
        results = read_json(file, "results") | results
    write_whole(file, json.dumps(results, indent=1) + "\n")
    write_page(results)
