"""Robustness of gaits: how far they walk if robot and surroundings differ from the model.

Gaits are simulated in draws of disturbances that evolution never uses.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import NoneType
from typing import Any

import pandas

from tetra_drake.engines.simulate import check_scenario, simulate_each
from tetra_drake.errors import check_type, check_whole
from tetra_drake.figures.style import (
    OKABE_ITO,
    REFERENCE,
    SHADE,
    Drawn,
    figure_function,
    folded,
    most_lines,
    name_panel,
    page_of,
    page_width,
    titled,
    write_beside,
)
from tetra_drake.formatting import TextTable, fixed, percents, ranged, render, rounded, signed
from tetra_drake.lab.page import save_findings
from tetra_drake.lab.study.statistics import interval, json_rows, share_interval
from tetra_drake.machine import threads_for, versions
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.robot.gait_file import GivenGait, given_gait
from tetra_drake.robot.parameter_space import with_body
from tetra_drake.scenario.disturbances import Draw, disturbed, fresh_draws
from tetra_drake.scenario.experiment_sections import Disturbances
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.metrics import METRICS, unmet_requirements
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.section import varied, written

NOTHING, ALL = "nothing", "all"
START, TERRAIN, CUTS = "displaced start", "terrain seed", "cut cables"
"""Names of the changes that are not scenario keys."""

PERCENT, DRAWS = 5.0, 200
ALONE = 8
"""Number of draws whose initial positions, terrain seed and cut cables are each also simulated as
the only disturbance."""

LOSS = 0.1
"""Largest loss of distance, as a share of the undisturbed distance, for which a gait "keeps" a
draw. The gait must also meet the requirements of the scenario in the draw."""

_Planned = tuple[dict[str, Any], Draw]
"""A draw, and its labels in the tables of Judgement."""

_DOTS: Any = {"color": OKABE_ITO["sky_blue"], "markersize": 2.0, "alpha": 0.4, "zorder": 0}
_LINE = {"color": OKABE_ITO["blue"], "linewidth": 1.2}
_BOX: Any = {
    "orientation": "horizontal",
    "widths": 0.6,
    "whis": (5, 95),
    "showfliers": False,
    "manage_ticks": False,
    **dict.fromkeys(("boxprops", "medianprops", "whiskerprops", "capprops"), _LINE),
}
_ROW = 0.22  # height of a row, in inches
_NAMES = 0.3  # largest width of the names, as a share of the page's width


@dataclass(frozen=True)
class Judgement:
    """Results of robustness(), simulations of gaits on disturbed robots: tables with one row per
    simulation.

    All tables have the columns gait (its key), failure (reason, or missing), missed (requirements
    of the scenario that are not met), fitness, and the metrics in SI. Fitness and metrics are NaN
    if the simulation failed.
    """

    scenario: Scenario
    """Scenario with the disturbances that the draws were made from."""
    seed: int
    undisturbed: pandas.DataFrame
    """A row per gait, simulated without disturbances."""
    draws: pandas.DataFrame
    """A row per gait and draw. Further columns: the number of the draw, and a factor for each key
    of the scenario's spreads."""
    alone: pandas.DataFrame
    """A row per gait and single change. More columns: what (a key, START, TERRAIN or CUTS),
    spread (the relative change of the key), draw (the draw that what is no key is taken from)."""

    def compared(self, table: pandas.DataFrame) -> pandas.DataFrame:
        """A copy of `table`, one of the tables of this Judgement, with three more columns:
        undisturbed (distance of the same gait without disturbances, m), change (distance minus
        undisturbed, m), kept (True if the gait loses at most 10 % of the undisturbed distance and
        meets the requirements)."""
        before = table["gait"].map(self.undisturbed.set_index("gait")["distance"])
        change = table["distance"] - before
        kept = (change >= -LOSS * before.abs()) & (table["missed"] == "")  # False where NaN
        return table.assign(undisturbed=before, change=change, kept=kept)


def default_disturbances(scenario: Scenario, percent: float = PERCENT) -> Disturbances:
    """Default disturbances: each uncertain number of a scenario gets a random factor within
    1 ± percent / 100. Each body starts displaced along each axis, by up to this share of the
    shortest strut. A number is uncertain if its setting is declared as Varied in the code."""
    share = percent / 100.0
    together: dict[str, list[str]] = {}
    for key, name in varied(scenario):
        together.setdefault(name or key, []).append(key)
    spreads = {", ".join(keys): share for keys in together.values()}
    return Disturbances(draws=1, spreads=spreads, start=share)


