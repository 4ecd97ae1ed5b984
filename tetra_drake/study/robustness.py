"""Robustness of gaits: how far they walk if robot and surroundings differ from the model.

Gaits are simulated on draws of disturbances that evolution never uses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tetra_drake.study.statistics import interval, json_rows, share_interval
from tetra_drake.engines.simulate import check_scenario, simulate_many
from tetra_drake.errors import InputError
from tetra_drake.machine import versions
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait, GivenGait, given_gait
from tetra_drake.scenario.common_sections import Disturbances
from tetra_drake.scenario.disturbances import Draw, disturbed, fresh_draws
from tetra_drake.scenario.load import GivenScenario, given_scenario
from tetra_drake.scenario.metrics import METRICS, unmet_requirements
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.settings.section import varied, written

if TYPE_CHECKING:
    import pandas

NOTHING, ALL = "nothing", "all"
START, TERRAIN = "displaced start", "terrain seed"
"""Names of the changes that are not keys of the scenario's spreads."""

PERCENT, DRAWS = 5.0, 200
ALONE = 8
"""Number of draws whose initial positions and terrain seed are also simulated as the only
disturbance."""

LOSS = 0.1
"""Largest loss of distance, as a share of the undisturbed distance, with which a gait keeps a draw.
The gait must also meet the scenario's requirements in the draw."""

_Planned = tuple[dict[str, Any], Draw]
"""Labels of a draw in the tables of Judgement, and the draw."""

QUANTILES = {"5 %": 0.05, "25 %": 0.25, "50 %": 0.5, "75 %": 0.75, "95 %": 0.95}


@dataclass(frozen=True)
class Judgement:
    """Result of robustness(): tables with one row per simulation.

    All tables have the columns gait (its key), failure (reason, or missing), missed (requirements
    of the scenario that are not met), fitness, and the metrics in SI. Fitness and metrics are NaN
    if the simulation failed.
    """

    scenario: Scenario
    """Scenario with the disturbances that the draws are made of."""
    seed: int
    undisturbed: pandas.DataFrame
    """A row per gait, simulated without disturbances."""
    draws: pandas.DataFrame
    """A row per gait and draw. Further columns: the number of the draw, and a factor for each key
    of the scenario's spreads."""
    alone: pandas.DataFrame
    """A row per gait and single change. More columns: what (a key, START or TERRAIN), spread (the
    relative change of the key), draw (the draw that start or terrain seed are taken from)."""

    def compared(self, table: pandas.DataFrame) -> pandas.DataFrame:
        """A table with three more columns: undisturbed (distance without disturbances), change
        (difference of the distance to it), kept (see LOSS)."""
        before = table["gait"].map(self.undisturbed.set_index("gait")["distance"])
        change = table["distance"] - before
        kept = (change >= -LOSS * before.abs()) & (table["missed"] == "")  # False where NaN
        return table.assign(undisturbed=before, change=change, kept=kept)


def default_disturbances(scenario: Scenario, percent: float = PERCENT) -> Disturbances:
    """Default disturbances: a spread of `percent` for all numbers marked as Varied, and for the
    initial positions."""
    share = percent / 100.0
    together: dict[str, list[str]] = {}
    for key, name in varied(scenario):
        together.setdefault(name or key, []).append(key)
    spreads = {", ".join(keys): share for keys in together.values()}
    return Disturbances(draws=1, spreads=spreads, start=share)


def robustness(
    scenario: GivenScenario,
    gaits: Mapping[Any, GivenGait],
    *,
    percent: float | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    alone: bool = True,
    workers: int | None = None,
) -> Judgement:
    """Simulates gaits on disturbed robots, with the compiled engine.

        >>> run = td.load_run("runs/demo")
        >>> judgement = td.robustness(run, {"best": run}, draws=3)
        >>> distances = judgement.draws.distance
        >>> kept = judgement.compared(judgement.draws).kept.mean()

    Each gait is simulated undisturbed and in all draws; the draws are the same for all gaits. No
    evolution uses these draws, whatever its seed.

    Args:
        scenario: a scenario, its name or file, or a run. Its disturbances are used, if it has any
            and `percent` is None.
        gaits: gaits, files or runs, by any key.
        percent: size of the default disturbances.
        draws: number of draws.
        seed: seed of the draws.
        alone: also simulates each change alone.
        workers: number of threads, see simulate_many().

    Raises:
        InputError: if a gait is for another robot, or `percent` is too large for the scenario.
    """
    scenario = given_scenario(scenario)
    walkers = {key: given_gait(gait, scenario) for key, gait in gaits.items()}
    disturbances = scenario.disturbances
    if disturbances is None or percent is not None:
        disturbances = default_disturbances(scenario, percent or PERCENT)
    scenario = scenario.on_engine("compiled").with_changes({"disturbances": disturbances})
    fresh = fresh_draws(scenario, seed, draws)
    plan: list[_Planned] = [({"what": NOTHING}, Draw({}))]
    plan += [({"what": ALL, "draw": i, **draw.factors}, draw) for i, draw in enumerate(fresh)]
    if alone:
        plan += _alone(disturbances, fresh)
    rows = _simulated(scenario, plan, walkers, workers)
    changed = [row for row in rows if row["what"] not in (NOTHING, ALL)]
    return Judgement(
        scenario=scenario,
        seed=seed,
        undisturbed=_table([row for row in rows if row["what"] == NOTHING]),
        draws=_table([row for row in rows if row["what"] == ALL], "draw", *disturbances.spreads),
        alone=_table(changed, "what", "spread", "draw"),
    )


