"""A walking robot loses a cable, and finds another gait by trial and error, or by planning.

    python runs/damage.py

Writes the page README.md, its figure and the records into the folder damage/. After an interruption
the script continues. The gaits to try come from a map (Cully et al., Robots that can adapt like
animals, Nature 521, 2015).
"""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas
from matplotlib.figure import Figure
from page import rendered
from records import append, read
from script import read_settings, script

from tetra_drake.engines.simulate import Outcome, simulate, simulate_many
from tetra_drake.evolution.run import load_run
from tetra_drake.figures.style import OKABE_ITO, common_style, save_figure
from tetra_drake.files import write_whole
from tetra_drake.lab.planner import Planner
from tetra_drake.lab.study.robustness import default_disturbances
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.disturbances import disturbed, fresh_draws
from tetra_drake.scenario.scenario import Scenario

HERE = Path(__file__).parent / "damage"
WALKER, MAP = HERE.parent / "motors", Path("out/runs/motors-map")
"""Runs with the gait that the robot has, and with the gaits that it can try. The second one has all
its gaits, as record.py leaves it."""
GAITS, CANDIDATES = HERE / "gaits.jsonl", HERE / "whole.jsonl"
"""Records: gaits to try; their walks, with each turn, of the whole robot."""
WALKS, PLANS = HERE / "walks.jsonl", HERE / "plans.jsonl"
"""Records: walks of damaged robots; walks by a planner."""

SET: dict[str, Any] = read_settings(HERE / "settings.yaml")
"""What is done, see the file."""
DECIMALS = 4
"""Decimals of the numbers in the records."""

Row = dict[str, Any]


# The robot and its gaits


@dataclass(frozen=True)
class Trial:
    """A gait that the robot can try, and its strength; see STRENGTHS."""

    gait: Gait
    strength: float = 1.0

    def on(self, robot: Scenario, cable: str = "") -> Scenario:
        """A robot that pulls with this strength, and loses a cable at the start; none if the name
        is empty."""
        gain = f"{self.strength * robot.cpg.gain!r} N"
        events = [{"at": "0 s", "cut": [cable]}] if cable else []
        return robot.with_changes({"cpg.gain": gain, "events": events})


@functools.cache
def scenario() -> Scenario:
    """Scenario of the robot. Each motor has an oscillator, so that it can be steered."""
    return load_run(WALKER).scenario.with_changes(SET["robot"])


def source(name: str) -> str:
    """The parameter of a gait of four oscillators that a parameter of eight is; empty for weights
    between left and right, which do not inhibit each other."""
    if not name.startswith("weight"):
        return name
    _, pair, kind = name.split(" ")
    start, end = (int(number) - 1 for number in pair.split("->"))
    return f"weight {start // 2 + 1}->{end // 2 + 1} {kind}" if start % 2 == end % 2 else ""


def steered(gait: Gait, turn: float) -> Gait:
    """A gait of four oscillators for eight: left and right ones do the same, and the turn makes one
    side stronger."""
    known = {"": 0.0, **gait.parameters}
    values = {name: known[source(name)] for name in scenario().parameters}
    return dataclasses.replace(gait, parameters=values, turn=turn)


def fastest_of_cells() -> list[Gait]:
    """The fastest gait of each cell of the map, among all that were evaluated for it."""
    run = load_run(MAP)
    rows = run.evaluations[run.evaluations["relative_speed"] >= SET["slowest"]]
    cells = (SET["cells"] * rows.filter(like="lifted_T")).astype(int)
    fastest = rows.sort_values("relative_speed", ascending=False)
    first = fastest[~cells.loc[fastest.index].duplicated()]
    return [run.gait(*key) for key in first[["trial", "index"]].astype(int).to_numpy().tolist()]


def find_gaits() -> None:
    """Records the recorded gait and the gaits of the map."""
    if read(GAITS):
        return
    gaits = [load_run(WALKER).best_gait(), *fastest_of_cells()]
    append(GAITS, [{"name": gait.name, "parameters": {**gait.parameters}} for gait in gaits])


def possible_trials() -> list[Trial]:
    """All recorded gaits with all turns and strengths. The first one is the robot's before the
    damage."""
    known = [Gait(**row) for row in read(GAITS)]
    gaits = [steered(gait, turn) for gait in known for turn in SET["turns"]]
    return [Trial(gait, strength) for strength in SET["strengths"] for gait in gaits]


@functools.cache
def robots() -> list[Scenario]:
    """The disturbed robots."""
    disturbances = default_disturbances(scenario(), SET["percent"])
    drawn = scenario().with_changes({"disturbances": disturbances})
    return [disturbed(drawn, draw) for draw in fresh_draws(drawn, 0, SET["seeds"])]


def speed_of(walk: Outcome) -> Row:
    """Speed (body lengths/s) of a walk, for its record. A failed simulation has the speed 0."""
    if not isinstance(walk, SimulationResult):
        return {"failure": str(walk), "speed": 0.0}
    return {"speed": round(walk.metrics.relative_speed, DECIMALS)}