def robustness(
    scenario: GivenScenario,
    gaits: GivenGait | Mapping[Any, GivenGait],
    *,
    percent: float | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    alone: bool = True,
    workers: int | None = None,
) -> Judgement:
    """Simulates gaits on disturbed robots, with the compiled engine.

        >>> run = td.load_run("runs/demo")
        >>> judgement = td.robustness(run, run, draws=3)
        >>> distances = judgement.draws.distance
        >>> kept = judgement.compared(judgement.draws).kept.mean()

    A draw is one random change of the robot's numbers, initial positions and terrain. Each gait is
    simulated undisturbed and in all draws; the draws are the same for all gaits. No evolution uses
    these draws, whatever its seed.

    Args:
        scenario: a scenario, its name or file, or a run. Its disturbances are used, if it has any
            and `percent` is None.
        gaits: a gait, its file or a run (its best gait); or several of these by any key. The tables
            name gaits by the key.
        percent: size of the default disturbances in percent, used in place of the scenario's.
        draws: number of draws.
        seed: seed of the draws.
        alone: True to simulate also each disturbance alone.
        workers: number of threads, see simulate_many().

    Raises:
        InputError: if a gait is for another robot, or `percent` is too large for the scenario.
    """
    check_whole("robustness", "draws", draws, least=0)
    check_whole("robustness", "seed", seed, least=0)
    check_type("robustness", "alone", alone, bool)
    check_type("robustness", "percent", percent, numbers.Real, NoneType)
    scenario = given_scenario(scenario)
    if not isinstance(gaits, Mapping):
        gait = given_gait(gaits, scenario)
        gaits = {gait.name: gait}
    given = {key: given_gait(gait, scenario) for key, gait in gaits.items()}
    disturbances = scenario.disturbances
    if percent is not None:
        disturbances = default_disturbances(scenario, float(percent))
    elif disturbances is None:
        disturbances = default_disturbances(scenario)
    scenario = scenario.on_engine("compiled").with_changes({"disturbances": disturbances})
    fresh = fresh_draws(scenario, seed, draws)
    plan: list[_Planned] = [({"what": NOTHING}, Draw({}))]
    plan += [({"what": ALL, "draw": i, **draw.factors}, draw) for i, draw in enumerate(fresh)]

    if alone:
        for key, size in disturbances.spreads.items():
            for spread in (-size, size):
                plan.append(({"what": key, "spread": spread}, Draw({key: 1.0 + spread})))
        for i, draw in enumerate(fresh[:ALONE]):
            if draw.moves is not None:
                plan.append(({"what": START, "draw": i}, Draw({}, moves=draw.moves)))
            if draw.terrain_seed is not None:
                seeded = Draw({}, terrain_seed=draw.terrain_seed)
                plan.append(({"what": TERRAIN, "draw": i}, seeded))
            if draw.events:
                plan.append(({"what": CUTS, "draw": i}, Draw({}, events=draw.events)))

    walkers = {key: with_body(scenario, gait) for key, gait in given.items()}
    rows = _simulated(plan, walkers, threads_for(workers, source="robustness"))
    changed = [row for row in rows if row["what"] not in (NOTHING, ALL)]
    return Judgement(
        scenario=scenario,
        seed=seed,
        undisturbed=_table([row for row in rows if row["what"] == NOTHING]),
        draws=_table([row for row in rows if row["what"] == ALL], "draw", *disturbances.spreads),
        alone=_table(changed, "what", "spread", "draw"),
    )


def _simulated(
    plan: Sequence[_Planned], walkers: Mapping[Any, tuple[Scenario, Gait]], threads: int
) -> list[dict[str, Any]]:
    """Simulates each gait in each draw of disturbances. Returns a row per simulation: the labels of
    the draw, and the columns that all tables of Judgement have.

    `plan` has pairs: the labels of a draw by column, and the draw. `walkers` have the scenario with
    the gait's body, and the gait, by the key that the column `gait` gets.

    A robot that cannot start is a failure; it may have been displaced into a step of the terrain.
    """
    bodies = {id(own): own for own, _ in walkers.values()}
    for body in bodies.values():
        check_scenario(body, *(gait for own, gait in walkers.values() if own is body))
    rows: list[dict[str, Any]] = []
    walks: list[tuple[Scenario, Gait]] = []
    for labels, draw in plan:  # gaits share a scenario: the engine prepares it once
        changed = {place: disturbed(body, draw) for place, body in bodies.items()}
        rows += [{"gait": key, **labels, "failure": None, "missed": ""} for key in walkers]
        walks += [(changed[id(own)], gait) for own, gait in walkers.values()]
    results = simulate_each(walks, threads=threads)
    for row, (own, _), result in zip(rows, walks, results, strict=True):
        if isinstance(result, SimulationResult):
            row["missed"] = ", ".join(unmet_requirements(result.metrics, own.require))
            row |= {"fitness": result.fitness, **result.metrics.to_json()}
        else:
            row["failure"] = str(result)
    return rows