def _alone(disturbances: Disturbances, fresh: Sequence[Draw]) -> Iterator[_Planned]:
    """Draws with a single change each: the keys up and down, then starts and terrain seeds."""
    for key, size in disturbances.spreads.items():
        for spread in (-size, size):
            yield {"what": key, "spread": spread}, Draw({key: 1.0 + spread})
    for i, draw in enumerate(fresh[:ALONE]):
        if draw.moves is not None:
            yield {"what": START, "draw": i}, Draw({}, moves=draw.moves)
        if draw.terrain_seed is not None:
            yield {"what": TERRAIN, "draw": i}, Draw({}, terrain_seed=draw.terrain_seed)


def _simulated(
    scenario: Scenario, plan: Sequence[_Planned], gaits: Mapping[Any, Gait], workers: int | None
) -> list[dict[str, Any]]:
    """Simulates each gait in each draw of the plan. A row has the labels of the draw and the common
    columns of Judgement.

    A robot that cannot start is a failure; it may have been displaced into a step of the terrain.
    """
    check_scenario(scenario)
    rows: list[dict[str, Any]] = []
    walking: list[tuple[dict[str, Any], Scenario, Gait]] = []
    for labels, draw in plan:
        changed = disturbed(scenario, draw)  # shared by all gaits: the engine prepares it once
        refusal = None
        try:
            check_scenario(changed)
        except InputError as error:
            refusal = str(error)
        for key, gait in gaits.items():
            row = {"gait": key, **labels, "failure": refusal, "missed": ""}
            rows.append(row)
            if refusal is None:
                walking.append((row, changed, gait))
    results = simulate_many(
        scenario=[changed for _, changed, _ in walking],
        gaits=[gait for _, _, gait in walking],
        workers=workers,
    )
    for (row, _, _), result in zip(walking, results, strict=True):
        if isinstance(result, SimulationResult):
            row["missed"] = ", ".join(unmet_requirements(result.metrics, scenario.require))
            row |= {"fitness": result.fitness, **result.metrics.to_json()}
        else:
            row["failure"] = str(result)
    return rows


def _table(rows: list[dict[str, Any]], *labels: str) -> pandas.DataFrame:
    import pandas

    numbers = ["fitness", *METRICS]
    table = pandas.DataFrame(rows, columns=["gait", *labels, "failure", "missed", *numbers])
    return table.astype(dict.fromkeys(numbers, float))


def by_gait(judgement: Judgement) -> pandas.DataFrame:
    """Summary of a judgement with a row per gait. Columns:

    - undisturbed: distance (m) without disturbances
    - QUANTILES and mean of the distance (m) over the draws that did not fail
    - kept: share of all draws that the gait keeps
    - mean_low, mean_high, kept_low, kept_high: 95 % confidence intervals
    - failed, missed: numbers of draws that failed, and that miss a requirement
    """
    import pandas

    rows = {}
    for gait, draws in judgement.compared(judgement.draws).groupby("gait", sort=False):
        distance, kept = draws["distance"], draws["kept"]
        row = {"undisturbed": draws["undisturbed"].iloc[0]}
        row |= {name: distance.quantile(share) for name, share in QUANTILES.items()}
        row["mean"] = distance.mean()
        row["mean_low"], row["mean_high"] = interval(distance)
        row["kept"] = kept.mean()
        row["kept_low"], row["kept_high"] = share_interval(int(kept.sum()), len(kept))
        row["failed"] = int(draws["failure"].notna().sum())
        row["missed"] = int((draws["missed"] != "").sum())
        rows[gait] = row
    return pandas.DataFrame.from_dict(rows, orient="index").rename_axis("gait")


def by_change(judgement: Judgement) -> pandas.DataFrame:
    """Summary of a judgement with a row per change, the most harmful change first. Columns:

    - median: absolute change of the distance (m) by this change alone, median over the simulations
    - worst: most negative change of the distance; failed: number of failures
    - correlation: mean over gaits of the rank correlation with the distance, see
      rank_correlations(); correlation_size: median of its absolute value. Both are NaN for start
      and terrain.
    """
    alone = judgement.compared(judgement.alone)
    alone = alone.assign(size=alone["change"].abs(), failed=alone["failure"].notna())
    table = alone.groupby("what", sort=False).agg(
        median=("size", "median"), worst=("change", "min"), failed=("failed", "sum")
    )
    ranks = rank_correlations(judgement)
    table["correlation"], table["correlation_size"] = ranks.mean(), ranks.abs().median()
    return table.sort_values("median", ascending=False, na_position="first", kind="stable")


def rank_correlations(judgement: Judgement) -> pandas.DataFrame:
    """Spearman's correlation between factor and distance, with a row per gait and a column per
    factor. Failed draws are left out. NaN if all distances are equal."""
    import pandas

    settings = judgement.scenario.disturbances
    keys = list(settings.spreads) if settings else []
    rows = {
        gait: draws[["distance", *keys]].corr(method="spearman").loc["distance", keys]
        for gait, draws in judgement.draws.dropna(subset="distance").groupby("gait", sort=False)
    }
    return pandas.DataFrame.from_dict(rows, orient="index", columns=keys)


def robustness_numbers(judgement: Judgement) -> dict[str, Any]:
    """Content of summary.json, in SI: the tables of gaits and changes, and their origin."""
    return {
        "versions": versions(),
        "scenario": judgement.scenario.name,
        "disturbances": written(judgement.scenario.model_dump()["disturbances"]),
        "draws": int(judgement.draws["draw"].nunique()),
        "seed": judgement.seed,
        "gaits": json_rows(by_gait(judgement)),
        "changes": json_rows(by_change(judgement)),
    }


def chance(draws: int) -> float:
    """Limit below which 95 % of the rank correlations of unrelated numbers lie, in absolute
    value."""
    return min(1.0, 1.96 / math.sqrt(max(draws - 1, 1)))
