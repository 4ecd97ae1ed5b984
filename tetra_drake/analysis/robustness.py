"""Robustness of gaits, judged on fresh draws: how far they walk when robot and surroundings differ
from the model."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tetra_drake.analysis.statistics import interval, share_interval
from tetra_drake.engines.simulate import check_scenario, simulate_many
from tetra_drake.errors import InputError, SimulationFailure
from tetra_drake.files import json_number
from tetra_drake.machine import versions
from tetra_drake.results.metrics import unmet_requirements
from tetra_drake.results.result import SimulationResult
from tetra_drake.robot.gait import Gait
from tetra_drake.scenario.disturbances import Draw, disturbed, fresh_draws
from tetra_drake.scenario.metric_units import METRICS
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.sections import tree_of
from tetra_drake.scenario.settings import Disturbances, separate

if TYPE_CHECKING:
    import pandas

NOTHING, ALL = "nothing", "all"
START, TERRAIN = "displaced start", "terrain seed"
"""Names of changes beside the keys of the scenario's spreads."""

SPREAD = (
    *("robot.spacing", "friction.stiction_range", "friction.stiction_damping"),
    *("friction.stiction_switch", "friction.proportional_stiction"),
    *("friction.static, friction.kinetic", "friction.damping"),
    *("cables.outer_stiffness", "cables.inner_stiffness", "ground.stiffness", "ground.damping"),
)
"""The keys that the default disturbances spread, where the scenario has them."""

PERCENT, DRAWS = 5.0, 200
ALONE = 8
"""Draws of which the displaced start, or the terrain seed, is also simulated alone."""

LOSS = 0.1
"""A gait keeps a draw in which it loses at most this share of its undisturbed distance, and misses
none of the scenario's requirements."""

QUANTILES = {"5 %": 0.05, "25 %": 0.25, "50 %": 0.5, "75 %": 0.75, "95 %": 0.95}


@dataclass(frozen=True)
class Judgement:
    """Simulations of judge().

    All tables have the columns gait (its key), failure (None where there is none), missed (the
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
    """Default disturbances: so many percent for keys of SPREAD in the scenario, and for starts."""
    share = percent / 100.0
    return Disturbances(
        draws=1,
        spreads={joined: share for joined in SPREAD if _has(scenario, separate(joined)[0])},
        start=share,
    )


def _has(scenario: Scenario, key: str) -> bool:
    section, _, name = key.partition(".")
    return hasattr(getattr(scenario, section), name)


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
    changes: dict[str, Any] = {"engine": "!Compiled"}
    if scenario.disturbances is None or percent is not None:
        changes["disturbances"] = default_disturbances(scenario, percent or PERCENT)
    scenario = scenario.with_changes(changes)
    settings = scenario.disturbances
    assert settings is not None
    fresh = fresh_draws(scenario, seed, draws)
    plan: list[tuple[dict[str, Any], Draw]] = [({"what": NOTHING}, Draw({}))]
    plan += [({"what": ALL, "draw": i, **draw.factors}, draw) for i, draw in enumerate(fresh)]
    plan += _alone(settings, fresh) if alone else []
    outcomes = _outcomes(scenario, [draw for _, draw in plan], gaits, workers=workers)
    labels = [{"gait": key} | label for label, _ in plan for key in gaits]
    rows = [a | b for a, b in zip(labels, outcomes, strict=True)]
    return Judgement(
        scenario=scenario,
        seed=seed,
        undisturbed=_table([row for row in rows if row["what"] == NOTHING]),
        draws=_table([row for row in rows if row["what"] == ALL], "draw", *settings.spreads),
        alone=_table(
            [row for row in rows if row["what"] not in (NOTHING, ALL)], "what", "spread", "draw"
        ),
    )


def _alone(settings: Disturbances, fresh: Sequence[Draw]) -> Iterator[tuple[dict[str, Any], Draw]]:
    """Each change alone, with its labels."""
    for key, size in settings.spreads.items():
        for spread in (-size, size):
            yield {"what": key, "spread": spread}, Draw({key: 1.0 + spread})
    for i, draw in enumerate(fresh[:ALONE]):
        if draw.moves is not None:
            yield {"what": START, "draw": i}, Draw({}, moves=draw.moves)
        if draw.terrain_seed is not None:
            yield {"what": TERRAIN, "draw": i}, Draw({}, terrain_seed=draw.terrain_seed)


def _outcomes(
    scenario: Scenario, draws: Sequence[Draw], gaits: Mapping[Any, Gait], **options: Any
) -> Iterator[dict[str, Any]]:
    """The columns that simulations fill, for each draw and gait."""
    check_scenario(scenario)
    # One scenario for all gaits: the engine prepares it once.
    changed = [disturbed(scenario, draw) for draw in draws]
    refusals = [_refusal(scenario) for scenario in changed]
    able = [scenario for scenario, refusal in zip(changed, refusals, strict=True) if not refusal]
    scenarios = [scenario for scenario in able for _ in gaits]
    walking = [*gaits.values()] * len(able)
    results = iter(simulate_many(scenario=scenarios, gaits=walking, **options))
    for refusal in refusals:
        for _ in gaits:
            yield _outcome(refusal or next(results), scenario.require)


def _refusal(scenario: Scenario) -> InputError | None:
    """Why a robot cannot start, such as one displaced into a step of the terrain."""
    try:
        check_scenario(scenario)
    except InputError as error:
        return error
    return None


def _outcome(
    result: SimulationResult | SimulationFailure | InputError, require: Mapping[str, float]
) -> dict[str, Any]:
    if not isinstance(result, SimulationResult):
        return {"failure": str(result), "missed": ""}
    missed = ", ".join(unmet_requirements(result.metrics, require))
    return {"missed": missed, "fitness": result.fitness} | result.metrics.to_json()


def _table(rows: list[dict[str, Any]], *labels: str) -> pandas.DataFrame:
    import pandas

    numbers = ["fitness", *METRICS]
    table = pandas.DataFrame(rows, columns=["gait", *labels, "failure", "missed", *numbers])
    table["failure"] = table["failure"].astype(object).where(table["failure"].notna(), None)
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
    tables = {"gaits": by_gait, "changes": by_change}
    return {
        "versions": versions(),
        "scenario": judgement.scenario.name,
        "disturbances": tree_of(judgement.scenario)["disturbances"],
        "draws": int(judgement.draws["draw"].nunique()),
        "seed": judgement.seed,
    } | {
        name: [
            {key: json_number(value) for key, value in row.items()}
            for row in make(judgement).reset_index().to_dict("records")
        ]
        for name, make in tables.items()
    }


def chance(draws: int) -> float:
    """The size that 95 % of the rank correlations of unrelated numbers do not reach."""
    return min(1.0, 1.96 / math.sqrt(max(draws - 1, 1)))