def place_of(walk: Outcome) -> Row:
    """Shares of time in the air and change of heading (rad) of a walk, for its record."""
    if not isinstance(walk, SimulationResult):
        return {"lifted_shares": [0.0] * 5, "heading_change": 0.0}
    shares = [round(share, DECIMALS) for share in walk.metrics.lifted_shares]
    return {"lifted_shares": shares, "heading_change": round(walk.metrics.heading_change, DECIMALS)}


# Trial and error


def describe(rows: Sequence[Row]) -> np.ndarray:
    """Places (gaits, 6) on the map: shares of time in the air of the five bodies, and change of
    heading as a share of the scale, of the whole robot."""
    shares = np.array([row["lifted_shares"] for row in rows])
    heading = np.array([row["heading_change"] for row in rows]) / math.radians(SET["most_turn"])
    return np.column_stack([shares, np.clip(heading, -1.0, 1.0)])


def likeness(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Matérn 5/2 kernel of places on the map, (n, 6) and (m, 6): a matrix (n, m)."""
    away = np.linalg.norm(one[:, np.newaxis] - other, axis=2) * math.sqrt(5.0) / SET["reach"]
    return (1.0 + away + away**2 / 3.0) * np.exp(-away)


def expected(
    places: np.ndarray, before: np.ndarray, tried: Sequence[int], speeds: Sequence[float]
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the speeds of all gaits, after some were tried.

    A Gaussian process of what the damage takes from the speeds `before` at the places on the map.
    """
    known = places[list(tried)]
    lost = np.array(speeds) - before[list(tried)]
    near, noise = likeness(known, places), SET["noise"] * np.eye(len(known))
    shares = np.linalg.solve(likeness(known, known) + noise, near)
    spread = 1.0 - (near * shares).sum(axis=0)
    return before + lost @ shares, np.sqrt(np.maximum(spread, 0.0))


def next_trial(
    places: np.ndarray, before: np.ndarray, tried: Sequence[int], speeds: Sequence[float]
) -> int | None:
    """Number of the gait to try next; None if the best one so far is good enough."""
    mean, spread = expected(places, before, tried, speeds)
    hoped = np.where(np.isin(np.arange(len(mean)), tried), -math.inf, mean)
    if len(tried) > SET["trials"] or max(speeds) >= SET["enough"] * hoped.max():
        return None
    return int(np.argmax(hoped + SET["bold"] * spread))


def find_candidates() -> None:
    """Records the walks of the gaits to try, on the whole and undisturbed robot."""
    known, batch = possible_trials(), SET["batch"]
    for first in range(len(read(CANDIDATES)), len(known), batch):
        some = known[first : first + batch]
        robots = [trial.on(scenario()) for trial in some]
        results = simulate_many(robots, [trial.gait for trial in some])
        append(CANDIDATES, [speed_of(each) | place_of(each) for each in results])
        print(f"{first + len(some)} of {len(known)} gaits on the whole robot", flush=True)


def due(walks: Sequence[Row], places: np.ndarray, before: np.ndarray) -> dict[str, int]:
    """By cable, the gait that a robot without it walks next, after `walks` with the same constants.

    The whole robot, without the name of a cable, walks with the recorded gait and with the fastest
    one. `before` are speeds of the gaits as shares of the recorded gait's speed.
    """
    unit = next((row["speed"] for row in walks if not row["cable"]), math.nan)
    gaits: dict[str, int | None] = {}
    for cable in ["", *scenario().whole_cables]:
        own = [row for row in walks if row["cable"] == cable]
        tried, speeds = [row["gait"] for row in own], [row["speed"] / unit for row in own]
        if not own:
            gaits[cable] = 0
        elif cable:
            gaits[cable] = next_trial(places, before, tried, speeds)
        elif len(own) == 1:
            gaits[cable] = int(np.argmax(before))
    return {cable: gait for cable, gait in gaits.items() if gait is not None}


def trials() -> None:
    """Records the walks of all robots: whole, damaged, and trial by trial."""
    candidates, known = read(CANDIDATES), possible_trials()
    places, speeds = describe(candidates), np.array([row["speed"] for row in candidates])
    for seed, robot in enumerate(robots()):
        walks = [row for row in read(WALKS) if row["seed"] == seed]
        while gaits := due(walks, places, speeds / speeds[0]):
            of_damaged = [known[number].on(robot, cable) for cable, number in gaits.items()]
            results = simulate_many(of_damaged, [known[number].gait for number in gaits.values()])
            rows = [
                {"seed": seed, "cable": cable, "gait": number, **speed_of(result)}
                for (cable, number), result in zip(gaits.items(), results, strict=True)
            ]
            append(WALKS, rows)
            walks += rows
            print(f"robot {seed}: {len(walks)} walks", flush=True)


# Planning


def plans() -> None:
    """Records walks of the undisturbed robot by a planner that knows of the damage: whole, and
    without each cable."""
    done = {row["cable"] for row in read(PLANS)}
    cables = sorted(scenario().whole_cables, key=lambda cable: cable.endswith("right"))
    for cable in ["", *cables]:
        if cable in done:
            continue
        before, *_ = possible_trials()
        robot = before.on(scenario(), cable).with_changes(SET["planned"])
        planner = Planner(robot, {"v_WN": [-1.0, 0.0, 0.0]}, **SET["planner"])
        if cable:
            planner.model.damage(0, cables=[cable])
        begin = time.process_time()
        period = SET["planner"]["control_period"]
        result = simulate(robot, controller=planner, control_period=period)
        work = (time.process_time() - begin) / planner.decisions
        append(PLANS, [{"cable": cable, **speed_of(result), "cpu_s": work}])
        print(f"planner: {len(read(PLANS))} walks", flush=True)


# Tables, the picture and the page


def group(cable: str) -> str:
    """Name of a cable and of the one on the other side."""
    return cable.removesuffix("_left").removesuffix("_right")


def outcomes(walks: Sequence[Row]) -> pandas.DataFrame:
    """Shares of the whole robot's speed for each disturbed robot and cable, by `group`: `lost` is
    with the old gait, `best0`, `best1`, ... with the best one of so many trials, `found` after all
    trials. `of_best` is the last one as a share of the speed of the map's fastest gait on the whole
    robot."""
    table = pandas.DataFrame(walks)
    whole = table[table["cable"] == ""].groupby("seed")["speed"].agg(["first", "last"])
    rows, counts = [], np.arange(SET["trials"] + 1)
    for (seed, cable), own in table[table["cable"] != ""].groupby(["seed", "cable"], sort=False):
        before, fastest = whole.loc[seed]
        best = np.maximum.accumulate(own["speed"].to_numpy() / before)
        row = {"group": group(cable), "lost": best[0], "found": best[-1]}
        row["of_best"] = best[-1] * before / fastest
        rows.append(row | {f"best{k}": best[min(k, len(best) - 1)] for k in counts})
    return pandas.DataFrame(rows)


def planned(rows: Sequence[Row]) -> pandas.DataFrame:
    """Shares by cable of the speed of the recorded gait on the whole robot that a planner
    reaches."""
    table = pandas.DataFrame(rows).assign(group=[group(row["cable"]) for row in rows])
    return table.assign(share=table["speed"] / read(CANDIDATES)[0]["speed"])


_PLANNER: Any = {"color": "black", "marker": "x", "linestyle": "", "markersize": 4.0}


@common_style()
def speed_figure(shares: pandas.DataFrame, plans: pandas.DataFrame) -> Figure:
    """Speed after damage and after trials by cable, and over the number of trials."""
    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    found = OKABE_ITO["blue"]
    looks = {"lost": ("old gait", OKABE_ITO["orange"], -0.15)}
    looks["found"] = ("after trials", found, 0.15)
    by_cable, by_trial = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    names = [*reversed(dict.fromkeys(shares["group"]))]
    heights = pandas.Series(range(len(names)), index=names, dtype=float)
    for column, (label, color, shift) in looks.items():
        own = shares.groupby("group")[column].agg(["median", "min", "max"]).loc[names]
        ends = own["median"] - own["min"], own["max"] - own["median"]
        points: Any = {"fmt": "o", "color": color, "markersize": 4.0, "label": label}
        by_cable.errorbar(own["median"], heights + shift, xerr=[*ends], **points)
    by_cable.plot(plans["share"], plans["group"].map(heights), label="planner", **_PLANNER)
    by_cable.set_yticks(heights, names, fontsize="small")
    by_cable.legend(frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.4, 1.0))
    by_cable.set(xlabel="speed / speed before the damage")
    by_cable.margins(x=0.03)
    counts = range(SET["trials"] + 1)
    quantiles = shares[[f"best{k}" for k in counts]].quantile([0.25, 0.5, 0.75]).to_numpy()
    shade = {"color": found, "alpha": 0.25, "linewidth": 0.0}
    by_trial.fill_between(counts, quantiles[0], quantiles[2], **shade)
    by_trial.plot(counts, quantiles[1], "o-", color=found, markersize=4.0)
    by_trial.axhline(SET["goal"], color="black", linestyle="--", linewidth=0.8)
    by_trial.set(xlabel="trials", ylabel="median and quartiles", ylim=(0.0, 1.6))
    by_trial.set_xticks(counts[::2])
    return figure


def page(walks: Sequence[Row], plan_rows: Sequence[Row], candidates: Sequence[Row]) -> str:
    """Text of the page."""
    tables = {"walks": walks, "gaits": candidates, "shares": outcomes(walks), "set": SET}
    steady = scenario().simulation.settling_time
    return rendered("damage.md", **tables, plans=planned(plan_rows), steady=steady)


@script
def main(_: Sequence[str] = ()) -> None:
    """Records what is missing, and writes the page and its figure."""
    find_gaits()
    find_candidates()
    trials()
    plans()
    walks, plan_rows = read(WALKS), read(PLANS)
    figure = speed_figure(outcomes(walks), planned(plan_rows))
    save_figure(figure, HERE, "speed", kinds=["svg"])
    write_whole(HERE / "README.md", page(walks, plan_rows, read(CANDIDATES)))
