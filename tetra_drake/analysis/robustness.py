"""Robustness of gaits, judged on fresh draws: how far they walk when robot and surroundings differ
from the model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tetra_drake.analysis.statistics import interval, json_rows, share_interval
from tetra_drake.engines.simulate import check_scenario, simulate_many
from tetra_drake.errors import InputError
from tetra_drake.machine import versions
from tetra_drake.results.metrics import unmet_requirements
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.common_sections import Disturbances
from tetra_drake.scenario.disturbances import Draw, disturbed, fresh_draws
from tetra_drake.scenario.metrics import METRICS
from tetra_drake.scenario.scenario import Scenario
from tetra_drake.scenario.section import varied, written

if TYPE_CHECKING:
    import pandas

NOTHING, ALL = "nothing", "all"
START, TERRAIN = "displaced start", "terrain seed"
"""Names of changes beside the keys of the scenario's spreads."""

PERCENT, DRAWS = 5.0, 200
ALONE = 8
"""Draws of which the displaced start, or the terrain seed, is also simulated alone."""

LOSS = 0.1
"""A gait keeps a draw in which it loses at most this share of its undisturbed distance, and misses
none of the scenario's requirements."""

_Planned = tuple[dict[str, Any], Draw]
"""A draw with its labels in Judgement's tables."""

QUANTILES = {"5 %": 0.05, "25 %": 0.25, "50 %": 0.5, "75 %": 0.75, "95 %": 0.95}


@dataclass(frozen=True)
class Judgement:
    """Simulations of judge().

    All tables have the columns gait (its key), failure (missing where there is none), missed (the
    scenario's requirements that are not met), fitness and the metrics (distance ...) in SI, NaN
    where the simulation failed.
    """

    scenario: Scenario
    """Scenario with the disturbances of the draws."""
    seed: int
    undisturbed: pandas.DataFrame
    """A row per gait."""
    draws: pandas.DataFrame
    """A row per gait and draw. Also: draw, and a factor by each key of the scenario's spreads."""
    alone: pandas.DataFrame
    """A row per gait and single change. Also: what (a key, START or TERRAIN), spread (of a key, of
    either sign), draw (whose start or seed it is)."""

    def compared(self, table: pandas.DataFrame) -> pandas.DataFrame:
        """A table with more columns: undisturbed (distance), change (of the distance), kept."""
        before = table["gait"].map(self.undisturbed.set_index("gait")["distance"])
        change = table["distance"] - before
        kept = (change >= -LOSS * before.abs()) & (table["missed"] == "")  # False where NaN
        return table.assign(undisturbed=before, change=change, kept=kept)


def default_disturbances(scenario: Scenario, percent: float = PERCENT) -> Disturbances:
    """Default disturbances: so many percent for numbers marked as Varied, and for starts."""
    share = percent / 100.0
    together: dict[str, list[str]] = {}
    for key, name in varied(scenario):
        together.setdefault(name or key, []).append(key)
    spreads = {", ".join(keys): share for keys in together.values()}
    return Disturbances(draws=1, spreads=spreads, start=share)


def judge(
    scenario: Scenario,
    gaits: Mapping[Any, Gait],
    *,
    percent: float | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    alone: bool = True,
    workers: int | None = None,
) -> Judgement:
    """Simulates gaits on the compiled engine: undisturbed, under fresh draws of the scenario's
    disturbances, the same for all gaits, and, if `alone`, under each change alone.

    Without disturbances in the scenario, or with `percent`, they are the default ones. No evolution
    ever sees these draws, whatever its seed. `workers` are those of simulate_many().

    Raises InputError where a gait is for another robot, or percent too large for the scenario.
    """
    disturbances = scenario.disturbances
    if disturbances is None or percent is not None:
        disturbances = default_disturbances(scenario, percent or PERCENT)
    scenario = scenario.with_changes({"engine": "!Compiled", "disturbances": disturbances})
    fresh = fresh_draws(scenario, seed, draws)
    plan: list[_Planned] = [({"what": NOTHING}, Draw({}))]
    for i, draw in enumerate(fresh):
        plan.append(({"what": ALL, "draw": i, **draw.factors}, draw))
    if alone:
        plan += _alone(disturbances, fresh)
    rows = _simulated(scenario, plan, gaits, workers)
    return Judgement(
        scenario=scenario,
        seed=seed,
        undisturbed=_table([row for row in rows if row["what"] == NOTHING]),
        draws=_table([row for row in rows if row["what"] == ALL], "draw", *disturbances.spreads),
        alone=_table(
            [row for row in rows if row["what"] not in (NOTHING, ALL)], "what", "spread", "draw"
        ),
    )


def _alone(disturbances: Disturbances, fresh: Sequence[Draw]) -> Iterator[_Planned]:
    """Each change alone."""
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
    """A row for each draw of the plan and gait: labels and what Judgement's tables have in common.

    A robot that cannot start, such as one displaced into a step of the terrain, is a failure.
    """
    check_scenario(scenario)
    rows: list[dict[str, Any]] = []
    walking: list[tuple[dict[str, Any], Scenario, Gait]] = []
    for labels, draw in plan:
        changed = disturbed(scenario, draw)  # one for all gaits: the engine prepares it once
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
            row["fitness"] = result.fitness
            row |= result.metrics.to_json()
        else:
            row["failure"] = str(result)
    return rows


def _table(rows: list[dict[str, Any]], *labels: str) -> pandas.DataFrame:
    import pandas

    numbers = ["fitness", *METRICS]
    table = pandas.DataFrame(rows, columns=["gait", *labels, "failure", "missed", *numbers])
    return table.astype(dict.fromkeys(numbers, float))


def by_gait(judgement: Judgement) -> pandas.DataFrame:
    """A row per gait: undisturbed, QUANTILES and mean of the distance (m) under the draws, without
    those that failed; kept (share of all draws); mean_low, mean_high, kept_low and kept_high (95 %
    confidence intervals); failed and missed (draws that failed, or with too little of a required
    metric)."""
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
    """A row per change, first what hurts most alone.

    Columns: median (of the absolute change of the distance, m, over gaits and signs or draws),
    worst (change) and failed (simulations) alone; correlation (mean over gaits of those of
    rank_correlations()) and correlation_size (median over gaits of their absolute value), NaN where
    nothing is scaled.
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
    """Spearman's correlation of each factor (columns) and the distance over the draws of a gait
    (index) without those that failed; NaN where all distances are the same."""
    import pandas

    settings = judgement.scenario.disturbances
    keys = list(settings.spreads) if settings else []
    rows = {
        gait: draws[["distance", *keys]].corr(method="spearman").loc["distance", keys]
        for gait, draws in judgement.draws.dropna(subset="distance").groupby("gait", sort=False)
    }
    return pandas.DataFrame.from_dict(rows, orient="index", columns=keys)


def robustness_numbers(judgement: Judgement) -> dict[str, Any]:
    """The content of summary.json, in SI: gaits and changes, and what they are of."""
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
    """The size that 95 % of the rank correlations of unrelated numbers do not reach."""
    return min(1.0, 1.96 / math.sqrt(max(draws - 1, 1)))