def _table(rows: list[dict[str, Any]], *labels: str) -> pandas.DataFrame:
    numbers = ["fitness", *METRICS]
    table = pandas.DataFrame(rows, columns=["gait", *labels, "failure", "missed", *numbers])
    return table.astype(dict.fromkeys(numbers, float))


def by_gait(judgement: Judgement) -> pandas.DataFrame:
    """Robustness of each gait: a table with a row per gait. Columns:

    - undisturbed: distance (m) without disturbances
    - 5 %, 25 %, 50 %, 75 %, 95 % (quantiles) and mean of the distance (m) over the draws that did
      not fail
    - kept: share of all draws where the gait loses at most 10 % of the undisturbed distance and
      meets the requirements of the scenario
    - mean_low, mean_high, kept_low, kept_high: 95 % confidence intervals
    - failed, missed: numbers of draws that failed, and that miss a requirement
    """
    rows = {}
    for gait, draws in judgement.compared(judgement.draws).groupby("gait", sort=False):
        distance, kept = draws["distance"], draws["kept"]
        row = {"undisturbed": draws["undisturbed"].iloc[0]}
        row |= {f"{share} %": distance.quantile(share / 100.0) for share in (5, 25, 50, 75, 95)}
        row["mean"], (row["mean_low"], row["mean_high"]) = distance.mean(), interval(distance)
        row["kept"] = kept.mean()
        row["kept_low"], row["kept_high"] = share_interval(int(kept.sum()), len(kept))
        row["failed"] = int(draws["failure"].notna().sum())
        row["missed"] = int((draws["missed"] != "").sum())
        rows[gait] = row
    return pandas.DataFrame.from_dict(rows, orient="index").rename_axis("gait")


def by_change(judgement: Judgement) -> pandas.DataFrame:
    """Effect of each disturbance on the distance: a table with a row per disturbed scenario key,
    and for the initial positions (start) and the terrain, the most harmful one first. Columns:

    - median: absolute change of the distance (m) by this change alone, median over the simulations
    - worst: most negative change of the distance (m); failed: number of failures
    - correlation: Spearman's rank correlation between the factor of a key and the distance over the
      draws of a gait that did not fail; mean over the gaits. NaN for start and terrain, and if all
      distances of a gait are equal
    - correlation_size: median over the gaits of the absolute value of the correlation
    """
    alone = judgement.compared(judgement.alone)
    alone = alone.assign(size=alone["change"].abs(), failed=alone["failure"].notna())
    table = alone.groupby("what", sort=False).agg(
        median=("size", "median"), worst=("change", "min"), failed=("failed", "sum")
    )
    settings = judgement.scenario.disturbances
    keys = list(settings.spreads) if settings else []
    walked = judgement.draws.dropna(subset="distance").groupby("gait", sort=False)
    ranks = pandas.DataFrame(
        [draws[["distance", *keys]].corr("spearman").loc["distance", keys] for _, draws in walked],
        columns=keys,
    )
    table["correlation"], table["correlation_size"] = ranks.mean(), ranks.abs().median()
    return table.sort_values("median", ascending=False, na_position="first", kind="stable")


def chance(draws: int) -> float:
    """Largest absolute value of a rank correlation that is likely by chance with this number of
    draws: 95 % of the correlations between unrelated numbers, one pair per draw, are smaller."""
    return min(1.0, 1.96 / math.sqrt(max(draws - 1, 1)))


def robustness_text(judgement: Judgement) -> str:
    """Text for the terminal: tables of the distances of gaits on disturbed robots, and of the most
    harmful disturbances."""
    units, requires = judgement.scenario.units, bool(judgement.scenario.require)
    shown, counts = ["undisturbed", "5 %", "50 %", "95 %"], ["failed", *["missed"] * requires]
    gaits, changes = [], []
    for gait, row in by_gait(judgement).iterrows():
        lengths = row / units.length
        mean = ranged(lengths["mean"], lengths["mean_low"], lengths["mean_high"])
        robust = percents(row["kept"], row["kept_low"], row["kept_high"])
        cells = [str(gait), *map(rounded, lengths[shown]), mean, robust]
        gaits.append([*cells, *(f"{row[count]:.0f}" for count in counts)])
    digits = units.decimals + 1
    for what, row in by_change(judgement).iterrows():
        lengths = row[["median", "worst"]] / units.length
        cells = [str(what), fixed(lengths["median"], digits), signed(lengths["worst"], digits)]
        has_none = math.isnan(row["correlation"])
        both = signed(row["correlation"]), fixed(row["correlation_size"])
        changes.append([*cells, f"{row['failed']:.0f}", *(["", ""] if has_none else both)])
    headings = ["disturbance", "median change", "worst", "failed", "correlation", "|correlation|"]
    return render(
        "lab/study/robustness.txt.jinja",
        units=units,
        draws=judgement.draws["draw"].nunique(),
        loss=f"{100.0 * LOSS:g}",
        requires=requires,
        gaits=TextTable(["gait", *shown, "mean", "robust", *counts], gaits),
        chance=chance,
        changes=TextTable(headings, changes),
    )


