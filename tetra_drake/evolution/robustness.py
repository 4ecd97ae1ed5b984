"""Robustness of gaits: how far they walk with the robot or its surroundings slightly changed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tetra_drake.engines.simulate import simulate_many
from tetra_drake.errors import SimulationFailure
from tetra_drake.evolution.tables import load_run
from tetra_drake.files import write_whole
from tetra_drake.formatting import fixed, signed
from tetra_drake.robot.gait import Gait, load_gait
from tetra_drake.scenario.load import load_scenario
from tetra_drake.scenario.perturb import displaced, scaled
from tetra_drake.scenario.schema import Scenario
from tetra_drake.scenario.units import INCH

if TYPE_CHECKING:
    import pandas

NOTHING = "nothing"
"""What is changed in the simulations that the others are compared with."""

SCALED = {
    "initial spacing": ("robot.spacing",),
    "stiction range p₀": ("friction.stiction_range",),
    "stiction damping σ₁": ("friction.stiction_damping",),
    "stiction switch a_c": ("friction.stiction_switch",),
    "proportional stiction σ₀": ("friction.proportional_stiction",),
    "friction coefficients μ": ("friction.static", "friction.kinetic"),
    "friction damping c": ("friction.damping",),
    "outer cables' stiffness": ("cables.outer_stiffness",),
    "inner cables' stiffness": ("cables.inner_stiffness",),
    "all cables' stiffness": ("cables.outer_stiffness", "cables.inner_stiffness"),
    "ground stiffness k": ("ground.stiffness",),
    "ground damping λ": ("ground.damping",),
}
"""Changes that multiply scenario keys by 1 + percent / 100, where the scenario has them."""

DISPLACED = "initial place of each tetrahedron"
"""The change that displaces every tetrahedron at random by at most percent of the spacing."""

PERCENTS = (2.0, 5.0)
DRAWS = 5
"""Displaced starts per percentage."""

KEPT = 0.9
"""A gait counts as kept under a change where it walks this share of its distance or more."""


def gaits_of(source: Path, *, scenario: str | None = None) -> tuple[Scenario, dict[Any, Gait]]:
    """The gait of a file, or the best gait of each trial of a run, and the scenario to use: this
    one, a name or file, instead of the run's, or the thesis's for a gait file."""
    if not source.is_dir():
        loaded = load_scenario(scenario or "thesis")
        gait = load_gait(source, loaded)
        return loaded, {gait.name: gait}
    run = load_run(source)
    run.fittest()  # raises InputError if there is none
    loaded = load_scenario(scenario) if scenario else run.manifest.scenario
    best = run.best()[["trial", "index"]].to_numpy()
    return loaded, {f"trial {trial}": run.gait(trial, index) for trial, index in best}


def robustness(
    scenario: Scenario,
    gaits: Mapping[Any, Gait],
    *,
    percents: Sequence[float] = PERCENTS,
    workers: int | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> pandas.DataFrame:
    """Distances of gaits under every change, simulated on the compiled engine.

    Columns: gait (its key), what (NOTHING first), percent, distance (m; NaN where the simulation
    failed), failure. `workers` and `say` are those of simulate_many().

    Raises InputError where a gait is for another number of tetrahedra.
    """
    import pandas

    scenario = scenario.with_changes({"simulation.engine": "compiled"})
    rows: list[dict[str, Any]] = []
    scenarios: list[Scenario] = []
    for what, percent, changed in _changes(scenario, percents):
        rows += [{"gait": key, "what": what, "percent": percent} for key in gaits]
        scenarios += [changed] * len(gaits)
    every = [gaits[row["gait"]] for row in rows]
    results = simulate_many(scenario=scenarios, gaits=every, workers=workers, say=say)
    for row, found in zip(rows, results, strict=True):
        if isinstance(found, SimulationFailure):
            row["distance"], row["failure"] = math.nan, str(found)
        else:
            row["distance"], row["failure"] = found.metrics.distance, None
    return pandas.DataFrame(rows)


def summarize(table: pandas.DataFrame, *, by: Sequence[str]) -> pandas.DataFrame:
    """Changes of the distance in a table of robustness(), grouped by gait, what or percent, which
    loses its sign.

    Columns, in the unit of the distance: unchanged (mean distance), median (of the absolute
    change), least and greatest (change); kept (share of the simulations, 0 to 1, that walk at
    least KEPT of the unchanged distance), failed (count).
    """
    is_changed = table["what"] != NOTHING
    changed = table[is_changed]
    before = changed["gait"].map(table[~is_changed].set_index("gait")["distance"])
    change = changed["distance"] - before
    changed = changed.assign(
        percent=changed["percent"].abs(),
        before=before,
        change=change,
        size=change.abs(),
        kept=change > (KEPT - 1.0) * before.abs(),
        failed=changed["failure"].notna(),
    )
    return changed.groupby(list(by), sort=False).agg(
        unchanged=("before", "mean"),
        median=("size", "median"),
        least=("change", "min"),
        greatest=("change", "max"),
        kept=("kept", "mean"),
        failed=("failed", "sum"),
    )


def describe(table: pandas.DataFrame) -> str:
    """Summaries of a table of robustness() for printing, in inches: by change, by gait."""
    inches = table.assign(distance=table["distance"] / INCH)
    shown: dict[Any, tuple[str, Callable[[Any], str]]] = {
        "percent": ("by", "± {:g} %".format),
        "unchanged": ("unchanged distance, in", fixed),
        "median": ("median change", fixed),
        "least": ("least", signed),
        "greatest": ("greatest", signed),
        "kept": (f"keeps {100.0 * KEPT:g} %", "{:.0%}".format),
        "failed": ("failed", str),
    }
    headings = {"what": "changed"} | {key: heading for key, (heading, _) in shown.items()}
    formats = dict(shown.values())
    texts = []
    for key in ("what", "gait"):
        summary = summarize(inches, by=[key, "percent"]).reset_index()[[key, *shown]]
        summary = summary.rename(columns=headings)
        texts.append(summary.to_string(index=False, formatters=formats))
    return "\n\n".join(texts)


def save_table(table: pandas.DataFrame, path: Path) -> None:
    """Writes a table of robustness() as CSV, the distance (m) in the column distance_m."""
    write_whole(path, table.rename(columns={"distance": "distance_m"}).to_csv(index=False))


def _changes(base: Scenario, percents: Sequence[float]) -> Iterator[tuple[str, float, Scenario]]:
    """What is changed, by how many percent, and the changed scenario; first the scenario itself."""
    yield NOTHING, 0.0, base
    friction = {f"friction.{field.name}" for field in dataclasses.fields(base.friction)}
    for what, keys in SCALED.items():
        if any(key.startswith("friction.") and key not in friction for key in keys):
            continue
        for percent in (sign * size for size in percents for sign in (-1.0, 1.0)):
            yield what, percent, scaled(base, keys, 1.0 + percent / 100.0)
    for percent in percents:
        for seed in range(DRAWS):
            yield DISPLACED, percent, displaced(base, percent=percent, seed=seed)