def save_judgement(judgement: Judgement, folder: Path) -> list[str]:
    """Writes draws.csv and alone.csv (all simulations, SI), summary.json and the figure to a
    folder. The summary has the tables of by_gait() and by_change(), in SI, and how they were made.

    Returns the names of the files. Raises InputError if a file cannot be written.
    """
    given = {"draws": judgement.draws, "alone": judgement.alone}
    tables = {name: judgement.compared(table) for name, table in given.items()}
    summary = {
        "versions": versions(),
        "scenario": judgement.scenario.name,
        "disturbances": written(judgement.scenario.model_dump()["disturbances"]),
        "draws": int(judgement.draws["draw"].nunique()),
        "seed": judgement.seed,
        "gaits": json_rows(by_gait(judgement)),
        "changes": json_rows(by_change(judgement)),
    }
    figure = robustness_figure(judgement)
    return save_findings(figure, folder, "robustness", tables=tables, summary=summary)


@figure_function
def robustness_figure(judgement: Judgement) -> Drawn:
    """Robustness of gaits on disturbed robots.

    Above: the distance in each draw divided by the undisturbed distance. Boxes are quartiles,
    whiskers 5 to 95 %. The dashed line is the least distance that counts as kept. The share
    of draws beyond it is at the right; the gait with the largest share is on top.

    Below left: one change alone. Bars are the median change of distance, lines the greatest loss.
    Below right: all changes together. Bars are the rank correlation of each change with the
    distance, without sign. A bar that ends in the grey may be chance."""
    unit = judgement.scenario.units
    gaits = by_gait(judgement).sort_values("kept", kind="stable")
    changes, count = by_change(judgement).iloc[::-1], judgement.draws["draw"].nunique()
    width = _NAMES * page_width()
    names = [folded(str(name), width) for name in gaits.index]
    what = [folded(str(name), width) for name in changes.index]
    rows = [max(most_lines(texts) * len(texts) + 1, 4) for texts in (names, what)]
    page = page_of(height_in=_ROW * sum(rows) + 1.8)
    places: Any = [["distances", "distances"], ["alone", "together"]]
    panels = page.subplot_mosaic(places, height_ratios=rows)
    above, alone, together = panels["distances"], panels["alone"], panels["together"]

    draws = judgement.compared(judgement.draws).dropna(subset=["distance", "undisturbed"])
    for row, (gait, kept) in enumerate(gaits["kept"].items()):
        simulated = draws[draws["gait"] == gait]
        shares = simulated["distance"] / simulated["undisturbed"]
        # Multiples of the golden ratio spread any number of dots evenly.
        heights = row + 0.6 * (simulated["draw"] * 0.618034 % 1.0 - 0.5)
        above.plot(shares, heights, "o", **_DOTS)
        above.boxplot(shares, positions=[row], **_BOX)
        write_beside(above, row, f"{fixed(100.0 * kept, 0)} %")
    above.axvline(1.0 - LOSS, **REFERENCE)
    above.axvline(1.0, color="black", linewidth=0.8)
    margin = max(0.7, 2.5 - len(gaits) / 2)  # a single gait has a thin box, too
    y_range = -margin, len(gaits) - 1 + margin
    above.set(xlabel="distance / undisturbed distance", xmargin=0.02, ylim=y_range)
    name_panel(above, "distance in each draw")
    above.set_title("draws kept", loc="right", fontsize="medium", pad=3.0)
    above.grid(visible=False, axis="y")
    above.set_yticks(range(len(names)), names)

    places, worst = range(len(what)), changes["worst"].clip(upper=0.0).abs() / unit.length
    alone.hlines(places, 0.0, worst, color="black", linewidth=1.0)
    alone.barh(places, changes["median"] / unit.length, height=0.6, color=OKABE_ITO["orange"])
    together.axvspan(0.0, chance(count), color=SHADE, linewidth=0.0, zorder=0)
    together.barh(places, changes["correlation_size"], height=0.6, color=OKABE_ITO["sky_blue"])
    for axes, name, label in (
        (alone, "one change alone", f"change of distance ({unit.length_name})"),
        (together, "all changes together", "size of rank correlation"),
    ):
        name_panel(axes, name)
        axes.set(xlabel=folded(label, width), xmargin=0.05, ylim=(-0.7, len(what) - 0.3))
        axes.set_xlim(left=0.0)
        axes.grid(visible=False, axis="y")
        axes.set_yticks(places, what)
    together.tick_params(labelleft=False)
    return titled(page, f"Robustness under {count} draws of disturbances")
